"""Angles without the C library, whose last bits differ between machines."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner


@inner
def arc_tangent(y, x):
    """The angle of the point (x, y) from -pi to pi [rad], 0 for the origin; as `math.atan2` to 9e-16.

    The smaller of the two over the larger is a tangent of at most 1. Halving the angle twice, by
    tan(t / 2) = tan t / (1 + sqrt(1 + tan^2 t)), leaves at most 0.199, where the series of twelve terms is exact to the
    last bit.
    """
    ax = abs(x)
    ay = abs(y)
    large = max(ax, ay)
    if large == 0.0:
        return 0.0
    t = min(ax, ay) / large
    t = t / (1.0 + math.sqrt(1.0 + t * t))
    t = t / (1.0 + math.sqrt(1.0 + t * t))
    s = t * t
    total = 1.0 / 23.0
    for k in range(10, -1, -1):
        total = 1.0 / (2.0 * k + 1.0) - s * total
    angle = 4.0 * t * total
    if ay > ax:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return angle if y >= 0.0 else -angle
