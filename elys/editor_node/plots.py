"""What is plotted: series of fields, read as the state frames arrive, also those of a recording.

STATE ──> scene mirror ──> FieldPaths.read ──> SeriesTable        DIAGNOSTICS ──> the row of its tick
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from elys.bus.messages.physics import Diagnostics
from elys.bus.messages.state_frame import StateFrame
from elys.bus.transports.transport import Closer
from elys.editor_node.field_paths import FieldPathError, FieldPaths, PlotField
from elys.editor_node.language import tr
from elys.editor_node.plot_series import Series, SeriesTable
from elys.editor_node.scene_mirror import EditorScene

MAX_SERIES: Final = 32


class Plots:
    """Nothing is read, and nothing listened to, while there is no series or `is_paused`.

    `watch_measured` subscribes to what the host measures of everything.
    """

    def __init__(
        self, scene: EditorScene, *, watch_measured: Callable[[Callable[[Diagnostics], None]], Closer]
    ) -> None:
        self.paths = FieldPaths(scene)
        self.table = SeriesTable()
        self._scene = scene
        self._watch_measured = watch_measured
        self._stop_measured: Closer | None = None
        self._fields: dict[str, PlotField | None] = {}  # None: it leads nowhere at the moment
        self._resolved_at: tuple[int, int] = (-1, -1)
        self.is_paused = False
        scene.frame_listeners.append(self._frame_arrived)

    def add(self, path: str) -> Series:
        """Plots a field from now on; its number of this moment is the first.

        Raises:
            FieldPathError: the path leads to no number, or there are MAX_SERIES already.
        """
        field = self.paths.resolve(path)
        if len(self.table.series) >= MAX_SERIES:
            raise FieldPathError(tr("{count} fields are plotted already: take one away first", count=MAX_SERIES))
        series = self.table.add(field.path, field.unit)
        self._fields[field.path] = field
        self._follow_measured()
        if self._scene.frame is not None and not self.is_paused:
            self._frame_arrived(self._scene.frame)
        return series

    def remove(self, series: Series) -> None:
        """Plots it no longer."""
        self.table.remove(series)
        del self._fields[series.path]
        self._follow_measured()

    def clear(self) -> None:
        """Forgets the past of all."""
        self.table.clear()

    def newest(self, series: Series) -> float:
        """The last number of a series; not a number before the first."""
        values = self.table.values(series)
        return float(values[-1]) if len(values) else math.nan

    # --- inside ----------------------------------------------------------------------------------------------------

    def _frame_arrived(self, frame: StateFrame) -> None:
        if self.is_paused or not self.table.series:
            return
        self._resolve_again()
        values = []
        for series in self.table.series:
            field = self._fields[series.path]
            values.append(self.paths.read(field) if field is not None else math.nan)
        self.table.append(frame.tick, frame.simulation_time, values)

    def _resolve_again(self) -> None:
        """Names may lead to others, or nowhere, once the tree has changed."""
        version = (self._scene.structure_version, self._scene.mirror.epoch)
        if version == self._resolved_at:
            return
        self._resolved_at = version
        for path, field in self._fields.items():
            if field is None or not self._scene.exists(field.entity):
                try:
                    self._fields[path] = self.paths.resolve(path)
                except FieldPathError:
                    self._fields[path] = None

    def _follow_measured(self) -> None:
        is_wanted = any(field is not None and not field.entity for field in self._fields.values())
        if is_wanted and self._stop_measured is None:
            self._stop_measured = self._watch_measured(self._measured)
        elif not is_wanted and self._stop_measured is not None:
            self._stop_measured()
            self._stop_measured = None

    def _measured(self, found: Diagnostics) -> None:
        """Of a tick whose frame came before it."""
        if self.is_paused:
            return
        for series in self.table.series:
            field = self._fields[series.path]
            if field is not None and not field.entity:
                self.table.set_late(found.tick, series, self.paths.read(field, found))
