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
from elys.render_node.picture_lights import MOST_FURTHER_SUNS, MOST_LAMPS
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.render_world import PlacedLight
from elys.render_node.shadow_fit import MOST_CASCADES, atlas_shape

GRID_PERIOD: Final = 10.0  # [m] after which the grid's pattern repeats
NORMAL_OFFSET: Final = 1.4  # texels by which a shaded point is lifted off its surface before its shadow is looked up

_LAMP: Final = np.dtype(
    [("position_range", "<f4", 4), ("color_scale", "<f4", 4), ("direction_offset", "<f4", 4), ("shadow", "<f4", 4)]
)
_SUN: Final = np.dtype([("direction", "<f4", 4), ("illuminance", "<f4", 4)])
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
        ("map_from_world", "<f4", (3, 4)),
        ("map_light_scale", "<f4", 4),
        ("mirror_tiles", "<f4", (11, 4)),
        ("grid_origin", "<f4", 4),
        ("viewport", "<f4", 4),
        ("fog_color", "<f4", 4),
        ("fog_shape", "<f4", 4),
        ("lamps", _LAMP, MOST_LAMPS),
        ("lamp_maps", "<f4", (SIDE * SIDE, 4, 4)),
        ("further_suns", _SUN, MOST_FURTHER_SUNS),
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
        frame["sun_direction"][:3] = -plan.sun.direction
        frame["sun_illuminance"][:3] = _strength(plan.sun)
    if plan.further_suns:
        _fill_further_suns(frame, plan.further_suns)
    if plan.cascades:
        _fill_cascades(frame, plan)
    picture = plan.picture
    thinned = math.exp(min(max(-picture.fog_falloff * float(view.eye[1]), -60.0), 60.0))
    frame["fog_color"] = (*picture.fog_color, picture.fog_density * thinned)
    frame["fog_shape"][0] = picture.fog_falloff
    frame["irradiance"][:, :3] = harmonics
    frame["map_from_world"][:, :3] = plan.surroundings.map_from_world.T
    frame["map_light_scale"][:3] = plan.surroundings.light
    frame["mirror_tiles"] = tiles
    wrapped = view.eye % GRID_PERIOD
    frame["grid_origin"] = (wrapped[0], view.eye[1], wrapped[2], plan.picture.exposure_factor)
    frame["viewport"] = (view.width, view.height, len(plan.lamps), view.camera.far)
    if plan.lamps:
        _fill_lamps(frame["lamps"][: len(plan.lamps)], plan.lamps, view.eye)
    if plan.lamp_shadows is not None:
        _fill_lamp_shadows(frame, plan, plan.lamp_shadows)
    return block


def _fill_further_suns(frame: np.void, suns: list[PlacedLight]) -> None:
    frame["sun_direction"][3] = len(suns)
    slots = frame["further_suns"][: len(suns)]
    slots["direction"][:, :3] = [-placed.direction for placed in suns]
    slots["illuminance"][:, :3] = [_strength(placed) for placed in suns]


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


def _fill_lamps(slots: NDArray[np.void], lamps: list[PlacedLight], eye: NDArray[np.float64]) -> None:
    cones = [_cone(placed) for placed in lamps]
    slots["position_range"][:, :3] = np.array([placed.position for placed in lamps]) - eye
    slots["position_range"][:, 3] = [placed.light.range for placed in lamps]
    slots["color_scale"] = [(*_strength(placed), scale) for placed, (scale, _) in zip(lamps, cones, strict=True)]
    slots["direction_offset"][:, :3] = [placed.direction for placed in lamps]
    slots["direction_offset"][:, 3] = [offset for _, offset in cones]
    slots["shadow"][:, 0] = -1.0


def _strength(placed: PlacedLight) -> tuple[float, float, float]:
    """Illuminance [lx] or intensity [cd] of each primary."""
    red, green, blue = placed.light.color
    return red * placed.light.intensity, green * placed.light.intensity, blue * placed.light.intensity


def _cone(placed: PlacedLight) -> tuple[float, float]:
    """Scale and offset of KHR_lights_punctual, "Inner and Outer Cone Angles"."""
    light = placed.light
    if light.kind != "spot":
        return 0.0, 1.0
    outer = math.cos(light.outer_cone_angle)
    scale = 1.0 / max(0.001, math.cos(light.inner_cone_angle) - outer)
    return scale, -outer * scale
