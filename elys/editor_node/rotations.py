"""Rotations as a person edits them: Euler degrees about the fixed axes x, then y, then z, that do not jump.

A rotation has many Euler angles; of those the ones nearest to what was shown before are shown next, so that a turn past
90 degrees about y goes on to 91 instead of turning the other two by 180.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from elys.common.math import quaternion

Degrees = tuple[float, float, float]


def degrees_from(rotation: Sequence[float]) -> Degrees:
    """A quaternion x y z w as Euler degrees, without the dirt of rounding."""
    # + 0.0 turns -0.0 into 0.0.
    x, y, z = (round(math.degrees(a), 4) + 0.0 for a in quaternion.to_euler(np.array(rotation, np.float64)).tolist())
    return x, y, z


def rotation_from(degrees: Sequence[float]) -> tuple[float, float, float, float]:
    """The quaternion x y z w of Euler degrees."""
    x, y, z, w = quaternion.from_euler(np.radians(np.array(degrees, np.float64))).tolist()
    return x, y, z, w


def nearest_degrees(rotation: Sequence[float], before: Degrees) -> Degrees:
    """Those Euler degrees of a rotation that lie nearest to `before`; `before` itself where it is the same rotation."""
    if _is_same(rotation, rotation_from(before)):
        return before
    x, y, z = degrees_from(rotation)
    if abs(y) > 90.0 - 1e-3:  # x and z turn about the same line: z stays what it was
        z = before[2]
        x += z if y > 0.0 else -z
        candidates = [(x, y, z)]
    else:
        candidates = [(x, y, z), (x + 180.0, 180.0 - y, z + 180.0)]
    turned = [_beside(candidate, before) for candidate in candidates]
    return min(turned, key=lambda angles: sum(abs(a - b) for a, b in zip(angles, before, strict=True)))


def _beside(angles: Degrees, before: Degrees) -> Degrees:
    """The same angles with whole turns added, so that each is within half a turn of what it was."""
    x, y, z = (round(a - 360.0 * round((a - b) / 360.0), 4) + 0.0 for a, b in zip(angles, before, strict=True))
    return x, y, z


def _is_same(left: Sequence[float], right: Sequence[float]) -> bool:
    """Whether two quaternions turn alike, to what 32 bits and a shown digit can tell."""
    lengths = math.hypot(*left) * math.hypot(
        *right
    )  # 32 bits keep a unit only to 1e-7, which is more than the angle counts
    return 1.0 - abs(sum(a * b for a, b in zip(left, right, strict=True))) / lengths < 1e-11


class ShownAngles:
    """The Euler degrees that stand in the fields, by what they are shown for."""

    def __init__(self) -> None:
        self._angles: dict[object, Degrees] = {}

    def of(self, key: object, rotation: Sequence[float]) -> Degrees:
        """What to show for a rotation x y z w, near to what was shown for the same key before."""
        before = self._angles.get(key)
        shown = degrees_from(rotation) if before is None else nearest_degrees(rotation, before)
        self._angles[key] = shown
        return shown

    def keep(self, key: object, angles: Sequence[float]) -> None:
        """Remembers the angles that a person has just chosen."""
        x, y, z = angles
        self._angles[key] = (x, y, z)

    def forget(self) -> None:
        """Others are shown now."""
        self._angles.clear()
