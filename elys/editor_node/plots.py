"""What is plotted: series of fields, read as the state frames arrive, also those of a recording.

STATE, each frame ──> scene mirror ──> FieldPaths.read ──> SeriesTable        DIAGNOSTICS ──> the row of its tick
                                                                  CONTACTS ──> ContactCounts ──> the rows since its tick

Panels are content with the newest frame. A measurement is not: while something is plotted every frame is taken, also those that
came while the editor was busy drawing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Protocol, TypeVar

from elys.bus import topics
from elys.bus.messages.physics import Diagnostics
from elys.bus.messages.state_frame import StateFrame
from elys.bus.topics import Topic
from elys.bus.transports.transport import Closer
from elys.editor_node.contact_counts import ContactCounts
from elys.editor_node.field_paths import CONTACTS, FieldPathError, FieldPaths, PlotField
from elys.editor_node.language import tr
from elys.editor_node.plot_series import Series, SeriesTable
from elys.editor_node.scene_mirror import EditorScene

MAX_SERIES: Final = 32
M = TypeVar("M")


class Watch(Protocol):
    """Subscribes to every message of a topic, none left out."""

    def __call__(self, topic: Topic[M], heard: Callable[[M], None], /) -> Closer:
        """Begins; what is returned ends it."""


class Plots:
    """Nothing is listened to while there is no series, and nothing read while `is_paused`."""

    def __init__(self, scene: EditorScene, *, watch: Watch, contacts: ContactCounts) -> None:
        self.paths = FieldPaths(scene, contacts_of=contacts.count)
        self.table = SeriesTable()
        self._scene = scene
        self._watch = watch
        self._contacts = contacts
        contacts.on_change = self._contacts_changed
        self._closers: dict[str, Closer] = {}  # of the topics that are listened to
        self._fields: dict[str, PlotField | None] = {}  # None: it leads nowhere at the moment
        self._resolved_at: tuple[int, int] = (-1, -1)
        self.is_paused = False
        self._newest_tick = -1

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
        self._follow()
        if self._scene.frame is not None:
            self._frame_arrived(self._scene.frame)
        return series

    def remove(self, series: Series) -> None:
        """Plots it no longer."""
        self.table.remove(series)
        del self._fields[series.path]
        self._follow()

    def clear(self) -> None:
        """Forgets the past of all."""
        self.table.clear()

    def another_run(self) -> None:
        """Another host, or another run of it: what touches is asked for anew."""
        self._newest_tick = -1
        if CONTACTS in self._closers:
            self._contacts.ask_again()

    def newest(self, series: Series) -> float:
        """The last number of a series; not a number before the first."""
        values = self.table.values(series)
        return float(values[-1]) if len(values) else math.nan

    # --- inside ----------------------------------------------------------------------------------------------------

    def _frame_arrived(self, frame: StateFrame) -> None:
        if self.is_paused or not self.table.series:
            return
        self._scene.mirror.keep_frame(frame)  # which ends at the newest one, as every frame comes here
        self._resolve_again()
        if CONTACTS in self._closers and (frame.is_told_again or frame.is_forked or frame.tick < self._newest_tick):
            self._contacts.ask_again()  # time was turned back
        self._newest_tick = frame.tick
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
            if field is None or (field.entity and not self._scene.exists(field.entity)):
                try:
                    self._fields[path] = self.paths.resolve(path)
                except FieldPathError:
                    self._fields[path] = None

    def _follow(self) -> None:
        """Listens to what the series need."""
        needs_world = any(field is not None and not field.entity for field in self._fields.values())
        self._listen(topics.STATE, self._frame_arrived, is_wanted=bool(self._fields))
        self._listen(topics.DIAGNOSTICS, self._measured, is_wanted=needs_world)
        needs_contacts = any(field is not None and _is_of_contacts(field) for field in self._fields.values())
        if needs_contacts and CONTACTS not in self._closers:
            self._closers[CONTACTS] = self._contacts.start(self._watch)
        elif not needs_contacts and CONTACTS in self._closers:
            self._closers.pop(CONTACTS)()

    def _listen(self, topic: Topic[M], heard: Callable[[M], None], *, is_wanted: bool) -> None:
        if is_wanted and topic.name not in self._closers:
            self._closers[topic.name] = self._watch(topic, heard)
        elif not is_wanted and topic.name in self._closers:
            self._closers.pop(topic.name)()

    def _contacts_changed(self, tick: int) -> None:
        """Frames of that tick, and of later ones, may have come before."""
        if self.is_paused:
            return
        for series in self.table.series:
            field = self._fields[series.path]
            if field is not None and _is_of_contacts(field):
                self.table.set_from(tick, series, self.paths.read(field))

    def _measured(self, found: Diagnostics) -> None:
        """Of a tick whose frame came before it."""
        if self.is_paused:
            return
        for series in self.table.series:
            field = self._fields[series.path]
            if field is not None and not field.entity:
                self.table.set_late(found.tick, series, self.paths.read(field, found))


def _is_of_contacts(field: PlotField) -> bool:
    return bool(field.entity) and not field.component and field.field == CONTACTS
