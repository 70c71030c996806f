"""How far what throws shadows reaches, along and across the light."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.crowd import Crowd, without_giants
from elys.render_node.scene_tables import Rows, places_in

KEPT_LIGHTS: Final = 4  # directions of light of which it is kept what they see
SUNK: Final = 0.02  # of a floor's radius, by which things may have sunk into it


class CasterBounds(NamedTuple):
    """In space whose -z is the way of the light."""

    lower: NDArray[np.float64]  # (2,) [m] of all but floors
    upper: NDArray[np.float64]
    nearest: float  # to the light, of all [m]
    farthest: float  # of all but floors

    def wider(self, slack: float) -> CasterBounds:
        """Where all may be elsewhere by so much [m]."""
        return CasterBounds(self.lower - slack, self.upper + slack, self.nearest + slack, self.farthest - slack)

    def with_others(self, others: CasterBounds) -> CasterBounds:
        """Of these and of others."""
        return CasterBounds(
            np.minimum(self.lower, others.lower),
            np.maximum(self.upper, others.upper),
            max(self.nearest, others.nearest),
            min(self.farthest, others.farthest),
        )


def caster_bounds(crowd: Crowd, light_from_world: NDArray[np.float64]) -> CasterBounds:
    """Of all solid casters of a crowd, of which there are some, where they are or may be.

    A floor below all others does not count across the light: its shadow falls on nothing.
    """
    if not isinstance(crowd.note, _Casters):
        crowd.note = _Casters(crowd)
    casters = crowd.note
    bounds = casters.bounds(light_from_world).wider(crowd.slack)
    known = crowd.known_casters
    if len(known):
        is_floor = casters.is_floor[np.searchsorted(crowd.caster_rows, known)]
        in_light = _in_light(crowd.item_centre[known].T, light_from_world)
        bounds = bounds.with_others(_bounds(in_light, crowd.item_radius[known].astype(np.float64), is_floor))
    return bounds


class _Casters:
    """The N solid casters of a crowd where they were measured, and what has been worked out of it."""

    def __init__(self, crowd: Crowd) -> None:
        self._crowd, self._rows = crowd, crowd.caster_rows
        slack = crowd.is_slack(self._rows)
        self._slack = slice(None) if slack.all() else np.flatnonzero(slack)
        self._centre = crowd.item_centre.T[:, self._rows]  # (3, N): numpy is quick along rows
        self._radius = crowd.item_radius[self._rows].astype(np.float64)
        self._ends: NDArray[np.float64] | None = None  # (2, N) [m] the heights of their boxes' bottoms and tops
        self._seen_by: dict[bytes, NDArray[np.float64]] = {}  # their centres (3, N), by the light's rotation
        self._bounds: dict[bytes, CasterBounds] = {}
        self._is_floor: NDArray[np.bool_] | None = None

    def move(self, rows: Rows) -> None:
        """Takes where some instances of the crowd, ascending, are measured now."""
        places, is_caster = places_in(self._rows, rows)
        rows = rows[is_caster]
        centre = self._crowd.item_centre[rows].T
        self._centre[:, places] = centre
        self._radius[places] = self._crowd.item_radius[rows]
        if self._ends is not None:
            self._ends[:, places] = self._ends_of(rows)
        for light, in_light in self._seen_by.items():
            in_light[:, places] = _in_light(centre, np.frombuffer(light).reshape(3, 3))
        self._bounds.clear()
        self._is_floor = None

    def bounds(self, light_from_world: NDArray[np.float64]) -> CasterBounds:
        """Of those that may be elsewhere by now than where they were measured."""
        key = light_from_world.tobytes()
        if key not in self._bounds:
            if key not in self._seen_by:
                while len(self._seen_by) >= KEPT_LIGHTS:  # a light that turns comes from somewhere else each time
                    oldest = next(iter(self._seen_by))
                    del self._seen_by[oldest]
                    self._bounds.pop(oldest, None)
                self._seen_by[key] = _in_light(self._centre, light_from_world)
            slack = self._slack
            self._bounds[key] = _bounds(self._seen_by[key][:, slack], self._radius[slack], self.is_floor[slack])
        return self._bounds[key]

    @property
    def is_floor(self) -> NDArray[np.bool_]:
        """Which (N,) dwarf all others and lie below them."""
        if self._is_floor is None:
            giants = self._is_floor = ~without_giants(self._centre.T, self._radius)
            if giants.any():
                if self._ends is None:
                    self._ends = self._ends_of(self._rows)
                bottom = self._ends[0, ~giants].min()
                giants[giants] = self._ends[1, giants] <= bottom + SUNK * self._radius[giants]
        return self._is_floor

    def _ends_of(self, rows: Rows) -> NDArray[np.float64]:
        lower, upper = self._crowd.boxes(rows)
        return np.array((lower[:, 1], upper[:, 1]))


def _in_light(centre: NDArray[np.float64], light_from_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (3, N) as the light sees them. A sum for each, not BLAS: of one it is the same as of all, to the last bit."""
    x, y, z = centre
    return np.array([row[0] * x + row[1] * y + row[2] * z for row in light_from_world])


def _bounds(in_light: NDArray[np.float64], reach: NDArray[np.float64], is_floor: NDArray[np.bool_]) -> CasterBounds:
    """Of spheres at such places (3, N) and so large (N,)."""
    kept = ~is_floor & np.isfinite(in_light[0])
    # Not by a mask: that would lay them out place by place, along which numpy is slow.
    counted, radius = np.compress(kept, in_light, axis=1), reach[kept]
    near, far = counted - radius, counted + radius
    return CasterBounds(
        near[:2].min(axis=1, initial=np.inf),
        far[:2].max(axis=1, initial=-np.inf),
        float((in_light[2] + reach).max(initial=-np.inf)),
        float(near[2].min(initial=np.inf)),
    )
