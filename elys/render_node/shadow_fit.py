"""Which parts of the world the sun's shadow maps should cover, and the matrices that take them there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View, frustum_corners
from elys.render_node.caster_bounds import caster_bounds
from elys.render_node.crowd import Crowd
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_tables import Rows

BORDER: Final = 4  # texels around what is covered: the filter looks over the edge
REACH_BEHIND: Final = 500.0  # [m] behind the casters in which shadows are seen; 24 bits of depth resolve 0.03 mm of it
SHARE: Final = 1 / 4  # of the distance to which a box reaches, to which the next finer one does
FINER: Final = 3.0  # times, at the least, are its texels smaller: else it is not worth another drawing
MOST_CASCADES: Final = 4
SIZE_STEPS: Final = 8  # sizes per doubling: small changes of the view leave the texels where they are


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowFit:
    """A box along the sun's direction."""

    map_from_relative: NDArray[np.float64]  # (4, 4) to clip space of the map
    texel: float  # [m]
    map_size: int  # [texels]
    key: tuple[float, ...]  # equal keys cover the same part of the world in the same way


def atlas_shape(count: int) -> tuple[int, int]:
    """Columns and rows of the atlas in which so many maps lie, from the lower left, row by row."""
    return min(count, 2), (count + 1) // 2


def fit_cascades(
    world: RenderWorld, view: View, direction: NDArray[np.float64], *, map_size: int, most: int
) -> tuple[ShadowFit, ...]:
    """The boxes that cover what `fit_shadow` says, the finest first, that of all last: as few as the depths that are seen need,
    and at most `most`; none where nothing is to be covered.

    Finer ones are squares around what is seen up to some distance from the eye. They neither grow nor shrink while the eye
    turns or goes, and stand on whole texels of the world: edges of shadows stay where they are.
    """
    whole = fit_shadow(world, view, direction, map_size=map_size)
    if whole is None:
        return ()
    if most == 1 or view.camera.ortho_height > 0.0:  # where nothing is nearer than anything else
        return (whole,)
    nearest = max(_nearest(world.crowd, view.eye), view.camera.near)
    # Powers of two, so that a view that grows a little leaves the finer boxes as they are.
    reach = 2.0 ** np.floor(np.log2(whole.texel * map_size))
    fits = [whole]
    pixel = 2.0 * np.tan(view.camera.field_of_view / 2.0) / view.height  # its size at a distance of 1
    while len(fits) < most and reach * SHARE > nearest:  # else there is nothing to see a shadow on
        reach *= SHARE
        if fits[-1].texel <= max(reach * SHARE, nearest) * pixel:
            continue  # as fine as what is seen there already
        finer = _fit_around(view, direction, whole, float(reach))
        if finer.texel * FINER <= fits[-1].texel:
            fits.append(finer)
    return tuple(reversed(fits))


def fit_shadow(world: RenderWorld, view: View, direction: NDArray[np.float64], *, map_size: int) -> ShadowFit | None:
    """The box that covers the world's casters, as far as they can darken what is seen of light that goes along `direction`.

    The map has `map_size` texels an edge.
    A floor below all others is drawn into the map but does not widen it: its shadow falls on nothing. None if nothing is left.
    """
    crowd = world.crowd
    if not len(crowd.caster_rows):
        return None
    light_from_world = _light_from_world(tuple(direction.tolist()))
    lower, upper, nearest, farthest = caster_bounds(crowd, light_from_world)
    seen = (frustum_corners(view.clip_from_relative) + view.eye) @ light_from_world.T
    lower, upper = np.maximum(lower, seen[:, :2].min(axis=0)), np.minimum(upper, seen[:, :2].max(axis=0))
    if not (upper > lower).all():
        return None
    # Light travels along -z. Neither end depends on the camera, so that a still scene keeps its map while somebody looks around.
    edge = float((upper - lower).max())
    ends = (nearest, farthest - REACH_BEHIND)
    return _fit(view, direction, (lower + upper) / 2, edge, map_size=map_size, ends=ends)


