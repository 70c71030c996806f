"""Streaming as a process of its own: `python -m elys.bus.streaming.process --connect ENDPOINT`.

The host starts it when the first viewer behind a network asks. It ends with its host, whose pipe then closes, or when there was
no viewer for a minute.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import os
import signal
import sys
from typing import Final

from elys.bus.discovery import join_session
from elys.bus.log import start_logging
from elys.bus.streaming.choice import FULL, STATES
from elys.bus.streaming.server import StreamServer
from elys.common.errors import BusError

PATIENCE: Final = 60.0  # [s] without viewers
NICENESS: Final = 5  # the simulation comes first
_log = logging.getLogger(__name__)


def main(arguments: list[str] | None = None) -> int:
    """Serves until nobody is there any more; 0 then."""
    parser = argparse.ArgumentParser(prog="elys.bus.streaming.process")
    parser.add_argument("--connect", required=True, help="endpoint of the host")
    chosen = parser.parse_args(arguments)
    start_logging()
    os.nice(NICENESS)
    os.environ[STATES] = FULL
    for number in (signal.SIGINT, signal.SIGHUP):  # reach a whole group; the host says when it is over
        signal.signal(number, signal.SIG_IGN)
    try:
        asyncio.run(_serve(chosen.connect))
    except BusError as error:
        print(f"streaming: {error}", file=sys.stderr)
        return 1
    return 0


async def _serve(endpoint: str) -> None:
    session = await join_session(endpoint, kind="streamer")
    loop = asyncio.get_running_loop()
    work = asyncio.ensure_future(StreamServer(session).run(patience=PATIENCE))
    loop.add_reader(sys.stdin, _host_said, work)
    loop.add_signal_handler(signal.SIGTERM, work.cancel)
    try:
        with contextlib.suppress(asyncio.CancelledError):
            await work
    finally:
        loop.remove_reader(sys.stdin)
        await session.close()


def _host_said(work: asyncio.Future[None]) -> None:
    if not os.read(sys.stdin.fileno(), 4096):
        work.cancel()


if __name__ == "__main__":
    sys.exit(main())
