"""Which part of an atlas of depths each bulb and spot gets, and the matrices that take the world there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation, perspective
from elys.render_node.camera import frustum_planes
from elys.render_node.crowd import Crowd
from elys.render_node.picture_lights import FEW_LAMPS, by_light_at
from elys.render_node.render_world import PlacedLight
from elys.render_node.scene_tables import Rows

SIDE: Final = 4  # squares along an edge of the atlas
BORDER: Final = 4  # texels of a square around what is covered: the filter looks over the edge
FACES: Final = (
    (1, 0, 0),
    (-1, 0, 0),
    (0, 1, 0),
    (0, -1, 0),
    (0, 0, 1),
    (0, 0, -1),
)  # of a bulb, as lamp_shadow.glsl picks them
WIDEST: Final = (
    1.05  # [rad] half the opening of a spot that gets by with one square: wider ones would have coarse edges
)
NEAR_SHARE: Final = 1e-3  # of how far a lamp's shadows reach


@dataclass(frozen=True, slots=True, kw_only=True)
class LampShadows:
    """The squares in use: T of SIDE * SIDE.

    Attributes:
        first: the first square of each lamp of the picture, -1 for none. texel: [m] at a distance of 1 m, of each lamp.
        clip_from_lamp: [T, 4, 4], from space with the world's axes and its origin in the lamp. place: [T, 3] of the lamp [m].
        casters: groups of instances that can throw shadows into each square.
    """

    first: tuple[int, ...]
    texel: tuple[float, ...]
    clip_from_lamp: NDArray[np.float64]
    place: NDArray[np.float64]
    casters: tuple[Rows, ...]
    size: int  # [texels] of an edge of the atlas
    key: tuple[float, ...]  # equal keys cover the same parts of the world in the same way

    def clip_from_relative(self, square: int, eye: NDArray[np.float64]) -> NDArray[np.float64]:
        """From relative space to the clip space of a square (4, 4)."""
        lamp_from_relative = np.eye(4)
        lamp_from_relative[:3, 3] = eye - self.place[square]
        return np.asarray(self.clip_from_lamp[square] @ lamp_from_relative)

    def region(self, square: int) -> tuple[int, int, int, int]:
        """x, y, width and height of a square in the atlas [texels]."""
        edge = self.size // SIDE
        return square % SIDE * edge, square // SIDE * edge, edge, edge


def fit_lamp_shadows(
    crowd: Crowd, lamps: list[PlacedLight], casters: Rows, size: int, eye: NDArray[np.float64]
) -> LampShadows | None:
    """Squares for as many of the lamps as there is room for; None if no lamp throws a shadow of anything."""
    edge = size // SIDE
    widened = edge / (edge - 2 * BORDER)
    first: list[int] = []
    texel: list[float] = []
    clips: list[NDArray[np.float64]] = []
    places: list[NDArray[np.float64]] = []
    rows: list[Rows] = []
    key: list[float] = []
    served = _served(lamps, eye)
    for number, placed in enumerate(lamps):
        directions = _directions(placed)
        first.append(-1)
        texel.append(0.0)
        if number not in served or not len(casters):
            continue
        offset = crowd.centre.T[casters] - placed.position
        reach = float((np.linalg.norm(offset, axis=1) + crowd.radius[casters]).max())
        reach = min(reach, placed.light.range) if placed.light.range > 0.0 else reach
        tangent = _tangent(placed) * widened
        clip_from_view = perspective(
            2.0 * math.atan(tangent), 1.0, max(reach * NEAR_SHARE, 1e-3), max(reach, 2e-3) * 1.01
        )
        first[-1], texel[-1] = len(clips), 2.0 * tangent / edge
        for direction in directions:
            view_from_lamp = np.eye(4)
            view_from_lamp[:3, :3] = quaternion.to_matrix(look_rotation(direction)).T
            clip = clip_from_view @ view_from_lamp
            planes = frustum_planes(clip)
            near_enough = offset @ planes[:, :3].T + planes[:, 3] > -crowd.radius[casters][:, None]
            clips.append(clip)
            places.append(placed.position)
            rows.append(casters[near_enough.all(axis=1)])
        key += [*placed.position.tolist(), *placed.direction.tolist(), tangent, reach]
    if not clips or not any(len(found) for found in rows):
        return None
    return LampShadows(
        first=tuple(first),
        texel=tuple(texel),
        clip_from_lamp=np.array(clips),
        place=np.array(places),
        casters=tuple(rows),
        size=size,
        key=(*first, *key),
    )


def shadow_squares(placed: PlacedLight) -> int:
    """How many squares a lamp's shadows take."""
    return len(_directions(placed))


def _served(lamps: list[PlacedLight], eye: NDArray[np.float64]) -> set[int]:
    """The numbers of the lamps that get squares. The squares themselves go by the order of the lamps, so that the atlas holds
    while the same are served.
    """
    served, left = set(), SIDE * SIDE
    # Where there are many, shadows near the eye matter more than that they stay the same.
    for number in range(len(lamps)) if len(lamps) <= FEW_LAMPS else by_light_at(lamps, eye).tolist():
        squares = shadow_squares(lamps[number])
        if 0 < squares <= left:
            served.add(number)
            left -= squares
    return served


def _directions(placed: PlacedLight) -> list[NDArray[np.float64]]:
    """What a lamp's squares look along; none for one that throws no shadows."""
    if not placed.light.cast_shadows:
        return []
    if placed.light.kind == "spot" and placed.light.outer_cone_angle <= WIDEST:
        return [placed.direction]
    return [np.array(face, np.float64) for face in FACES]


def _tangent(placed: PlacedLight) -> float:
    """Of half the opening of a lamp's squares."""
    is_narrow = placed.light.kind == "spot" and placed.light.outer_cone_angle <= WIDEST
    return math.tan(max(placed.light.outer_cone_angle, 0.01)) if is_narrow else 1.0