def reached(crowd: Crowd, fit: ShadowFit, view: View, groups: Rows) -> Rows:
    """Those of some groups of casters whose shadows may fall into what a box covers."""
    relative = crowd.centre[:, groups] - view.eye[:, None]
    clip = fit.map_from_relative[:2, :3] @ relative + fit.map_from_relative[:2, 3:]
    reach = crowd.radius[groups] * 2.0 / (fit.texel * fit.map_size)
    return groups[np.abs(clip).max(axis=0) <= 1.0 + reach]


def _fit_around(view: View, direction: NDArray[np.float64], whole: ShadowFit, reach: float) -> ShadowFit:
    """A box around a ball around all that is seen up to `reach` [m] along the way the camera looks."""
    corners = frustum_corners(view.clip_from_relative)
    forward = -view.world_from_view[:, 2]
    near, far = corners[0::2], corners[1::2]
    depth = float((far @ forward).max())
    near_depth = float((near @ forward).max())
    slope = float(np.linalg.norm(far, axis=1).max()) / depth  # of the corners' rays, by depth
    reach = min(reach, depth)
    # The ball through the corners of both ends, or the one around the far end where that is wide.
    middle = min((near_depth + reach) / 2 * slope * slope, reach)
    radius = float(np.sqrt((reach - middle) ** 2 + (slope * slope - 1.0) * reach * reach))
    light_from_world = _light_from_world(tuple(direction.tolist()))
    centre = light_from_world[:2] @ (view.eye + forward * middle)
    nearest, farthest = whole.key[-2:]
    return _fit(view, direction, centre, 2.0 * radius, map_size=whole.map_size, ends=(nearest, farthest))


def _fit(
    view: View,
    direction: NDArray[np.float64],
    middle: NDArray[np.float64],
    edge: float,
    *,
    map_size: int,
    ends: tuple[float, float],
) -> ShadowFit:
    """A square of at least `edge` [m] around a place (2,) across the light, from one of the `ends` to the other along it [m]."""
    nearest, farthest = ends
    size = _rounded_up(edge * map_size / (map_size - 2 * BORDER - 2))
    texel = size / map_size
    # Whole texels of the world: edges do not crawl while the camera moves.
    middle = np.floor(middle / texel) * texel
    depth = max(nearest - farthest, 1e-3)
    map_from_light = np.eye(4)
    map_from_light[0, 0] = map_from_light[1, 1] = 2.0 / size
    map_from_light[:2, 3] = -middle * 2.0 / size
    map_from_light[2, 2] = -2.0 / depth
    map_from_light[2, 3] = (nearest + farthest) / depth
    light_from_relative = np.eye(4)
    light_from_relative[:3, :3] = _light_from_world(tuple(direction.tolist()))
    light_from_relative[:3, 3] = light_from_relative[:3, :3] @ view.eye
    key = (*direction.tolist(), *middle.tolist(), size, nearest, farthest)
    return ShadowFit(map_from_relative=map_from_light @ light_from_relative, texel=texel, map_size=map_size, key=key)


@lru_cache(maxsize=8)
def _light_from_world(direction: tuple[float, ...]) -> NDArray[np.float64]:
    """The rotation (3, 3) after which light that goes along `direction` goes along -z."""
    return quaternion.to_matrix(look_rotation(direction)).T.astype(np.float64)


def _nearest(crowd: Crowd, eye: NDArray[np.float64]) -> float:
    """How near anything solid may be to the eye [m]. A floor's sphere reaches far above it: boxes tell, where it matters."""
    distance = np.linalg.norm(crowd.centre - eye[:, None], axis=0)
    # Somebody's middle is no farther than the far end of its group; where that is the group, no farther than its middle.
    is_alone = crowd.size == 1
    close = np.flatnonzero(distance - crowd.radius <= np.where(is_alone, distance, distance + crowd.radius).min())
    rows = crowd.listed(close).astype(np.intp)
    lower, upper = crowd.boxes(rows)
    outside = np.maximum(np.maximum(lower - eye, eye - upper), 0.0)
    apart = np.linalg.norm(outside, axis=1) - np.where(crowd.is_slack(rows), crowd.slack, 0.0)
    return max(float(apart.min()), 0.0)


def _rounded_up(size: float) -> float:
    return float(2.0 ** (np.ceil(np.log2(max(size, 1e-3)) * SIZE_STEPS) / SIZE_STEPS))
