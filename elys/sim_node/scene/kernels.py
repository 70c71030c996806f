"""The array kernels of the scene graph: walking it, placing it in the world, reading poses off it.

All arrays are indexed by an entity's place in the tables; place 0 is the ground on which the roots stand: nobody's entity,
at the origin, enabled. Links are places, 0 for none. Local values stand in the Transform component's own columns.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.sim_node.compilation import inlined, kernel, signature_of

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x y z w
Matrix = tuple[float, float, float, float, float, float, float, float, float]  # row by row
Places = NDArray[np.int32]


class Links(NamedTuple):
    """The tree: [capacity] int32 each."""

    parent: NDArray[np.int32]
    first_child: NDArray[np.int32]
    next_sibling: NDArray[np.int32]


class LocalColumns(NamedTuple):
    """The Transform component: `row` [capacity] of the entity at a place, -1 for none; then its columns by row."""

    row: NDArray[np.int32]
    position: NDArray[np.float64]  # [rows, 3] m, relative to the parent
    rotation: NDArray[np.float32]  # [rows, 4] x y z w
    scale: NDArray[np.float32]  # [rows, 3]


class WorldPoses(NamedTuple):
    """Where N entities stand in the world."""

    position: NDArray[np.float64]  # [N, 3] m
    rotation: NDArray[np.float32]  # [N, 4] x y z w
    scale: NDArray[np.float32]  # [N, 3] stretch along its own axes


class TargetPoses(NamedTuple):
    """World poses that some entities shall have: `row` [capacity] into the others, -1 for none."""

    row: NDArray[np.int32]
    position: NDArray[np.float64]  # [targets, 3] m
    rotation: NDArray[np.float32]  # [targets, 4] x y z w


@kernel
def walk_tree(links: Links, enabled: NDArray[np.bool_], order: Places, enabled_in_hierarchy: NDArray[np.bool_]) -> int:
    """Fills `order` with all places, parents before children and siblings in order (depth first); returns how many.

    An entity is enabled in the hierarchy if it and all its ancestors are `enabled`.
    """
    count = 0
    node = links.first_child[0]
    while node != 0:
        order[count] = node
        count += 1
        enabled_in_hierarchy[node] = enabled[node] and enabled_in_hierarchy[links.parent[node]]
        if links.first_child[node] != 0:
            node = links.first_child[node]
            continue
        while node != 0 and links.next_sibling[node] == 0:
            node = links.parent[node]
        node = links.next_sibling[node]
    return count


@kernel
def place_tree(
    order: Places,
    parent: Places,
    local: LocalColumns,
    affine: NDArray[np.float64],
    is_dirty: NDArray[np.bool_],
    targets: TargetPoses,
) -> None:
    """One pass from the roots down: `affine` [capacity, 3, 4] world_from_local of all that is dirty or below something dirty.

    A place with a target pose first gets the local pose that puts it there under its parent, which may itself have moved;
    under a parent that is squeezed flat there is none, and the local pose stays. Dirty flags are left as a record of what moved.
    """
    # Arrays are taken out of their tuples once, and only numbers go to the functions below: handing on a tuple of arrays costs
    # reference counting at every node, more than the arithmetic.
    row_of, position, rotation, scale = local
    target_of, target_position, target_rotation = targets
    for index in range(len(order)):
        node = order[index]
        above = parent[node]
        target = target_of[node]
        if target < 0 and not (is_dirty[node] or is_dirty[above]):
            continue
        is_dirty[node] = True
        row = row_of[node]
        p, q, s = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
        if target >= 0:
            p = (target_position[target, 0], target_position[target, 1], target_position[target, 2])
            r = target_rotation[target]
            q = (np.float64(r[0]), np.float64(r[1]), np.float64(r[2]), np.float64(r[3]))
            if above != 0:  # a root is stored as it is, bit for bit
                f = affine[above]
                linear = (f[0, 0], f[0, 1], f[0, 2], f[1, 0], f[1, 1], f[1, 2], f[2, 0], f[2, 1], f[2, 2])
                p, q = _pose_under(linear, (f[0, 3], f[1, 3], f[2, 3]), p, q)
            if math.isfinite(p[0]) and math.isfinite(q[3]):
                position[row, 0], position[row, 1], position[row, 2] = p
                rotation[row, 0], rotation[row, 1], rotation[row, 2], rotation[row, 3] = q
        if row >= 0:
            p = (position[row, 0], position[row, 1], position[row, 2])
            r = rotation[row]
            q = (np.float64(r[0]), np.float64(r[1]), np.float64(r[2]), np.float64(r[3]))
            s = (np.float64(scale[row, 0]), np.float64(scale[row, 1]), np.float64(scale[row, 2]))
        m = _matrix_of(q)
        x_axis = (m[0] * s[0], m[3] * s[0], m[6] * s[0])
        y_axis = (m[1] * s[1], m[4] * s[1], m[7] * s[1])
        z_axis = (m[2] * s[2], m[5] * s[2], m[8] * s[2])
        for line in range(3):
            a, b, c = affine[above, line, 0], affine[above, line, 1], affine[above, line, 2]
            affine[node, line, 0] = a * x_axis[0] + b * x_axis[1] + c * x_axis[2]
            affine[node, line, 1] = a * y_axis[0] + b * y_axis[1] + c * y_axis[2]
            affine[node, line, 2] = a * z_axis[0] + b * z_axis[1] + c * z_axis[2]
            affine[node, line, 3] = a * p[0] + b * p[1] + c * p[2] + affine[above, line, 3]


@kernel
def read_poses(
    nodes: Places, parent: Places, local: LocalColumns, affine: NDArray[np.float64], poses: WorldPoses
) -> None:
    """World position, rotation and scale of [N] `nodes`, into `poses`.

    The rotation is that of the parent's matrix times the own rotation, whatever ancestors stretch or mirror (see _orientation);
    a root's is its own, bit for bit. Scale is the length of each axis; x is negative where ancestors mirror.
    """
    row_of, _, rotation, scale = local
    world_position, world_rotation, world_scale = poses
    for index in range(len(nodes)):
        node = nodes[index]
        row = row_of[node]
        q, s = (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
        if row >= 0:
            r = rotation[row]
            q = (np.float64(r[0]), np.float64(r[1]), np.float64(r[2]), np.float64(r[3]))
            s = (np.float64(scale[row, 0]), np.float64(scale[row, 1]), np.float64(scale[row, 2]))
        if parent[node] != 0:
            a = affine[parent[node]]
            linear = (a[0, 0], a[0, 1], a[0, 2], a[1, 0], a[1, 1], a[1, 2], a[2, 0], a[2, 1], a[2, 2])
            m = _matrix_product(linear, _matrix_of(q))
            s = _stretched(s, m)
            turned = _orientation(m)
            if math.isfinite(turned[3]):
                q = turned
        w = affine[node]
        world_position[index, 0], world_position[index, 1], world_position[index, 2] = w[0, 3], w[1, 3], w[2, 3]
        for element in range(4):
            world_rotation[index, element] = q[element]
        for axis in range(3):
            world_scale[index, axis] = s[axis]


# The arithmetic. Left to itself the compiler calls half of these functions, at a third more time.


@inlined
def _pose_under(linear: Matrix, origin: Vector, position: Vector, rotation: Quaternion) -> tuple[Vector, Quaternion]:
    """The pose relative to a parent that is `position` and `rotation` in the world; not finite if the parent is flat."""
    inverse = _inverse(linear)
    offset = (position[0] - origin[0], position[1] - origin[1], position[2] - origin[2])
    return _transformed(inverse, offset), _orientation(_matrix_product(inverse, _matrix_of(rotation)))


@inlined
def _stretched(s: Vector, m: Matrix) -> Vector:
    """Own scale `s` times what a matrix does to the length of each axis."""
    x = math.sqrt(m[0] * m[0] + m[3] * m[3] + m[6] * m[6])
    y = math.sqrt(m[1] * m[1] + m[4] * m[4] + m[7] * m[7])
    z = math.sqrt(m[2] * m[2] + m[5] * m[5] + m[8] * m[8])
    c = _cofactors(m)
    if m[0] * c[0] + m[1] * c[1] + m[2] * c[2] < 0.0:
        x = -x
    return (x * s[0], y * s[1], z * s[2])


@inlined
def _orientation(m: Matrix) -> Quaternion:
    """The rotation in a matrix that may also stretch, shear and mirror: the Q of its QR factorisation, turned over along x if
    it mirrors; not finite where the matrix is flat.

    Gram-Schmidt keeps the direction of the x axis and the plane of x and y. That choice can be undone: if Q is the rotation of
    A R, then R is that of inverse(A) Q, because the inverse of an upper triangle is one.
    """
    length = math.sqrt(m[0] * m[0] + m[3] * m[3] + m[6] * m[6])
    ux, uy, uz = m[0] / length, m[3] / length, m[6] / length
    along = ux * m[1] + uy * m[4] + uz * m[7]
    vx, vy, vz = m[1] - along * ux, m[4] - along * uy, m[7] - along * uz
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = vx / length, vy / length, vz / length
    tx, ty, tz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    if tx * m[2] + ty * m[5] + tz * m[8] < 0.0:
        ux, uy, uz, tx, ty, tz = -ux, -uy, -uz, -tx, -ty, -tz
    return _quaternion_of((ux, vx, tx, uy, vy, ty, uz, vz, tz))


@inlined
def _quaternion_of(m: Matrix) -> Quaternion:
    """The quaternion of a rotation matrix, through its largest element (Shepperd 1978)."""
    trace = m[0] + m[4] + m[8]
    if trace >= m[0] and trace >= m[4] and trace >= m[8]:
        x, y, z, w = m[7] - m[5], m[2] - m[6], m[3] - m[1], 1.0 + trace
    elif m[0] >= m[4] and m[0] >= m[8]:
        x, y, z, w = 1.0 + m[0] - m[4] - m[8], m[1] + m[3], m[2] + m[6], m[7] - m[5]
    elif m[4] >= m[8]:
        x, y, z, w = m[1] + m[3], 1.0 + m[4] - m[0] - m[8], m[5] + m[7], m[2] - m[6]
    else:
        x, y, z, w = m[2] + m[6], m[5] + m[7], 1.0 + m[8] - m[0] - m[4], m[3] - m[1]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return (x / length, y / length, z / length, w / length)


@inlined
def _matrix_of(q: Quaternion) -> Matrix:
    """The rotation matrix of a quaternion, orthonormal even where float32 left the quaternion's length a little off."""
    x, y, z, w = q
    t = 2.0 / (x * x + y * y + z * z + w * w)
    xx, yy, zz, xy, xz, yz = t * x * x, t * y * y, t * z * z, t * x * y, t * x * z, t * y * z
    wx, wy, wz = t * w * x, t * w * y, t * w * z
    return (1.0 - yy - zz, xy - wz, xz + wy, xy + wz, 1.0 - xx - zz, yz - wx, xz - wy, yz + wx, 1.0 - xx - yy)


