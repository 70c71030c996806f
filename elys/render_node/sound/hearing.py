"""How loud a place is heard on either side: closed forms, without sound."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from elys.bus.messages.views import ViewCamera
from elys.common.components import Vec3
from elys.common.math import poses

NEAR: Final = 0.5  # [m] within which a sound comes from both sides, the more so the nearer it is
FADE: Final = 0.2  # of the largest distance, over which a sound falls silent before it


class Ears(NamedTuple):
    """Where one hears: the camera's place and the direction of its right side."""

    position: Vec3
    right: Vec3


def ears_of(camera: ViewCamera) -> Ears:
    """Those of who looks through a camera."""
    right = poses.rotate(camera.rotation, (1.0, 0.0, 0.0))
    length = math.sqrt(sum(part * part for part in right)) or 1.0
    return Ears(camera.position, (right[0] / length, right[1] / length, right[2] / length))


def distance_gain(distance: float, reference: float, largest: float = 0.0) -> float:
    """1 up to `reference` [m], then by the inverse of the distance; nothing from `largest` [m] on, if that is above 0."""
    gain = reference / max(distance, reference)
    if largest > 0.0:
        gain *= min(max((largest - distance) / (FADE * largest), 0.0), 1.0)
    return gain


def panned(side: float) -> tuple[float, float]:
    """Left and right of a sound from the left (-1), the middle (0) or the right (1): of equal power everywhere."""
    angle = (min(max(side, -1.0), 1.0) + 1.0) * math.pi / 4.0
    return math.cos(angle), math.sin(angle)


def heard(ears: Ears, place: Vec3, volume: float, reference: float, largest: float = 0.0) -> tuple[float, float]:
    """Left and right gain of a sound of a volume at a place."""
    way = tuple(there - here for there, here in zip(place, ears.position, strict=True))
    distance = math.sqrt(sum(part * part for part in way))
    if not math.isfinite(distance):
        return 0.0, 0.0
    side = 0.0
    if distance > 0.0:
        side = sum(a * b for a, b in zip(way, ears.right, strict=True)) / distance * min(distance / NEAR, 1.0)
    gain = volume * distance_gain(distance, reference, largest)
    left, right = panned(side)
    return gain * left, gain * right
