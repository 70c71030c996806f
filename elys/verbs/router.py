"""router: passes sessions on, until it is asked to end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from typing import Any, Final, cast

import elys
from elys.bus.access.credentials import Credentials
from elys.bus.access.listening import Listening, access_of
from elys.bus.access.refusals import is_open, why_refused
from elys.bus.access.roles import Role
from elys.bus.beacon import Announcement, announced_endpoint, answering_askers
from elys.bus.discovery import complete_endpoint, credentials_at
from elys.bus.log import start_logging
from elys.bus.router import Router
from elys.bus.transports.zenoh import DEFAULT_ENDPOINT
from elys.bus.transports.zenoh_router import ZenohRouter
from elys.common.errors import AccessError
from elys.verbs.nodes import run_until_asked

_KNOCKING: Final = 3.0  # [s] in vain, until it is asked why
_log = logging.getLogger(__name__)


def router(listening: Listening, upstream: Sequence[str], *, discover: bool) -> None:
    """Runs a router.

    Raises:
        BusError: an endpoint is none or in use. AccessError: it has not what it must show above, or cannot ask those below.
    """
    start_logging()
    endpoint = listening.endpoint or DEFAULT_ENDPOINT
    above = [complete_endpoint(text, tls=listening.speaks_tls) for text in upstream]
    if discover:
        announced_endpoint(endpoint)
    access = access_of(
        listening
    )  # makes this user's keys, which a host above that starts beside it may not have made yet
    shown = None if listening.insecure or not above else required_credentials(above)
    opened = partial(ZenohRouter.open, endpoint, above, access=access, credentials=shown)
    run_until_asked(_route(opened, above, shown, discover=discover, needs_secret=access is not None))


def required_credentials(above: Sequence[str]) -> Credentials:
    """The owner's, which a router needs: it speaks for all who are below it. Raises AccessError if they are not there."""
    shown = credentials_at(above[0])
    if shown is None:
        remedy = "start it with --insecure too" if is_open(above[0]) else "give --key or ELYS_SECRET"
        raise AccessError(f"a router shows those above the owner's key, and none is here for {above[0]}: {remedy}")
    if shown.role < Role.OWNER:
        raise AccessError(
            f"a router speaks for all below it, so it needs the owner's key: {shown.source} is that of {shown.user}"
        )
    return shown


async def _route(
    opened: Callable[[], ZenohRouter],
    above: list[str],
    shown: Credentials | None,
    *,
    discover: bool,
    needs_secret: bool,
) -> None:
    transport = await asyncio.to_thread(opened)
    endpoint = transport.endpoint
    passed_on = Router(transport, _log.info)
    try:
        _log.info("routing at %s, below %s", endpoint, " or ".join(above) or "nobody")
        _log.info("below it: elys view --connect %s   elys router --connect %s", *[reachable(endpoint)] * 2)
        passed_on.start()
        async with _discoverable(passed_on, endpoint, wanted=discover, needs_secret=needs_secret):
            await _say_why_alone(passed_on, above, shown)
    finally:
        passed_on.close()
        await asyncio.to_thread(transport.close)


async def _say_why_alone(passed_on: Router, above: list[str], shown: Credentials | None) -> None:
    """For ever: says why nobody above lets this router in, once for each reason."""
    said = {""}
    while True:
        await asyncio.sleep(_KNOCKING)
        if passed_on.upstream:
            continue
        for endpoint in above:
            reason = await asyncio.to_thread(_why_alone, endpoint, shown)
            if reason not in said:
                said.add(reason)
                _log.warning("%s", reason)


def _why_alone(endpoint: str, shown: Credentials | None) -> str:
    if shown is not None and is_open(endpoint):
        return f"{endpoint} asks nobody who he is, and this router does: start both with --insecure, or neither"
    return why_refused(endpoint, shown).sentence


def reachable(endpoint: str) -> str:
    """An endpoint as others type it: where it names no address, with this machine's name."""
    import platform

    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.rpartition(":")
    return f"{protocol}/{platform.node() or host}:{port}" if host in ("0.0.0.0", "[::]") else endpoint


@contextlib.asynccontextmanager
async def _discoverable(passed_on: Router, endpoint: str, *, wanted: bool, needs_secret: bool) -> AsyncIterator[None]:
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
                needs_secret=needs_secret,
                age=now - began.setdefault(name, now),
                version=elys.__version__,
            )
            for name, hosts in sorted(passed_on.sessions.items())
        ]

    async with answering_askers(announcements):
        yield
