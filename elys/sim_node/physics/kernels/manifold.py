"""What is remembered of a pair: its normal, its points, and the impulses that held it in the last step.

A manifold is kept as it is while its bodies have hardly moved against each other. Meanwhile normal and anchors stay fixed
in WORLD axes and only the gaps follow the motion. That is cheaper, and it is steadier: anchors that turn with the bodies
let tall stacks buckle.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.rotation import multiplied
from elys.sim_node.physics.kernels.tables import AVERAGE, GEOMETRIC_MEAN, MAXIMUM, MINIMUM, POINTS


@inner
def turned_since(made, q):
    """The small rotation vector from a remembered orientation to the present one."""
    x, y, z, w = multiplied(q[0], q[1], q[2], q[3], -made[0], -made[1], -made[2], made[3])
    twice = 2.0 if w >= 0.0 else -2.0
    return twice * x, twice * y, twice * z


@inner
def follow_motion(first, second, manifold, margin, constants):
    """Writes how two bodies have moved since their manifold was made; whether it still describes how they meet."""
    if manifold.margin < 0.0 or margin > manifold.margin + 0.25 * constants.margin:
        return False
    distance = constants.recycle_distance
    angle = constants.recycle_angle
    if manifold.point_count == 0:  # nothing may come closer than the margin unseen
        distance = min(distance, 0.25 * constants.margin)
        angle = min(angle, 0.25 * constants.margin)
    moved = 0.0
    for k in range(3):
        way = second.position[k] - first.position[k] - manifold.made_offset[k]
        manifold.shift[k] = way
        moved += way * way
    if moved > distance * distance:
        return False
    x, y, z = turned_since(manifold.made_rotation_a, first.rotation)
    if x * x + y * y + z * z > angle * angle:
        return False
    manifold.turn_a[0], manifold.turn_a[1], manifold.turn_a[2] = x, y, z
    x, y, z = turned_since(manifold.made_rotation_b, second.rotation)
    manifold.turn_b[0], manifold.turn_b[1], manifold.turn_b[2] = x, y, z
    return x * x + y * y + z * z <= angle * angle


@inner
def forget_contact(manifold):
    """Two bodies do not touch any more."""
    manifold.point_count = 0
    manifold.live_points = 0
    manifold.load = 0.0
    manifold.twist_impulse = 0.0
    for k in range(3):
        manifold.friction_impulse[k] = 0.0
        manifold.rolling_impulse[k] = 0.0


@inner
def inherit_impulses(manifold, found, count):
    """Gives every new point the impulses of the old point with the same feature."""
    for point in range(count):
        k = point & (POINTS - 1)
        found.impulse[k] = 0.0
        found.step_impulse[k] = 0.0
        for old in range(manifold.point_count):
            if manifold.feature[old] == found.feature[k]:
                found.impulse[k] = manifold.normal_impulse[old]
                found.step_impulse[k] = manifold.step_impulse[old]
    for k in range(POINTS):
        manifold.normal_impulse[k] = found.impulse[k] if k < count else 0.0
        manifold.step_impulse[k] = found.step_impulse[k] if k < count else 0.0
    if count == 0:
        forget_contact(manifold)


@inner
def combined(rule, p, q):
    """The coefficient of a pair from those of its two colliders."""
    if rule == GEOMETRIC_MEAN:
        return math.sqrt(p * q)
    if rule == MINIMUM:
        return min(p, q)
    if rule == MAXIMUM:
        return max(p, q)
    return 0.5 * (p + q) if rule == AVERAGE else p * q


@inner
def write_manifold(first_body, second_body, a, b, manifold, found, count, margin, constants):
    """Stores what the narrow phase found for two bodies' colliders.

    How surfaces rub and bounce follows from both by the world's rules.
    """
    inherit_impulses(manifold, found, count)
    manifold.point_count = count
    manifold.live_points = count
    manifold.margin = margin
    pa = first_body.position
    pb = second_body.position
    for d in range(3):
        manifold.made_offset[d] = pb[d] - pa[d]
    for d in range(4):
        manifold.made_rotation_a[d] = first_body.rotation[d]
        manifold.made_rotation_b[d] = second_body.rotation[d]
    if count == 0:
        return
    manifold.friction = combined(constants.friction_rule, a.friction, b.friction)
    manifold.restitution = combined(constants.restitution_rule, a.restitution, b.restitution)
    manifold.rolling_friction = max(a.rolling_friction, b.rolling_friction)
    manifold.spin_friction = max(a.spin_friction, b.spin_friction)
    normal = manifold.normal
    for d in range(3):
        normal[d] = found.normal[d]
        manifold.shift[d] = 0.0
        manifold.turn_a[d] = 0.0
        manifold.turn_b[d] = 0.0
    for point in range(count):
        k = point & (POINTS - 1)  # the same number, and no index from the end
        half = 0.5 * found.separation[k]
        manifold.made_separation[k] = found.separation[k]
        manifold.feature[k] = found.feature[k]
        for d in range(3):
            middle = found.point[3 * k + d]
            manifold.anchors[6 * k + d] = middle - half * found.normal[d] - pa[d]
            manifold.anchors[6 * k + 3 + d] = middle + half * found.normal[d] - pb[d]
