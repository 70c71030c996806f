"""router: passes sessions on, until it is asked to end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Sequence
from typing import Any, cast

import elys
from elys.bus.beacon import Announcement, announced_endpoint, answering_askers
from elys.bus.discovery import complete_endpoint
from elys.bus.log import start_logging
from elys.bus.router import Router
from elys.bus.transports.zenoh_router import ZenohRouter
from elys.verbs.nodes import run_until_asked

_log = logging.getLogger(__name__)


def router(listen: str, upstream: Sequence[str], *, discover: bool) -> None:
    """Runs a router; BusError for an endpoint that is none or in use."""
    start_logging()
    endpoint, above = complete_endpoint(listen), [complete_endpoint(text) for text in upstream]
    if discover:
        announced_endpoint(endpoint)
    run_until_asked(_route(endpoint, above, discover=discover))


async def _route(endpoint: str, above: list[str], *, discover: bool) -> None:
    transport = await asyncio.to_thread(ZenohRouter.open, endpoint, above)
    passed_on = Router(transport, _log.info)
    try:
        _log.info("routing at %s, below %s", endpoint, " or ".join(above) or "nobody")
        _log.info("below it: elys view --connect %s   elys router --connect %s", *[reachable(endpoint)] * 2)
        passed_on.start()
        async with _discoverable(passed_on, endpoint, wanted=discover):
            await asyncio.Event().wait()
    finally:
        passed_on.close()
        await asyncio.to_thread(transport.close)


def reachable(endpoint: str) -> str:
    """An endpoint as others type it: where it names no address, with this machine's name."""
    import platform

    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.rpartition(":")
    return f"{protocol}/{platform.node() or host}:{port}" if host in ("0.0.0.0", "[::]") else endpoint


@contextlib.asynccontextmanager
async def _discoverable(passed_on: Router, endpoint: str, *, wanted: bool) -> AsyncIterator[None]:
    if not wanted:
        yield
        return
    protocol, port = announced_endpoint(endpoint)
    began: dict[str, float] = {}

    def announcements() -> list[Announcement]:
        now = time.monotonic()
        return [
            Announcement(
                name=name,
                kind=cast(Any, sorted(hosts)[0].split("-")[0]),
                port=port,
                protocol=cast(Any, protocol),
                age=now - began.setdefault(name, now),
                version=elys.__version__,
            )
            for name, hosts in sorted(passed_on.sessions.items())
        ]

    async with answering_askers(announcements):
        yield
