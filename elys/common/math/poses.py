"""Poses of single things in plain floats: numpy costs more than the arithmetic where there is one of a thing.

Formulas: quaternion rotation v + 2 w (u x v) + 2 u x (u x v), Hamilton's product.
"""

from __future__ import annotations

from elys.common.components import Quat, Vec3


def rotate(rotation: Quat, vector: Vec3) -> Vec3:
    """`vector` turned by `rotation`."""
    x, y, z, w = rotation
    vx, vy, vz = vector
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


def multiply(left: Quat, right: Quat) -> Quat:
    """The rotation `right` followed by `left`."""
    ax, ay, az, aw = left
    bx, by, bz, bw = right
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def stretch(scale: Vec3, vector: Vec3) -> Vec3:
    """Element by element."""
    return scale[0] * vector[0], scale[1] * vector[1], scale[2] * vector[2]


def compose(
    parent_position: Vec3, parent_rotation: Quat, parent_scale: Vec3, position: Vec3, rotation: Quat
) -> tuple[Vec3, Quat]:
    """World position and rotation of what stands at `position`, `rotation` in a parent's space."""
    turned = rotate(parent_rotation, stretch(parent_scale, position))
    world = (parent_position[0] + turned[0], parent_position[1] + turned[1], parent_position[2] + turned[2])
    return world, multiply(parent_rotation, rotation)


def local_pose(
    parent_position: Vec3, parent_rotation: Quat, parent_scale: Vec3, position: Vec3, rotation: Quat
) -> tuple[Vec3, Quat]:
    """The inverse of `compose`; along an axis on which the parent is squeezed flat the place is 0."""
    x, y, z, w = parent_rotation
    back = (-x, -y, -z, w)
    offset = (
        position[0] - parent_position[0],
        position[1] - parent_position[1],
        position[2] - parent_position[2],
    )
    turned = rotate(back, offset)
    local = (
        turned[0] / parent_scale[0] if parent_scale[0] else 0.0,
        turned[1] / parent_scale[1] if parent_scale[1] else 0.0,
        turned[2] / parent_scale[2] if parent_scale[2] else 0.0,
    )
    return local, multiply(back, rotation)