@inlined
def _transformed(m: Matrix, v: Vector) -> Vector:
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


@inlined
def _matrix_product(a: Matrix, b: Matrix) -> Matrix:
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@inlined
def _cofactors(m: Matrix) -> Vector:
    """Of the first row: times it they give the determinant."""
    return (m[4] * m[8] - m[5] * m[7], m[5] * m[6] - m[3] * m[8], m[3] * m[7] - m[4] * m[6])


@inlined
def _inverse(m: Matrix) -> Matrix:
    """The inverse of a matrix by cofactors; not finite where it is flat."""
    c = _cofactors(m)
    d = 1.0 / (m[0] * c[0] + m[1] * c[1] + m[2] * c[2])
    return (
        c[0] * d,
        (m[2] * m[7] - m[1] * m[8]) * d,
        (m[1] * m[5] - m[2] * m[4]) * d,
        c[1] * d,
        (m[0] * m[8] - m[2] * m[6]) * d,
        (m[2] * m[3] - m[0] * m[5]) * d,
        c[2] * d,
        (m[1] * m[6] - m[0] * m[7]) * d,
        (m[0] * m[4] - m[1] * m[3]) * d,
    )


def _kernels() -> tuple[tuple[str, Any, tuple[tuple[Any, ...], ...]], ...]:
    places, flags, affine = np.zeros(1, np.int32), np.zeros(1, np.bool_), np.zeros((1, 3, 4))
    position, rotation, scale = np.zeros((1, 3)), np.zeros((1, 4), np.float32), np.zeros((1, 3), np.float32)
    links = Links(places, places, places)
    local = LocalColumns(places, position, rotation, scale)
    poses, targets = WorldPoses(position, rotation, scale), TargetPoses(places, position, rotation)
    return (
        ("scene.walk_tree", walk_tree, (signature_of(links, flags, places, flags),)),
        ("scene.place_tree", place_tree, (signature_of(places, places, local, affine, flags, targets),)),
        ("scene.read_poses", read_poses, (signature_of(places, places, local, affine, poses),)),
    )


# What a warm-up compiles or loads before the first tick: name, kernel, its signatures.
KERNELS: Final = _kernels()
