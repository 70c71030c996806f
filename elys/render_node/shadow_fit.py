"""Which part of the world one shadow map should cover, and the matrix that takes it there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View, frustum_corners
from elys.render_node.render_world import without_giants

MAP_SIZE: Final = 2048  # [texels]
BORDER: Final = 4  # texels around what is covered: the filter looks over the edge
SIZE_STEPS: Final = 8  # sizes per doubling: small changes of the view leave the texels where they are


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowFit:
    """A box along the sun's direction."""

    map_from_relative: NDArray[np.float64]  # (4, 4) to clip space of the map
    texel: float  # [m]
    key: tuple[float, ...]  # equal keys cover the same part of the world in the same way


def fit_shadow(
    view: View, direction: NDArray[np.float64], centre: NDArray[np.float64], radius: NDArray[np.float32]
) -> ShadowFit | None:
    """The box that covers the casters at `centre` (N, 3) world [m] of `radius` (N,), as far as they can darken what is seen.

    Casters that dwarf all others, as a ground does, are drawn into the map but do not widen it. None if nothing is left.
    """
    if not len(centre):
        return None
    light_from_world = quaternion.to_matrix(look_rotation(direction)).T
    reach = radius.astype(np.float64)
    in_light = centre @ light_from_world.T
    kept = without_giants(centre, reach)
    lower = (in_light[kept, :2] - reach[kept, None]).min(axis=0)
    upper = (in_light[kept, :2] + reach[kept, None]).max(axis=0)
    seen = (frustum_corners(view.clip_from_relative) + view.eye) @ light_from_world.T
    lower, upper = np.maximum(lower, seen[:, :2].min(axis=0)), np.minimum(upper, seen[:, :2].max(axis=0))
    if not (upper > lower).all():
        return None
    size = _rounded_up(float((upper - lower).max()) * MAP_SIZE / (MAP_SIZE - 2 * BORDER - 2))
    texel = size / MAP_SIZE
    # Whole texels of the world: edges do not crawl while the camera moves.
    middle = np.floor((lower + upper) / 2 / texel) * texel
    # Light travels along -z. Nothing nearer to the sun than the nearest caster matters, nor anything behind the last thing seen.
    nearest = float((in_light[:, 2] + reach).max())
    farthest = min(float((in_light[:, 2] - reach).min()), float(seen[:, 2].min()))
    farthest = max(farthest, float((in_light[kept, 2] - reach[kept]).min()) - 4.0 * size)
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
    return ShadowFit(map_from_relative=map_from_light @ light_from_relative, texel=texel, key=key)


def _rounded_up(size: float) -> float:
    return float(2.0 ** (np.ceil(np.log2(max(size, 1e-3)) * SIZE_STEPS) / SIZE_STEPS))
