"""Drives a ball along a level's line, with a gamepad's stick as a person would: it knows where things are, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.commands import Input
from elys.samples.game.course import Place
from elys.samples.game.levels import Ferry

Array = NDArray[np.float64]
TOP_SPEED: Final = 17.0  # [m/s] of a ball, see ball.py
DEAD_ZONE: Final = 0.15  # of its sticks
SEARCH: Final = 40  # stations ahead in which it looks for where it is
FAR: Final = 6.0  # [m] moved in a tick means that it was put elsewhere
ABOARD: Final = 2.0  # [m] from the middle of a ferry
DOCKED: Final = 0.3  # [m] from where it waits
WAITING: Final = 12.0  # [m] before an edge at which one looks for the ferry
RAMP: Final = 0.1  # of what leads up so steeply one flies off by itself
GAP: Final = 1.5  # [m] between two stations that nothing joins


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How somebody drives."""

    pace: float = 1.0  # share of the top speed that is ever asked for
    cornering: float = 9.0  # [m/s^2] sideways that are dared in a bend
    braking: float = 7.0  # [m/s^2] that are counted on before one
    jump_before: float = 1.2  # [m] before the edge of a gap


class Driver:
    """One player's hands. `input` is asked once a tick."""

    def __init__(
        self,
        line: Sequence[Place],
        *,
        ferries: Sequence[Ferry] = (),
        player: int = 1,
        style: Style | None = None,
    ) -> None:
        self._points = np.array([place.position for place in line])
        self._rises = np.array([place.forward[1] for place in line])
        self._style = style or Style()
        self._player = player
        self._ferries = ferries
        self._seen: dict[str, Array] = {}  # where ferries were a tick ago
        self._speeds = self._allowed()
        self._at = 0  # the station that is nearest
        self._before: Array | None = None
        self._jumps = False

    def input(
        self,
        position: Sequence[float],
        velocity: Sequence[float],
        heading: float,
        *,
        ferries: Mapping[str, Sequence[float]] = MappingProxyType({}),
    ) -> Input:
        """What the hands do.

        Args:
            position, velocity: of the ball, world space [m], [m/s].
            heading: of its camera [rad], 0 looks along -z, from above counterclockwise.
            ferries: where the middles of ferries are now, by name.
        """
        place, speed = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
        self._find(place)
        pace = math.hypot(speed[0], speed[2])
        wanted = self._ferry_speed(place, ferries)
        if wanted is None:
            way = (self._ahead(2.0 + 0.32 * pace) - place)[[0, 2]]
            wanted = way / max(float(np.hypot(*way)), 1e-9) * self._speeds[self._at]
        wanted = wanted / TOP_SPEED
        right = wanted[0] * math.cos(heading) - wanted[1] * math.sin(heading)
        ahead = -wanted[0] * math.sin(heading) - wanted[1] * math.cos(heading)
        length = math.hypot(right, ahead)
        out = (DEAD_ZONE + (1.0 - DEAD_ZONE) * min(length, 1.0)) / max(
            length, 1e-9
        )  # past the middle of a stick, that is dead
        axes = {"pad_left_x": float(right * out), "pad_left_y": float(-ahead * out)}
        jumps = self._is_before_gap(place)
        changes = (("pad_a", jumps),) if jumps != self._jumps else ()
        self._jumps = jumps
        return Input(player=self._player, axes=axes, changes=changes)

    def _find(self, place: Array) -> None:
        """Which station is nearest: of those ahead, or of all after it was put elsewhere."""
        was_put = self._before is None or float(np.linalg.norm(place - self._before)) > FAR
        self._before = place
        first, last = (0, len(self._points)) if was_put else (max(self._at - 4, 0), self._at + SEARCH)
        self._at = first + int(np.argmin(np.linalg.norm(self._points[first:last] - place, axis=1)))

    def _ahead(self, distance: float) -> Array:
        number = self._at
        while number + 1 < len(self._points) and distance > 0.0:
            distance -= float(np.linalg.norm(self._points[number + 1] - self._points[number]))
            number += 1
        return self._points[number]

    def _ferry_speed(self, place: Array, ferries: Mapping[str, Sequence[float]]) -> Array | None:
        """The level speed [m/s] that is wanted near a ferry: to wait for it, go aboard, stay there, and leave; else None."""
        for ferry in self._ferries:
            middle = np.asarray(ferries[ferry.name], dtype=float)
            speed = (middle - self._seen.get(ferry.name, middle)) * 60.0
            self._seen[ferry.name] = middle
            edge = self._points[ferry.station]
            if np.hypot(*(place - middle)[[0, 2]]) < ABOARD and abs(place[1] - middle[1]) < 1.5:
                if np.linalg.norm(middle - ferry.far) > DOCKED:
                    return speed[[0, 2]] + _limited(2.0 * (middle - place)[[0, 2]], 2.5)
                return _limited(6.0 * (self._points[ferry.station + 3] - place)[[0, 2]], 5.0)
            before = float(np.linalg.norm(edge - place))
            if self._at <= ferry.station and before < WAITING:
                if np.linalg.norm(middle - ferry.near) <= DOCKED or before < 0.5:
                    return _limited(3.0 * (middle - place)[[0, 2]], 5.0)
                stop = self._points[max(ferry.station - 5, 0)]
                return _limited(1.2 * (stop - place)[[0, 2]], 9.0)
        return None

    def _is_before_gap(self, place: Array) -> bool:
        for number in range(self._at, min(self._at + 6, len(self._points) - 1)):
            step = self._points[number + 1] - self._points[number]
            if np.linalg.norm(step) > GAP and number not in [ferry.station for ferry in self._ferries]:
                if self._rises[number] > RAMP:  # which throws it farther than a jump would
                    return False
                return float(np.linalg.norm((self._points[number] - place)[[0, 2]])) <= self._style.jump_before
        return False

    def _allowed(self) -> Array:
        """The speed [m/s] at each station, so that bends can be held and braked for: v^2 <= a r, and v dv/ds >= -b before."""
        points, style = self._points[:, [0, 2]], self._style
        speeds = np.full(len(points), TOP_SPEED * style.pace)
        span = 4  # stations over which a bend is measured
        for number in range(span, len(points) - span):
            a, b = points[number] - points[number - span], points[number + span] - points[number]
            turned = abs(math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b)))
            length = float(np.linalg.norm(a) + np.linalg.norm(b)) / 2.0
            if turned > 1e-3:
                speeds[number] = min(speeds[number], math.sqrt(style.cornering * length / turned))
        for number in range(len(points) - 2, -1, -1):
            length = float(np.linalg.norm(points[number + 1] - points[number]))
            speeds[number] = min(speeds[number], math.sqrt(speeds[number + 1] ** 2 + 2.0 * style.braking * length))
        return speeds


def _limited(vector: Array, most: float) -> Array:
    return vector * min(1.0, most / max(float(np.linalg.norm(vector)), 1e-9))
