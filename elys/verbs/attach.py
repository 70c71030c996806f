"""view and edit: windows on a session that runs elsewhere."""

from __future__ import annotations

import asyncio
import sys

from elys.verbs.nodes import joined, run_until_asked


def view(connect: str | None, *, frame_limit: int) -> None:
    """A window that draws the session by itself."""
    from elys.bus.discovery import choose_endpoint
    from elys.bus.log import start_logging
    from elys.render_node.view_window import run_view
    from elys.render_node.window import probe_display

    start_logging()
    endpoint = choose_endpoint(connect)
    probe_display()

    async def work() -> None:
        async with joined(endpoint, kind="tool") as session:
            await run_view(session, frames=frame_limit or None)

    run_until_asked(work())


def edit(connect: str | None) -> None:
    """An editor and a render node of its own; with nothing to attach to, the editor's start page."""
    from elys.bus.discovery import choose_endpoint, find_sessions
    from elys.render_node.window import probe_display
    from elys.verbs.nodes import editor
    from elys.verbs.run import start

    if not connect and not find_sessions():
        probe_display()
        editor(None, starts_alone=True, frame_limit=0)
        return
    endpoint = choose_endpoint(connect)
    probe_display()
    asyncio.run(_require_session(endpoint))
    sys.exit(start("attach", {}, endpoint=endpoint))


async def _require_session(endpoint: str) -> None:
    """Knocks once, so that nobody there is one line here and not a crash of two nodes."""
    async with joined(endpoint, kind="tool", timeout=5.0):
        pass
