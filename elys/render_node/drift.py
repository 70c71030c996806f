"""How far bodies may have gone since a frame, all of them at once: a few passes over the columns of a frame that came."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.timeline import Timeline, rows_in


class Drift:
    """From the frame at which things were measured to what is seen. Newest frames tell of the same bodies as that one."""

    def __init__(self) -> None:
        self._origin: StateFrame | None = None
        self._arm = 0.0
        self._ends: tuple[StateFrame | None, StateFrame | None] = (None, None)
        self._far = (0.0, 0.0)
        self._gone = np.zeros((0, 3))

    def start(self, origin: StateFrame | None, arm: float) -> None:
        """Counts from a frame on; nothing that rides on a body is farther from it than `arm` [m]."""
        self._origin, self._arm = origin, arm
        self._ends = (None, None)

    def at(self, timeline: Timeline, fraction: float) -> float:
        """How far [m] anything may be from where it was at the start, `fraction` of the way to the newest frame."""
        newest, before = timeline.newest, timeline.previous
        if newest is None or self._origin is None:
            return 0.0
        if self._ends[1] is not newest or self._ends[0] is not before:
            now = self._distance(newest)
            was = now
            if before is not None:
                was = self._far[1] if before is self._ends[1] else self._distance_before(before)
            self._ends, self._far = (before, newest), (was, now)
        was, now = self._far
        if before is None or fraction == 1.0:
            return now
        beyond = max(fraction - 1.0, 0.0)
        far = max(was, now) + beyond * (was + now)
        return far + (2.0 * self._arm if timeline.spins else 0.0)

    def _distance_before(self, frame: StateFrame) -> float:
        """Of a frame that may tell of others: those who came since stand where the newest one says."""
        origin = self._origin
        assert origin is not None
        if np.array_equal(frame.entity, origin.entity):
            return self._distance(frame)
        rows, known = rows_in(frame.entity, origin.entity)
        if not known.any():
            return 0.0
        turned = frame.rotation[rows[known]] - origin.rotation[known] if self._arm > 0.0 else None
        return self._farthest(frame.position[rows[known]] - origin.position[known], turned)

    def _distance(self, frame: StateFrame) -> float:
        origin = self._origin
        assert origin is not None
        if frame is origin or not len(frame.position):
            return 0.0
        if len(self._gone) != len(origin.position):
            self._gone = np.empty_like(origin.position)  # kept: fresh memory costs more than what is written to it
        gone = np.subtract(frame.position, origin.position, out=self._gone)
        return self._farthest(gone, frame.rotation - origin.rotation if self._arm > 0.0 else None)

    def _farthest(self, gone: NDArray[np.float64], turned: NDArray[np.float32] | None) -> float:
        """How far anything got whose bodies have gone so far, and whose rotations differ by so much."""
        far = math.sqrt(3.0) * _largest(gone)
        # A turn by an angle takes the arm's end 2 sin(angle / 2) arms away; the quaternion goes 2 sin(angle / 4).
        return far if turned is None else far + min(4.0 * _largest(turned), 2.0) * self._arm


def _largest(differences: NDArray[np.floating[Any]]) -> float:
    """Of their sizes; what is no number has gone nowhere."""
    far = max(float(differences.max()), -float(differences.min()))
    if math.isfinite(far):
        return far
    return float(np.abs(np.nan_to_num(differences, nan=0.0, posinf=0.0, neginf=0.0)).max())
