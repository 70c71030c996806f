"""What it costs to let in only whom one means to: frames of 40 KB at 60 Hz from a host to a viewer in another process.

To everybody, to who shows a secret (with access control on every message), and to who shows a certificate inside TLS.

python -m tests.benchmarks.access ENDPOINT    the viewer; prints a JSON list of the frames' ages [ms]
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time
from statistics import median

from elys.bus import topics
from elys.bus.access.credentials import Credentials
from elys.bus.access.host import HostAccess, with_certificate
from elys.bus.access.keyring import Keyring, new_key
from elys.bus.access.roles import GIVEN
from elys.bus.discovery import join_session
from elys.bus.session import Session
from elys.bus.topics import Delivery
from elys.bus.transports.zenoh import ZenohTransport
from tests.benchmarks.figures import percentiles

FRAME_SIZE = 40_000  # [bytes] a thousand bodies
RATE = 60.0  # [Hz]
FRAME_COUNT, WARMING = 600, 60
PORT = 17560
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    ring = Keyring(keys=[new_key(role) for role in GIVEN])
    ring.authority.ensure()
    viewer = ring.named("viewer")
    kinds = (
        ("to everybody", "tcp", None, None),
        ("by secret and role", "tcp", HostAccess.of(ring), ring.credentials(viewer)),
        (
            "by certificate and role, inside TLS",
            "tls",
            HostAccess.with_certificates(ring, ("127.0.0.1",)),
            with_certificate(viewer, ring.authority),
        ),
    )
    rows = []
    for number, (what, protocol, access, credentials) in enumerate(kinds):
        ages, cost = asyncio.run(_host(f"{protocol}/127.0.0.1:{PORT + number}", access, credentials))
        rows.append((f"40 KB at 60 Hz to a viewer, {what}, age p50 / p99", percentiles(ages)))
        rows.append((f"of which processor time of the host for each frame, {what}", f"{cost:.3f} ms"))
    return rows


async def _host(endpoint: str, access: HostAccess | None, credentials: Credentials | None) -> tuple[list[float], float]:
    """Ages [ms] of the frames, and the median processor time [ms] of all threads of the host from one frame to the next."""
    transport = ZenohTransport.listen(endpoint, access=access)
    session = await Session.host(transport, name="bench", kind="simulation", epoch=1)
    shown = {name: getattr(credentials, name) for name in credentials.__slots__} if credentials is not None else None
    viewer = subprocess.Popen(
        (sys.executable, "-m", "tests.benchmarks.access", endpoint),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert viewer.stdin is not None and viewer.stdout is not None
    viewer.stdin.write(json.dumps(shown))
    viewer.stdin.close()
    await asyncio.to_thread(viewer.stdout.readline)
    costs, due = [], time.monotonic()
    for _ in range(WARMING + FRAME_COUNT):
        began = time.process_time()
        payload = time.time_ns().to_bytes(8, "little") + bytes(FRAME_SIZE - 8)
        transport.publish(topics.key_of("bench", topics.STATE), payload, Delivery.LATEST)
        due += 1.0 / RATE
        await asyncio.sleep(max(due - time.monotonic(), 0.0))
        costs.append(1000.0 * (time.process_time() - began))
    await session.close()
    ages = json.loads(await asyncio.to_thread(viewer.stdout.read))
    viewer.wait(20)
    return ages[WARMING:], median(costs[WARMING:])


async def _watch(endpoint: str) -> None:
    shown = json.loads(sys.stdin.read())
    credentials = Credentials(**shown) if shown else None
    session = await join_session(endpoint, kind="tool", credentials=credentials)
    ages: list[float] = []
    ended = asyncio.Event()

    def came(key: str, payload: bytes) -> None:
        ages.append((time.time_ns() - int.from_bytes(payload[:8], "little")) / 1e6)

    session.on_link(lambda connected: None if connected else ended.set())
    session.transport.subscribe(topics.key_of("bench", topics.STATE), came)
    print("watching", flush=True)
    await ended.wait()
    print(json.dumps(ages))


if __name__ == "__main__":
    asyncio.run(_watch(sys.argv[1]))
