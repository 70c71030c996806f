"""What sticks and triggers answer to how far they are pushed: dead zones, the curve, and clipping to a length of 1.

    0 ─ dead zone ┐
                  └── (push - dead) / (1 - dead) ── (1 - c) s + c s^3 ── 0 to 1

The zone of a stick is a disk, so that it turns in all directions alike; that of a trigger, or of a stick of which one axis alone
is used, an interval. What is beyond the zone begins at 0, and the end stays at 1. The curve is a polynomial, and of the roots the
square one is the only one: sums, products and it are rounded alike on every processor, powers of a library are not.
"""

from __future__ import annotations

import math
from typing import Final

MOST_DEAD_ZONE: Final = 0.95  # of the way


def shaped(push: float, *, dead_zone: float, curve: float) -> float:
    """What a push of 0 to 1 comes to, 0 to 1; `curve` from 0 (straight) to 1 (fine in the middle)."""
    if push <= dead_zone:
        return 0.0
    beyond = (min(push, 1.0) - dead_zone) / (1.0 - dead_zone)
    return (1.0 - curve) * beyond + curve * beyond * beyond * beyond


def axial(place: float, *, dead_zone: float, curve: float) -> float:
    """One axis, -1 to 1."""
    return math.copysign(shaped(abs(place), dead_zone=dead_zone, curve=curve), place)


def radial(x: float, y: float, *, dead_zone: float, curve: float) -> tuple[float, float]:
    """A stick: as far as its length says, in its direction."""
    length = math.sqrt(x * x + y * y)
    if length <= dead_zone or length == 0.0:
        return 0.0, 0.0
    factor = shaped(length, dead_zone=dead_zone, curve=curve) / length
    return x * factor, y * factor


def clipped(value: float) -> float:
    """Within -1 and 1."""
    return min(max(value, -1.0), 1.0)


def clipped_vector(x: float, y: float) -> tuple[float, float]:
    """At most 1 long, in the same direction."""
    square = x * x + y * y
    if square <= 1.0:
        return x, y
    length = math.sqrt(square)
    return x / length, y / length
