"""The uniform block `Frame` of `shaders/frame.glsl`, byte for byte.

Units: a sun's intensity is its illuminance in lx, other lights' intensity is in cd, and a white surface reflects
illuminance / pi. At the exposure 1, which is the default, a sun of pi lx makes a white surface white on the screen: as glTF
viewers do, where lights have intensities around 3, not the 100 000 lx of daylight (see `PictureSettings.exposure_factor`).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.lamp_shadows import SIDE, LampShadows, shadow_squares
from elys.render_node.picture_plan import MAX_LAMPS, PicturePlan
from elys.render_node.render_world import PlacedLight
from elys.render_node.shadow_fit import MOST_CASCADES, atlas_shape

GRID_PERIOD: Final = 10.0  # [m] after which the grid's pattern repeats
NORMAL_OFFSET: Final = 1.4  # texels by which a shaded point is lifted off its surface before its shadow is looked up

_LAMP: Final = np.dtype(
    [("position_range", "<f4", 4), ("color_scale", "<f4", 4), ("direction_offset", "<f4", 4), ("shadow", "<f4", 4)]
)
FRAME_DTYPE: Final = np.dtype(
    [
        ("clip_from_relative", "<f4", (4, 4)),
        ("relative_from_clip", "<f4", (4, 4)),
        ("sun_direction", "<f4", 4),
        ("sun_illuminance", "<f4", 4),
        ("shadow_atlas", "<f4", 4),
        ("cascade_from_relative", "<f4", (MOST_CASCADES, 4, 4)),
        ("cascade_scale", "<f4", (MOST_CASCADES, 4)),
        ("irradiance", "<f4", (9, 4)),
        ("mirror_tiles", "<f4", (11, 4)),
        ("grid_origin", "<f4", 4),
        ("viewport", "<f4", 4),
        ("fog_color", "<f4", 4),
        ("fog_shape", "<f4", 4),
        ("lamps", _LAMP, MAX_LAMPS),
        ("lamp_maps", "<f4", (SIDE * SIDE, 4, 4)),
    ]
)
# From clip space of the shadow map, -1..1, to where its texels are, 0..1.
_MAP_FROM_CLIP: Final = np.array([(0.5, 0, 0, 0.5), (0, 0.5, 0, 0.5), (0, 0, 0.5, 0.5), (0, 0, 0, 1.0)])


def frame_block(plan: PicturePlan, harmonics: NDArray[np.float64], tiles: NDArray[np.float32]) -> NDArray[np.void]:
    """The block's content (1,) for a picture, with the light around as harmonics (9, 3) and its tiles (11, 4). Matrices are
    transposed: GL keeps columns together.
    """
    block = np.zeros(1, FRAME_DTYPE)
    frame = block[0]
    view = plan.view
    frame["clip_from_relative"] = view.clip_from_relative.T
    frame["relative_from_clip"] = np.linalg.inv(view.clip_from_relative).T
    if plan.sun is not None:
        light = plan.sun.light
        frame["sun_direction"][:3] = -plan.sun.direction
        frame["sun_illuminance"][:3] = np.multiply(light.color, light.intensity)
    if plan.cascades:
        _fill_cascades(frame, plan)
    picture = plan.picture
    thinned = math.exp(min(max(-picture.fog_falloff * float(view.eye[1]), -60.0), 60.0))
    frame["fog_color"] = (*picture.fog_color, picture.fog_density * thinned)
    frame["fog_shape"][0] = picture.fog_falloff
    frame["irradiance"][:, :3] = harmonics
    frame["mirror_tiles"] = tiles
    wrapped = view.eye % GRID_PERIOD
    frame["grid_origin"] = (wrapped[0], view.eye[1], wrapped[2], plan.picture.exposure_factor)
    frame["viewport"] = (view.width, view.height, len(plan.lamps), view.camera.far)
    for slot, placed in zip(frame["lamps"], plan.lamps, strict=False):
        _fill_lamp(slot, placed, view.eye)
    frame["lamps"]["shadow"][:, 0] = -1.0
    if plan.lamp_shadows is not None:
        _fill_lamp_shadows(frame, plan, plan.lamp_shadows)
    return block


def _fill_cascades(frame: np.void, plan: PicturePlan) -> None:
    columns, rows = atlas_shape(len(plan.cascades))
    frame["shadow_atlas"][:2] = 1.0 / columns, 1.0 / rows
    for place, fit in enumerate(plan.cascades):
        frame["cascade_from_relative"][place] = (_MAP_FROM_CLIP @ fit.map_from_relative).T
        corner = (place % columns / columns, place // columns / rows)
        frame["cascade_scale"][place] = (fit.texel * NORMAL_OFFSET, 1.0 / fit.map_size, *corner)


def _fill_lamp_shadows(frame: np.void, plan: PicturePlan, shadows: LampShadows) -> None:
    for slot, placed, first, texel in zip(frame["lamps"], plan.lamps, shadows.first, shadows.texel, strict=False):
        slot["shadow"] = (first, shadow_squares(placed) > 1, texel * NORMAL_OFFSET, 1.0 / shadows.size)
    for square in range(len(shadows.place)):
        x, y, edge, _ = shadows.region(square)
        atlas_from_map = np.diag((edge / shadows.size, edge / shadows.size, 1.0, 1.0))
        atlas_from_map[:2, 3] = x / shadows.size, y / shadows.size
        lamp_map = atlas_from_map @ _MAP_FROM_CLIP @ shadows.clip_from_relative(square, plan.view.eye)
        frame["lamp_maps"][square] = lamp_map.T


def _fill_lamp(slot: np.void, placed: PlacedLight, eye: NDArray[np.float64]) -> None:
    light = placed.light
    scale, offset = 0.0, 1.0
    if light.kind == "spot":  # KHR_lights_punctual, "Inner and Outer Cone Angles"
        outer = math.cos(light.outer_cone_angle)
        scale = 1.0 / max(0.001, math.cos(light.inner_cone_angle) - outer)
        offset = -outer * scale
    slot["position_range"] = (*(placed.position - eye), light.range)
    slot["color_scale"] = (*np.multiply(light.color, light.intensity), scale)
    slot["direction_offset"] = (*placed.direction, offset)
