"""The streaming process of a host: started when the first viewer behind a network asks, beside the simulation and never in it."""

from __future__ import annotations

import asyncio
import logging
import os
import sys
from typing import Final

from elys.bus import topics
from elys.bus.messages.streaming import StreamOffer, StreamRequest
from elys.bus.session import Session
from elys.common.errors import RequestError

_RESTART_PAUSE: Final = 1.0  # [s] between two starts: one that fails at once must not be all that the host does
_log = logging.getLogger(__name__)


class StreamingChild:
    """Answers who asks a session for a stream, and sees to it that somebody sends it."""

    def __init__(self, session: Session, endpoint: str) -> None:
        self._endpoint = endpoint
        self._process: asyncio.subprocess.Process | None = None
        self._started_at = -_RESTART_PAUSE
        self._starting = asyncio.Lock()
        session.serve(topics.STREAM_ASK, self._asked)

    async def start(self) -> None:
        """Starts it before somebody asks: who listens beyond this machine is waiting for somebody."""
        try:
            async with self._starting:
                await self._start("whoever comes")
        except RequestError as error:
            _log.warning("%s", error)

    async def close(self) -> None:
        """Ends the process, which ends by itself when this one does."""
        process = self._process
        if process is None or process.returncode is not None:
            return
        assert process.stdin is not None
        process.stdin.close()
        try:
            await asyncio.wait_for(process.wait(), 5.0)
        except TimeoutError:
            process.kill()
            await process.wait()

    async def _asked(self, request: StreamRequest, _: str) -> StreamOffer:
        async with self._starting:
            if self._process is not None and self._process.returncode is None:
                return StreamOffer()
            now = asyncio.get_running_loop().time()
            if now - self._started_at >= _RESTART_PAUSE:
                self._started_at = now
                await self._start(request.node)
            return StreamOffer(starting=True)

    async def _start(self, node: str) -> None:
        try:
            # Its input is a pipe of which this process holds the other end: however this one ends, that one hears of it.
            self._process = await asyncio.create_subprocess_exec(
                sys.executable,
                *("-m", "elys.bus.streaming.process", "--connect", self._endpoint),
                stdin=asyncio.subprocess.PIPE,
                start_new_session=True,
                env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )
        except OSError as error:
            raise RequestError(f"the host cannot start a process that streams ({error.strerror})") from error
        _log.info("streaming to %s and others from process %d", node, self._process.pid)
