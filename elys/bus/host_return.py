"""Waiting for a host that is away: who asks something while the line is cut is answered when it is whole again, if in time."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from elys.common.errors import ConnectionLost

if TYPE_CHECKING:
    from elys.bus.session import Session


async def until_back(session: Session, timeout: float) -> float:
    """Returns as soon as the session's host is there, and what is left of `timeout` [s].

    Nothing is asked on a line that is about to be left: whoever would answer there is not known there yet, or not any more.

    Raises:
        ConnectionLost: it was away for longer, or came back as another run, which was not meant.
    """
    if session.connected:
        return timeout
    loop, epoch = asyncio.get_running_loop(), session.epoch
    begun, back = loop.time(), loop.create_future()

    def changed(connected: bool) -> None:
        if connected and not back.done():
            back.set_result(None)

    stop = session.on_link(changed)
    try:
        async with asyncio.timeout(timeout):
            await back
    except TimeoutError:
        raise ConnectionLost(f"nobody answered within {timeout:g} s") from None
    finally:
        stop()
    if session.epoch != epoch:
        raise ConnectionLost("the host was started anew meanwhile: look at its scene, and ask again")
    return max(timeout - (loop.time() - begun), 0.001)
