"""Real processes: a session recorded beside it and from outside over zenoh, verified, altered, forked, gone on with, compared."""

from __future__ import annotations

import asyncio
import json
import signal
from pathlib import Path
from typing import Any

import pytest

from elys.bus import topics
from elys.bus.messages.commands import Rewind, SetComponent, SetPlaying, StepTicks
from elys.bus.messages.state_frame import HEADER
from tests.process.clients import Client, client
from tests.process.conftest import Elys, wait_until
from tests.recorded_sessions import altered

pytestmark = pytest.mark.process


async def play(there: Client) -> None:
    """Time goes on, a cube is moved, time goes back and becomes another."""
    await there.until(lambda: there.status is not None and bool(there.mirror.entities))

    async def at(tick: int) -> None:
        await there.until(lambda: bool(there.frames) and there.frames[-1].tick == tick, seconds=60.0)

    assert (await there.ask(StepTicks(count=90))).accepted
    await at(90)
    cube = there.entity("Cube 3")
    moved = SetComponent(entity=cube, component="Transform", values={"position": [0.3, 2.5, 0.0]})
    assert (await there.ask(moved)).accepted
    assert (await there.ask(StepTicks(count=60))).accepted
    await at(150)
    assert (await there.ask(Rewind(tick=120))).accepted
    assert (await there.ask(moved)).accepted
    assert (await there.ask(SetPlaying(playing=True))).accepted
    await there.until(lambda: there.frames[-1].tick > 200, seconds=60.0)


def test_a_session_is_verified_forked_and_compared(elys: Elys, free_port: int, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    host = elys("run", "stack", "--headless", "--realtime", "--paused", "--listen", endpoint, "--record", "beside.mcap")
    host.wait_for("simulating")
    recorder = elys("record", "-o", "outside.mcap", "--connect", endpoint)
    recorder.wait_for("recording")
    outside = tmp_path / "outside.mcap"
    wait_until(lambda: outside.exists() and outside.stat().st_size > 20_000)  # an exact state is in it

    async def session() -> None:
        async with client(endpoint) as there:
            await play(there)

    asyncio.run(session())
    recorder.process.send_signal(signal.SIGINT)
    assert recorder.wait() == 0
    host.process.send_signal(signal.SIGINT)
    assert host.wait() == 0

    # From outside states may be left out; of what is there all is equal.
    for name, codes in (("beside.mcap", (0,)), ("outside.mcap", (0, 5))):
        verified = elys("verify", name)
        assert verified.wait() in codes, verified.output
        verified.wait_for(r"equal: \d+ (of \d+ )?ticks .* times real time")

    def flip(message: Any) -> bytes:
        body: bytes = message.body
        if message.channel == topics.STATE.name and HEADER.unpack_from(body)[1] == 100:
            return body[: HEADER.size + 8] + bytes([body[HEADER.size + 8] ^ 1]) + body[HEADER.size + 9 :]
        return body

    altered(tmp_path / "beside.mcap", tmp_path / "altered.mcap", flip)
    found = elys("verify", "altered.mcap", "--json")
    assert found.wait() == 1
    told = json.loads(found.output)
    assert (told["cause"], told["difference"]["tick"], told["difference"]["name"]) == (
        "altered",
        100,
        "entity 5 'Cube 1'",
    )

    def leave_out(message: Any) -> bytes | None:
        is_gone = message.channel == topics.STATE.name and 30 <= HEADER.unpack_from(message.body)[1] < 60
        return None if is_gone else message.body

    altered(tmp_path / "beside.mcap", tmp_path / "gaps.mcap", leave_out)
    incomplete = elys("verify", "gaps.mcap")
    assert incomplete.wait() == 5
    incomplete.wait_for(r"equal: \d+ of \d+ ticks compared, 30 are missing \(first: ticks 30-59\)")
    assert elys("verify", "nothing.mcap").wait() == 2
    forked = elys("fork", "beside.mcap", "--at", "1.8s", "-o", "same.mcap")
    assert forked.wait() == 0, forked.output
    compared = elys("diff", "beside.mcap", "same.mcap")
    assert compared.wait() == 0, compared.output
    (tmp_path / "edits.json").write_text('[{"type": "despawn", "entity": "Cube 10"}]')
    other = elys("fork", "beside.mcap", "--at", "1.8", "--edit", "edits.json", "--seconds", "1", "-o", "other.mcap")
    assert other.wait() == 0, other.output
    compared = elys("diff", "beside.mcap", "other.mcap")
    assert compared.wait() == 1
    compared.wait_for("Cube 10 is in beside.mcap alone, from tick 109")
    on = elys("run", "other.mcap", "--at", "2.5s", "--headless", "--steps", "20", "--record", "on.mcap")
    assert on.wait() == 0, on.output
    assert elys("verify", "on.mcap").wait() == 0
