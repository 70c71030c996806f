"""Which part of a recording is wanted: from when to when, how often, and whose motion."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.common.errors import RecordingError

Progress = Callable[[int, int], None]  # frames done, and of how many
_NAMED: Final = 5  # entities that are named where one is not found
_HAIR: Final = 1e-9  # [s] by which a frame may be late for its sample


def no_progress(done: int, total: int) -> None:
    """Tells nobody."""


class Selection(msgspec.Struct, frozen=True, kw_only=True):
    """What is asked for; by default all of it.

    `start` and `end` are simulation time [s], `rate` is samples per second of it (0: every tick), `entities` are names, in
    which * stands for anything; with each come all below it.
    """

    start: float = -math.inf
    end: float = math.inf
    rate: float = 0.0
    entities: tuple[str, ...] = ()


EVERYTHING: Final = Selection()


def selected_positions(recording: Recording, selection: Selection) -> NDArray[np.intp]:
    """The frames asked for [P]: of several of one tick the last, and for each sample the frame that holds then.

    Raises:
        RecordingError: the recording has none between start and end, or the rate is none.
    """
    if not (math.isfinite(selection.rate) and selection.rate >= 0.0):
        raise RecordingError(f"a rate of {selection.rate:g} a second is none")
    is_last = np.append(recording.tick[1:] != recording.tick[:-1], True)
    within = is_last & (recording.time >= selection.start - _HAIR) & (recording.time <= selection.end + _HAIR)
    positions = np.flatnonzero(within)
    if not len(positions):
        first, last = float(recording.time[0]), float(recording.time[-1])
        raise RecordingError(
            f"{recording.path} has no tick between {selection.start:g} s and {selection.end:g} s: it goes from {first:g} s "
            f"to {last:g} s"
        )
    if not selection.rate:
        return positions
    time = recording.time[positions]
    period = 1.0 / selection.rate
    sample = np.floor((time - time[0] + _HAIR) / period)
    # The first frame of each sample: one that is late by less than a tick is the best there is.
    return np.asarray(positions[np.append(True, sample[1:] != sample[:-1])])


def selected_scenes(
    recording: Recording, positions: NDArray[np.intp], progress: Progress = no_progress
) -> Iterator[tuple[SceneMirror, StateFrame, bool]]:
    """Each selected frame with the scene as it was then, and whether that is another than at the frame before.

    The mirror is the same one all along, and holds the frame.
    """
    mirror: SceneMirror | None = None
    for done, position in enumerate(positions.tolist()):
        if mirror is None or recording.needs_rebuilding(mirror, position):
            mirror, changed = recording.mirror_at(position), True
        else:
            followed = recording.advance(mirror, position)
            changed = followed is None or bool(followed)
            mirror.keep_frame(recording.frame(position))
        frame = mirror.latest_frame
        assert frame is not None
        yield mirror, frame, changed
        progress(done + 1, len(positions))


class NamedEntities:
    """Which entities of a scene that changes are meant by a selection's names, and that each name was found at least once."""

    def __init__(self, selection: Selection) -> None:
        self._patterns = selection.entities
        self._missing = set(selection.entities)
        self._seen: dict[str, None] = {}
        self.chosen: set[int] | None = None if not selection.entities else set()

    def look(self, mirror: SceneMirror) -> None:
        """Takes the scene as it is now; `chosen` is who is meant then, None for everybody."""
        if self.chosen is None:
            return
        chosen: set[int] = set()
        for entity in mirror.in_order():
            if len(self._seen) <= _NAMED:
                self._seen.setdefault(entity.name)
            found = [p for p in self._patterns if entity.name == p or fnmatch.fnmatchcase(entity.name, p)]
            self._missing.difference_update(found)
            if found or entity.parent in chosen:
                chosen.add(entity.id)
        self.chosen = chosen

    def rows(self, frame: StateFrame) -> NDArray[np.intp] | slice:
        """The rows of a frame's bodies that are meant."""
        if self.chosen is None:
            return slice(None)
        return np.flatnonzero(np.isin(frame.entity, np.fromiter(self.chosen, np.uint32, len(self.chosen))))

    def check(self, path: Path) -> None:
        """Raises RecordingError where a name was never found."""
        if self._missing:
            there = ", ".join(repr(name) for name in list(self._seen)[:_NAMED])
            more = " and others" if len(self._seen) > _NAMED else ""
            raise RecordingError(
                f"{path} has no entity named {sorted(self._missing)[0]!r} in that time; there are {there}{more}"
            )
