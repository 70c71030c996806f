"""view and edit: windows on a session that runs elsewhere."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, cast

from elys.bus.access.roles import Role
from elys.common.errors import AccessError, ElysError
from elys.verbs.nodes import joined, run_until_asked

ENCODINGS: Final = ("auto", "jpeg", "h264")


def view(
    connect: str | None,
    *,
    frame_limit: int,
    debug: str = "",
    age: bool = False,
    thin: bool = False,
    encoding: str = "auto",
    bit_rate: float = 0.0,
    full_frames: bool = False,
    ghosts: Sequence[Path] = (),
    ghosts_start_now: bool = False,
    player: int = 1,
    bindings: Path | None = None,
    plays: bool = False,
) -> None:
    """A window that draws the session by itself, or with `thin` shows what a render node of the session draws; with debug drawing
    of these kinds and the age of what is seen if asked. `bit_rate` [Mbit/s] is for H.264. All who look at the session see the
    `ghosts`, as long as the window is open. Who sits at it is the `player` of this number, with the bindings of a file, by
    default the user's; with `plays` the game has keys and mouse at once.
    """
    from elys.bus.discovery import choose_endpoint
    from elys.bus.log import start_logging
    from elys.common.input_bindings import FollowedBindings
    from elys.render_node.debug_drawing import parsed_kinds
    from elys.render_node.game_input import Seating
    from elys.render_node.window import probe_display
    from elys.verbs.ghosts import require_recordings, served

    _choose_states(full_frames)
    kinds = parsed_kinds(debug)
    if encoding not in ENCODINGS:
        raise ElysError(f"there is no encoding '{encoding}': pictures come as {', '.join(ENCODINGS)}")
    if not thin and (encoding != "auto" or bit_rate):
        raise ElysError("--encoding and --bit-rate are of pictures that come from elsewhere: give --thin as well")
    if ghosts_start_now and not ghosts:
        raise ElysError("--ghost-now says when ghosts begin: name one with --ghost")
    require_recordings(ghosts)
    followed = FollowedBindings(bindings)
    seating = Seating(player, followed, plays, followed.keep)
    start_logging()
    endpoint = choose_endpoint(connect)
    probe_display()

    async def work() -> None:
        async with (
            joined(endpoint, kind="viewer") as session,
            served(session, ghosts, starts_now=ghosts_start_now),
        ):
            frames = frame_limit or None
            if thin:
                from elys.render_node.thin_window import run_thin_view

                choice = cast(Any, encoding)
                await run_thin_view(
                    session,
                    choice=choice,
                    bit_rate=bit_rate * 1e6,
                    frames=frames,
                    debug=kinds,
                    age=age,
                    endpoint=endpoint or "",
                    seating=seating,
                )
            else:
                from elys.render_node.view_window import run_view

                await run_view(session, frames=frames, debug=kinds, age=age, seating=seating)

    run_until_asked(work())


def refuse_names(verb: str, names: Sequence[str]) -> None:
    """Raises ElysError where somebody wants to see what is no session: it says what shows that."""
    if not names:
        return
    name = names[0]
    if name.endswith(".mcap"):
        raise ElysError(
            f"{name} is a recording, and `elys {verb}` attaches to what runs: type `elys play {name} --edit`, or "
            f"`elys play {name}` and beside it `elys {verb}`"
        )
    raise ElysError(
        f"`elys {verb}` attaches to a session that runs, and takes no {name!r}: `elys run {name}` runs a scene, and "
        "--session or --connect chooses among sessions"
    )


def _choose_states(full_frames: bool) -> None:
    """For this process and those that it starts."""
    from elys.bus.streaming.choice import FULL, STATES

    if full_frames:
        os.environ[STATES] = FULL


def edit(connect: str | None, *, full_frames: bool = False) -> None:
    """An editor and a render node of its own; with nothing to attach to, the editor's start page."""
    from elys.bus.discovery import choose_endpoint, find_sessions
    from elys.render_node.window import probe_display
    from elys.verbs.nodes import editor
    from elys.verbs.run import start

    _choose_states(full_frames)
    if not connect and not find_sessions():
        probe_display()
        editor(None, starts_alone=True, frame_limit=0)
        return
    endpoint = choose_endpoint(connect)
    probe_display()
    asyncio.run(_require_session(endpoint))
    sys.exit(start("attach", {}, endpoint=endpoint))


async def _require_session(endpoint: str) -> None:
    """Knocks once, so that nobody there, or a viewer's key, is one line here and not a crash of two nodes."""
    async with joined(endpoint, kind="tool", timeout=5.0) as session:
        role = session.permissions.role
        if role < Role.EDITOR:
            raise AccessError(f"a {role.title} may not edit: use the key of an editor, or watch with `elys view`")
