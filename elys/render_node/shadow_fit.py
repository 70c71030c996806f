"""Which part of the world one shadow map should cover, and the matrix that takes it there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View, frustum_corners
from elys.render_node.render_world import RenderWorld, without_giants
from elys.render_node.scene_tables import Rows

BORDER: Final = 4  # texels around what is covered: the filter looks over the edge
REACH_BEHIND: Final = 500.0  # [m] behind the casters in which shadows are seen; 24 bits of depth resolve 0.03 mm of it
NEAR_SHARE: Final = 1 / 16  # of the whole box' edge: how far from the eye the finer box reaches
FINER: Final = 4.0  # times, at the least, are its texels smaller: else it is not worth a second drawing
SIZE_STEPS: Final = 8  # sizes per doubling: small changes of the view leave the texels where they are


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowFit:
    """A box along the sun's direction."""

    map_from_relative: NDArray[np.float64]  # (4, 4) to clip space of the map
    texel: float  # [m]
    map_size: int  # [texels]
    key: tuple[float, ...]  # equal keys cover the same part of the world in the same way


def fit_near_shadow(
    world: RenderWorld, view: View, direction: NDArray[np.float64], whole: ShadowFit
) -> ShadowFit | None:
    """A second box around what is near the eye, where the view is so long that the one around all of it would be coarse there."""
    distance = whole.texel * whole.map_size * NEAR_SHARE
    if (np.linalg.norm(world.centre - view.eye, axis=1) - world.radius).min() > distance:
        return None  # there is nothing to see a shadow on
    near = fit_shadow(world, view, direction, map_size=whole.map_size, farthest=distance)
    return near if near is not None and near.texel * FINER <= whole.texel else None


def fit_shadow(
    world: RenderWorld,
    view: View,
    direction: NDArray[np.float64],
    *,
    map_size: int,
    farthest: float | None = None,
) -> ShadowFit | None:
    """The box that covers the world's casters, as far as they can darken what is seen of light that goes along `direction`.

    The map has `map_size` texels an edge. What is seen counts up to `farthest` [m] if that is given.
    A floor below all others is drawn into the map but does not widen it: its shadow falls on nothing. None if nothing is left.
    """
    casters = _some(world.casts)
    if not world.casts.any():
        return None
    light_from_world = _light_from_world(tuple(direction.tolist()))
    reach = world.radius[casters].astype(np.float64)
    in_light = light_from_world @ world.centre[casters].T  # (3, N): numpy is quick along rows
    kept = _some(~_floors(world, casters))
    lower = (in_light[:2, kept] - reach[kept]).min(axis=1)
    upper = (in_light[:2, kept] + reach[kept]).max(axis=1)
    corners = frustum_corners(view.clip_from_relative)
    if farthest is not None:
        near, far = corners[0::2], corners[1::2]
        depth = float(np.linalg.norm(far, axis=1).max())
        corners = np.concatenate([near, far * min(farthest / depth, 1.0)])
    seen = (corners + view.eye) @ light_from_world.T
    lower, upper = np.maximum(lower, seen[:, :2].min(axis=0)), np.minimum(upper, seen[:, :2].max(axis=0))
    if not (upper > lower).all():
        return None
    size = _rounded_up(float((upper - lower).max()) * map_size / (map_size - 2 * BORDER - 2))
    texel = size / map_size
    # Whole texels of the world: edges do not crawl while the camera moves.
    middle = np.floor((lower + upper) / 2 / texel) * texel
    # Light travels along -z. Neither end depends on the camera, so that a still scene keeps its map while somebody looks around.
    nearest = float((in_light[2] + reach).max())
    farthest = float((in_light[2, kept] - reach[kept]).min()) - REACH_BEHIND
    depth = max(nearest - farthest, 1e-3)
    map_from_light = np.eye(4)
    map_from_light[0, 0] = map_from_light[1, 1] = 2.0 / size
    map_from_light[:2, 3] = -middle * 2.0 / size
    map_from_light[2, 2] = -2.0 / depth
    map_from_light[2, 3] = (nearest + farthest) / depth
    light_from_relative = np.eye(4)
    light_from_relative[:3, :3] = light_from_world
    light_from_relative[:3, 3] = light_from_world @ view.eye
    key = (*direction.tolist(), *middle.tolist(), size, nearest, farthest)
    return ShadowFit(map_from_relative=map_from_light @ light_from_relative, texel=texel, map_size=map_size, key=key)


@lru_cache(maxsize=8)
def _light_from_world(direction: tuple[float, ...]) -> NDArray[np.float64]:
    """The rotation (3, 3) after which light that goes along `direction` goes along -z."""
    return quaternion.to_matrix(look_rotation(direction)).T.astype(np.float64)


def _some(chosen: NDArray[np.bool_]) -> Rows | slice:
    """An index for those that are chosen; where all are, one that copies nothing."""
    return slice(None) if chosen.all() else np.flatnonzero(chosen)


def _floors(world: RenderWorld, casters: Rows | slice) -> NDArray[np.bool_]:
    """Which casters dwarf all others and lie below them."""
    giants = ~without_giants(world.centre[casters], world.radius[casters].astype(np.float64))
    if giants.any():
        rows = np.arange(world.instance_count)[casters]
        bottom = world.boxes(rows[~giants])[0][:, 1].min()
        top = world.boxes(rows[giants])[1][:, 1]
        giants[giants] = top <= bottom + 0.02 * world.radius[rows[giants]]  # things sink in a little
    return giants


def _rounded_up(size: float) -> float:
    return float(2.0 ** (np.ceil(np.log2(max(size, 1e-3)) * SIZE_STEPS) / SIZE_STEPS))
