"""What is remembered of a pair: its normal, its points, and the impulses that held it in the last step.

A manifold is kept as it is while its bodies have hardly moved against each other. Meanwhile normal and anchors stay fixed
in WORLD axes and only the gaps follow the motion. That is cheaper, and it is steadier: anchors that turn with the bodies
let tall stacks buckle.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.rotation import multiplied
from elys.sim_node.physics.kernels.tables import POINTS


@inner
def turned_since(made, q):
    """The small rotation vector from a remembered orientation to the present one."""
    x, y, z, w = multiplied(q[0], q[1], q[2], q[3], -made[0], -made[1], -made[2], made[3])
    twice = 2.0 if w >= 0.0 else -2.0
    return twice * x, twice * y, twice * z


@inner
def can_recycle(first, second, manifold, margin, constants):
    """Whether the manifold still describes how two bodies meet."""
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
        moved += way * way
    if moved > distance * distance:
        return False
    x, y, z = turned_since(manifold.made_rotation_a, first.rotation)
    if x * x + y * y + z * z > angle * angle:
        return False
    x, y, z = turned_since(manifold.made_rotation_b, second.rotation)
    return x * x + y * y + z * z <= angle * angle


@inner
def inherit_impulses(manifold, points, first, found, count):
    """Gives every new point the impulse of the old point with the same feature."""
    for k in range(count):
        found.impulse[k] = 0.0
        for old in range(first, first + manifold.point_count):
            if points[old].feature == found.feature[k]:
                found.impulse[k] = points[old].normal_impulse
    for k in range(POINTS):
        points[first + k].normal_impulse = found.impulse[k] if k < count else 0.0
    if count == 0:
        manifold.twist_impulse = 0.0
        for k in range(3):
            manifold.friction_impulse[k] = 0.0


@inner
def write_manifold(first_body, second_body, manifold, points, first, found, count, margin, flipped):
    """Stores what the narrow phase found for two bodies; `flipped` when it was asked with them exchanged."""
    inherit_impulses(manifold, points, first, found, count)
    manifold.point_count = count
    manifold.margin = margin
    sign = -1.0 if flipped else 1.0
    pa = first_body.position
    pb = second_body.position
    normal = manifold.normal
    for d in range(3):
        normal[d] = sign * found.normal[d]
        manifold.made_offset[d] = pb[d] - pa[d]
    for d in range(4):
        manifold.made_rotation_a[d] = first_body.rotation[d]
        manifold.made_rotation_b[d] = second_body.rotation[d]
    for k in range(count):
        point = points[first + k]
        half = 0.5 * found.separation[k]
        point.made_separation = found.separation[k]
        point.feature = found.feature[k]
        for d in range(3):
            middle = found.point[3 * k + d]
            point.anchor_a[d] = middle - half * normal[d] - pa[d]
            point.anchor_b[d] = middle + half * normal[d] - pb[d]
