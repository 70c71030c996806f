"""foxglove: a running session, or a replay, for the Foxglove app; by itself, or beside what is run."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec

from elys.bus.log import start_logging
from elys.common.errors import ElysError
from elys.launch import before_exec
from elys.verbs.nodes import joined, run_until_asked

LOOPBACK = "127.0.0.1"
DEFAULT_PORT = 8765
_log = logging.getLogger(__name__)


def foxglove(connect: str | None, *, host: str, port: int, patience: float = 5.0) -> None:
    """Serves the session until it is told to end."""
    require_sdk()
    from elys.bus.asset_service import open_asset_cache
    from elys.bus.exports.foxglove_server import FoxgloveServer

    async def work() -> None:
        async with joined(connect, kind="tool", timeout=patience) as session:
            server = FoxgloveServer(session, await asyncio.to_thread(open_asset_cache))
            try:
                await server.open(host=host, port=port)
                _log.info("Foxglove: open a connection to ws://%s:%d", host, server.port)
                await asyncio.get_running_loop().create_future()
            finally:
                await server.close()

    start_logging()
    run_until_asked(work())


def require_sdk() -> None:
    """Raises ElysError unless foxglove-sdk is installed."""
    if find_spec("foxglove") is None:
        raise ElysError("serving Foxglove needs foxglove-sdk: pip install 'elys[foxglove]'")


@contextlib.contextmanager
def foxglove_beside(endpoint: str, port: int) -> Iterator[None]:
    """A process that serves the session at `endpoint`, as soon as it is there and as long as this lasts."""
    require_sdk()
    words = ("foxglove", "--connect", endpoint, "--port", str(port), "--patience", "600")
    process = subprocess.Popen(
        (sys.executable, "-m", "elys", *words),
        stdin=subprocess.DEVNULL,
        preexec_fn=before_exec(10),  # noqa: PLW1509  there are no threads yet
        start_new_session=True,
    )
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
