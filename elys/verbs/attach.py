"""view and edit: windows on a session that runs elsewhere."""

from __future__ import annotations

import asyncio
import sys

from elys.verbs.nodes import joined, run_until_asked


def view(connect: str | None, *, frame_limit: int, debug: str = "", age: bool = False) -> None:
    """A window that draws the session by itself, with debug drawing of these kinds and the age of what is seen if asked."""
    from elys.bus.discovery import choose_endpoint
    from elys.bus.log import start_logging
    from elys.render_node.debug_drawing import parsed_kinds
    from elys.render_node.view_window import run_view
    from elys.render_node.window import probe_display

    kinds = parsed_kinds(debug)
    start_logging()
    endpoint = choose_endpoint(connect)
    probe_display()

    async def work() -> None:
        async with joined(endpoint, kind="tool") as session:
            await run_view(session, frames=frame_limit or None, debug=kinds, age=age)

    run_until_asked(work())


def edit(connect: str | None) -> None:
    """An editor and a render node of its own."""
    from elys.bus.discovery import choose_endpoint
    from elys.render_node.window import probe_display
    from elys.verbs.run import start

    endpoint = choose_endpoint(connect)
    probe_display()
    asyncio.run(_require_session(endpoint))
    sys.exit(start("attach", {}, endpoint=endpoint))


async def _require_session(endpoint: str) -> None:
    """Knocks once, so that nobody there is one line here and not a crash of two nodes."""
    async with joined(endpoint, kind="tool", timeout=5.0):
        pass
