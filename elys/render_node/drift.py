"""How far bodies may have gone since a frame, all of them at once: a few passes over the columns of a frame that came."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.timeline import Timeline, rows_in


class _Gone(NamedTuple):
    """[m] at the most, by which any body has moved, and what turns may add for what rides on one."""

    moved: float
    turned: float


_NOWHERE = _Gone(0.0, 0.0)


class Drift:
    """From the frame at which things were measured to what is seen. Newest frames tell of the same bodies as that one."""

    def __init__(self) -> None:
        self._origin: StateFrame | None = None
        self._arm = 0.0
        self._ends: tuple[StateFrame | None, StateFrame | None] = (None, None)
        self._far = (_NOWHERE, _NOWHERE)
        self._has_new = False
        self._places = self._difference = np.zeros((3, 0))

    def start(self, origin: StateFrame | None, arm: float) -> None:
        """Counts from a frame on; nothing that rides on a body is farther from it than `arm` [m]."""
        self._origin, self._arm = origin, arm
        self._ends = (None, None)
        self._has_new = False
        if origin is not None:
            # As columns, along which numpy is quick, and memory that is kept: fresh one costs more than what is written to it.
            self._places = np.ascontiguousarray(origin.position.T)
            self._difference = np.empty_like(self._places)

    @property
    def origin(self) -> StateFrame | None:
        """The frame at the start."""
        return self._origin

    def at(self, timeline: Timeline, fraction: float) -> float:
        """How far [m] anything may be from where it was at the start, `fraction` of the way to the newest frame."""
        newest, before = timeline.newest, timeline.previous
        if newest is None or self._origin is None:
            return 0.0
        if self._ends[1] is not newest or self._ends[0] is not before:
            now = self._distance(newest)
            was = now
            if before is not None and before is self._ends[1]:
                was, self._has_new = self._far[1], False
            elif before is not None:
                was = self._distance_before(before)
            self._ends, self._far = (before, newest), (was, now)
        was, now = self._far
        if before is None or fraction == 1.0:
            return now.moved + now.turned
        if timeline.spins:
            turned = 2.0 * self._arm
        else:
            turned = max(was.turned, now.turned) + max(fraction - 1.0, 0.0) * (was.turned + now.turned)
        # Distances to one place are convex along a straight way. Those who came with the newest frame are there already.
        moved = max(abs(1.0 - fraction) * was.moved + fraction * now.moved, now.moved if self._has_new else 0.0)
        return moved + turned

    def _distance_before(self, frame: StateFrame) -> _Gone:
        """Of a frame that may tell of others: those who came since stand where the newest one says."""
        origin = self._origin
        assert origin is not None
        self._has_new = not np.array_equal(frame.entity, origin.entity)
        if not self._has_new:
            return self._distance(frame)
        rows, known = rows_in(frame.entity, origin.entity)
        rows = rows[known]
        moved = (frame.position[rows] - origin.position[known]).T
        return self._gone(moved, frame.rotation[rows] - origin.rotation[known])

    def _distance(self, frame: StateFrame) -> _Gone:
        origin = self._origin
        assert origin is not None
        if frame is origin or not len(frame.position):
            return _NOWHERE
        moved = np.subtract(frame.position.T, self._places, out=self._difference)
        return self._gone(moved, frame.rotation - origin.rotation if self._arm > 0.0 else None)

    def _gone(self, moved: NDArray[np.float64], turned: NDArray[np.float32] | None) -> _Gone:
        """Of differences of positions (3, N) and of rotations (N, 4)."""
        far = _reach(moved)
        if not math.isfinite(far):  # what is no number has gone nowhere
            far = _reach(np.nan_to_num(moved, nan=0.0, posinf=0.0, neginf=0.0))
        if turned is None or self._arm == 0.0:
            return _Gone(far, 0.0)
        # A turn by an angle takes the arm's end 2 sin(angle / 2) arms away; the quaternion goes 2 sin(angle / 4).
        chord = _reach(turned.T)
        return _Gone(far, 2.0 * self._arm * (min(chord, 1.0) if math.isfinite(chord) else 1.0))


def _reach(columns: NDArray[np.floating[Any]]) -> float:
    """No vector (K, N) is longer than this, which takes the largest component along each axis: quicker than all lengths."""
    return math.hypot(*np.maximum(columns.max(axis=1, initial=0.0), -columns.min(axis=1, initial=0.0)).tolist())
