"""How far what throws shadows reaches, along and across the light."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.crowd import Crowd, without_giants
from elys.render_node.scene_tables import Rows

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
    if "floors" not in crowd.notes:
        crowd.notes["floors"] = _floors(crowd)
    is_floor: NDArray[np.bool_] = crowd.notes["floors"]
    key = light_from_world.tobytes()
    if key not in crowd.notes:
        crowd.notes[key] = _bounds(crowd, light_from_world, np.flatnonzero(crowd.is_slack(crowd.caster_rows)), is_floor)
    bounds: CasterBounds = crowd.notes[key].wider(crowd.slack)
    known = crowd.known_casters
    if len(known):
        known = np.searchsorted(crowd.caster_rows, known)
        bounds = bounds.with_others(_bounds(crowd, light_from_world, known, is_floor))
    return bounds


def _bounds(
    crowd: Crowd, light_from_world: NDArray[np.float64], places: Rows, is_floor: NDArray[np.bool_]
) -> CasterBounds:
    """Of some of the casters, by their places among them, where they were measured."""
    rows = crowd.caster_rows[places]
    reach = crowd.item_radius[rows].astype(np.float64)
    in_light = light_from_world @ crowd.item_centre[rows].T  # (3, N): numpy is quick along rows
    kept = ~is_floor[places] & np.isfinite(in_light[0])
    return CasterBounds(
        (in_light[:2, kept] - reach[kept]).min(axis=1, initial=np.inf),
        (in_light[:2, kept] + reach[kept]).max(axis=1, initial=-np.inf),
        float((in_light[2] + reach).max(initial=-np.inf)),
        float((in_light[2, kept] - reach[kept]).min(initial=np.inf)),
    )


def _floors(crowd: Crowd) -> NDArray[np.bool_]:
    """Which casters dwarf all others and lie below them."""
    rows = crowd.caster_rows
    giants = ~without_giants(crowd.item_centre[rows], crowd.item_radius[rows].astype(np.float64))
    if giants.any():
        bottom = crowd.boxes(rows[~giants])[0][:, 1].min()
        top = crowd.boxes(rows[giants])[1][:, 1]
        giants[giants] = top <= bottom + SUNK * crowd.item_radius[rows[giants]]
    return giants
