"""What debug drawing listens to over a session: only what somebody wants, for lines are made for nobody else."""

from __future__ import annotations

from collections.abc import Callable, Collection

from elys.bus import topics
from elys.bus.messages.physics import ContactBatch, DebugLines
from elys.bus.messages.views import Debug
from elys.bus.session import Session
from elys.bus.transports.transport import Closer
from elys.render_node.debug_drawing import PHYSICS_LINES, DebugDrawing


class DebugListener:
    """Feeds a DebugDrawing with lines and contacts. `on_lines` is called with the key of lines that have come."""

    def __init__(self, session: Session, drawing: DebugDrawing, on_lines: Callable[[str], None]) -> None:
        self._session = session
        self._drawing = drawing
        self._on_lines = on_lines
        self._closers: dict[Debug, list[Closer]] = {}

    def want(self, kinds: Collection[Debug]) -> None:
        """Listens to what these kinds need from now on, and to nothing else."""
        for kind in [kind for kind in self._closers if kind not in kinds]:
            self._stop(kind)
            self._drawing.drop_lines(PHYSICS_LINES[kind])
        for kind, key in PHYSICS_LINES.items():
            if kind not in kinds or kind in self._closers:
                continue
            self._closers[kind] = [self._session.subscribe(topics.DEBUG_LINES, self._heard_lines, key=key)]
            if kind == "contacts":  # all that a replay tells of them
                self._closers[kind].append(self._session.subscribe(topics.CONTACTS, self._heard_contacts))

    def close(self) -> None:
        """Listens to nothing any more; what was heard may still be drawn."""
        for kind in list(self._closers):
            self._stop(kind)

    def _stop(self, kind: Debug) -> None:
        for closer in self._closers.pop(kind):
            closer()

    def _heard_lines(self, lines: DebugLines, key: str) -> None:
        self._drawing.take_lines(key, lines)
        self._on_lines(key)

    def _heard_contacts(self, batch: ContactBatch, _: str) -> None:
        self._drawing.take_contacts(batch)
