"""Cubes that fall into a bin, as many as a benchmark wants."""

from __future__ import annotations

import math
from typing import Final

from elys.common.scene import EntityNode, SceneDocument, SceneSettings
from elys.samples.entities import PALETTE, body, camera, group, obstacle, sun

_EDGE: Final = 0.5  # [m]
_SPACING: Final = 0.6  # [m]
_WALL_HEIGHT: Final = 2.0  # [m]


def pile(body_count: int = 1000) -> SceneDocument:
    """`body_count` cubes of 0.5 m above a bin whose floor is so wide that they lie about five deep."""
    if body_count < 1:
        raise ValueError(f"a pile has at least one body, not {body_count}")
    columns = max(math.ceil(math.sqrt(body_count / 5.0)), 2)
    half = columns * _SPACING / 2.0 + 0.2
    cubes = []
    for number in range(body_count):
        layer, place = divmod(number, columns * columns)
        row, column = divmod(place, columns)
        # Every other layer is moved a little: cubes exactly on cubes would stand as towers.
        shift = 0.12 if layer % 2 else -0.05
        position = (
            (column - (columns - 1) / 2.0) * _SPACING + shift,
            _EDGE + layer * _SPACING,
            (row - (columns - 1) / 2.0) * _SPACING - shift,
        )
        color = PALETTE[(layer + 3 * row + 5 * column) % len(PALETTE)]
        cubes.append(body(f"Cube {number + 1}", "box", size=(_EDGE,) * 3, position=position, color=color))
    return SceneDocument(
        name=f"Pile of {body_count}",
        settings=SceneSettings(),
        entities=[sun(), _view(half), group("Bin", _bin(half)), group("Cubes", cubes)],
    )


def _view(half: float) -> EntityNode:
    return camera((1.6 * half, 1.8 * half + 2.0, 2.6 * half + 2.0), (0.0, 0.5, 0.0))


def _bin(half: float) -> list[EntityNode]:
    thick = 0.5
    middle = half + thick / 2.0
    along_x, along_z = (2.0 * (half + thick), _WALL_HEIGHT, thick), (thick, _WALL_HEIGHT, 2.0 * half)
    height = _WALL_HEIGHT / 2.0
    return [
        obstacle("Floor", size=(2.0 * half + 20.0, 1.0, 2.0 * half + 20.0), position=(0.0, -0.5, 0.0)),
        obstacle("North", size=along_x, position=(0.0, height, -middle)),
        obstacle("South", size=along_x, position=(0.0, height, middle)),
        obstacle("West", size=along_z, position=(-middle, height, 0.0)),
        obstacle("East", size=along_z, position=(middle, height, 0.0)),
    ]
