"""The lines of the tree that one browser has in sight, out of however many there are."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final

from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.tree.filter import EVERYTHING, EntityFilter, FilterError, parse_filter
from elys.bus.tree.kinds import kind_of
from elys.bus.tree.rows import Row, TreeRows
from elys.web_node.requests import Rows

SHARE: Final = 0.004  # [s] that lines of a large scene are worked on before others have their turn
PAUSE: Final = 0.1  # [s] between two tellings


class TreeWindow:
    """Opened lines, search and window of one browser. `run` tells what is in it."""

    def __init__(self, mirror: SceneMirror, tell: Callable[..., None]) -> None:
        """`tell("rows", ...)` is called with what the window shows."""
        self._mirror = mirror
        self._tell = tell
        self._rows = TreeRows(mirror)
        self._unlisten = mirror.listen(self._follow)
        self._window: Rows | None = None
        self._filter: EntityFilter = EVERYTHING
        self._problem: dict[str, Any] | None = None
        self._revealed = 0
        self._told: dict[str, Any] = {}
        self._wake = asyncio.Event()

    def want(self, window: Rows) -> None:
        """Which lines are in sight, and what is searched."""
        if self._window is None or window.search != self._window.search:
            try:
                self._filter, self._problem = parse_filter(window.search), None
            except FilterError as error:  # what was found before stays until the search means something
                self._problem = {"problem": error.problem, "values": error.values}
        self._window, self._told = window, {}
        self._wake.set()

    def set_open(self, entity: int, is_open: bool, *, all_below: bool) -> None:
        """Opens or closes a line."""
        if all_below:
            self._rows.set_all_open(is_open, (entity,) if entity in self._mirror.entities else ())
        elif entity in self._mirror.entities:
            self._rows.set_open(entity, is_open)
        self._wake.set()

    def reveal(self, entity: int) -> None:
        """Opens all above an entity; the next telling says at which line it is."""
        above = self._mirror.entities.get(entity)
        self._revealed = entity if above is not None else 0
        while above is not None and above.parent:
            self._rows.set_open(above.parent, True)
            above = self._mirror.entities.get(above.parent)
        self._wake.set()

    def close(self) -> None:
        """Follows no more."""
        self._unlisten()

    async def run(self) -> None:
        """Tells what is in the window when it has changed, until cancelled."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            if self._window is None:
                continue
            self._rows.show(self._filter, share=SHARE)
            while self._rows.is_behind:
                await asyncio.sleep(0)
                self._rows.show(self._filter, share=SHARE)
            told = self._content(self._window)
            if told != self._told:
                self._told = told
                self._tell("rows", **told)
            await asyncio.sleep(PAUSE)

    def _content(self, window: Rows) -> dict[str, Any]:
        rows = self._rows
        place = rows.place_of(self._revealed) if self._revealed else -1
        revealed, self._revealed = self._revealed, 0
        first = min(window.first, len(rows))
        content: dict[str, Any] = {
            "first": first,
            "total": len(rows),
            "search": window.search,
            "entities": len(self._mirror.entities),
            "lines": [self._line(row) for row in rows[first : first + window.count]],
        }
        if rows.is_filtered:
            content["found"] = len(rows.found)
        if self._problem is not None:
            content["wrong"] = self._problem
        if revealed and place >= 0:
            content["revealed"] = {"entity": revealed, "place": place}
        return content

    def _line(self, row: Row) -> dict[str, Any]:
        entity = self._mirror.entities[row.entity]
        kind = kind_of(entity)
        line: dict[str, Any] = {"id": entity.id, "name": entity.name, "depth": row.depth, "kind": kind.name}
        line["open"] = 0 if not row.has_children else 2 if row.is_open else 1
        line["on"] = self._mirror.world_enabled(entity.id)
        line["dim"] = self._rows.is_filtered and entity.id not in self._rows.found
        return line

    def _follow(self, update: MirrorUpdate) -> None:
        self._rows.follow(update)
        self._wake.set()
