"""Ghosts: other runs shown beside a session, a recording or a film."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from elys.bus.log import start_logging
from elys.common.errors import ElysError
from elys.verbs.nodes import joined, run_until_asked

PATIENCE: Final = 5.0  # [s] for a host that is gone

if TYPE_CHECKING:
    from elys.bus.ghost_track import RecordedTrack
    from elys.bus.messages.ghosts import Color
    from elys.bus.session import Session


def require_recordings(files: Sequence[Path]) -> None:
    """Reads each once, so that what is no recording is one line here and not a crash of a node. Raises RecordingError."""
    from elys.bus.ghost_service import opened_ghosts

    for recording in opened_ghosts(list(files)):
        recording.close()


@contextlib.asynccontextmanager
async def served(
    session: Session, files: Sequence[Path], *, starts_now: bool = False, color: Color | None = None
) -> AsyncIterator[asyncio.Task[None] | None]:
    """Recordings as ghosts of a session as long as the context lasts; gives what ends when all of them were taken away.

    Raises:
        RecordingError: one is none.
    """
    if not files:
        yield None
        return
    from elys.bus.ghost_service import ALIGNED_NOW, GhostServer, opened_ghosts
    from elys.bus.messages.ghosts import GHOST_COLORS

    with contextlib.ExitStack() as stack:
        servers = []
        for number, recording in enumerate(await asyncio.to_thread(opened_ghosts, list(files))):
            stack.callback(recording.close)
            tint = color if color is not None else GHOST_COLORS[number % len(GHOST_COLORS)]
            offset = ALIGNED_NOW if starts_now else 0.0
            servers.append(GhostServer(recording, session, color=tint, offset=offset))

        async def all_of_them() -> None:
            await asyncio.gather(*(server.run() for server in servers))

        running = asyncio.ensure_future(all_of_them())
        try:
            yield running
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


@contextlib.contextmanager
def recorded_tracks(files: Sequence[Path]) -> Iterator[dict[str, RecordedTrack]]:
    """Recordings as ghosts of films and pictures. Raises RecordingError for one that is none."""
    if not files:
        yield {}
        return
    from elys.bus.ghost_service import opened_ghosts
    from elys.bus.ghost_track import RecordedTrack
    from elys.bus.messages.ghosts import GHOST_COLORS

    with contextlib.ExitStack() as stack:
        tracks = {}
        for number, recording in enumerate(opened_ghosts(list(files))):
            stack.callback(recording.close)
            tracks[str(number)] = RecordedTrack(recording, color=GHOST_COLORS[number % len(GHOST_COLORS)])
        yield tracks


def ghost(recording: Path, *, connect: str | None, color: str, starts_now: bool) -> None:
    """A process that serves a recording as ghost of a session, until it is taken away or the session is gone for good."""
    tint = parsed_color(color) if color else None

    async def work() -> None:
        async with (
            joined(connect, kind="ghost", timeout=60.0) as session,
            served(session, [recording], starts_now=starts_now, color=tint) as running,
        ):
            assert running is not None
            gone = asyncio.ensure_future(_until_gone(session))
            await asyncio.wait((running, gone), return_when=asyncio.FIRST_COMPLETED)
            gone.cancel()

    start_logging()
    run_until_asked(work())


async def _until_gone(session: Session) -> None:
    """Returns when the host has been away for so long that it will not come back."""
    changed = asyncio.Event()
    session.on_link(lambda _: changed.set())
    while True:
        changed.clear()
        try:
            async with asyncio.timeout(None if session.connected else PATIENCE):
                await changed.wait()
        except TimeoutError:
            return


def parsed_color(text: str) -> Color:
    """The colour that RRGGBB says. Raises ElysError."""
    try:
        red, green, blue = bytes.fromhex(text.removeprefix("#"))
    except ValueError:
        raise ElysError(f"'{text}' is no colour: write RRGGBB, two hex digits each for red, green and blue") from None
    return red, green, blue
