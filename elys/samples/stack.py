"""Towers of cubes, which a solver must hold upright: nothing may slide, lean or sink."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from elys.common.scene import SceneDocument
from elys.samples.entities import PALETTE, Vector, body, camera, group, obstacle, sun

EDGE: Final = 1.0  # [m]
HEIGHT: Final = 10  # cubes in a tower
_TOLERANCE: Final = 0.05  # [m] by which a cube may stand off its place after seconds


def stack(height: int = HEIGHT) -> SceneDocument:
    """A tower of `height` cubes of 1 m, each exactly on the one below."""
    if height < 1:
        raise ValueError(f"a stack has at least one cube, not {height}")
    cubes = [
        body(
            f"Cube {level + 1}",
            "box",
            size=(EDGE,) * 3,
            position=(0.0, (level + 0.5) * EDGE, 0.0),
            color=PALETTE[level % len(PALETTE)],
        )
        for level in range(height)
    ]
    far = 1.1 * height + 4.0
    ground = obstacle("Ground", size=(40.0, 1.0, 40.0), position=(0.0, -0.5, 0.0))
    view = camera((0.7 * far, 0.6 * height + 1.0, far), (0.0, 0.45 * height, 0.0))
    return SceneDocument(name=f"Stack of {height}", entities=[sun(), view, ground, group("Stack", cubes)])


def check_stack(positions: Mapping[str, Vector]) -> str:
    """What is wrong with the tower's final positions [m], by entity name; "" if it stands as it was built."""
    for name, position in positions.items():
        if not name.startswith("Cube "):
            continue
        expected = (0.0, (int(name.removeprefix("Cube ")) - 0.5) * EDGE, 0.0)
        error = float(np.linalg.norm(np.subtract(position, expected)))
        if not error <= _TOLERANCE:
            return f"{name} is {error:.3f} m off its place"
    return ""
