"""Locked axes: along some axes of the world a body never moves, and about some it never turns.

Bits 0 to 2 of `locked` are translations along x, y, z, bits 3 to 5 turns about them. A turn that is locked is taken out of
the inertia: what is left of its inverse is the inverse of the part of the inertia that still counts. So contacts see a body
that cannot turn that way, and nothing has to be put right afterwards.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.placement import write_world_inertia
from elys.sim_node.physics.kernels.rotation import multiplied, normalized, turn_by

TRANSLATIONS = 7
TURNS = 56


@inner
def hold_axes(body):
    """Takes the locked parts out of a body's velocity."""
    for k in range(6):
        if body.locked >> k & 1:
            body.velocity[k] = 0.0


@inner
def hold_solved(locked, solved):
    """Takes out of what the solver found what rounding put along locked axes; `locked` is a body's bits."""
    for k in range(6):
        if locked >> k & 1:
            solved.velocity[k] = 0.0
            solved.displacement[k] = 0.0


@inner
def lock_inertia(inertia, locked):
    """Takes locked turns out of an inverse inertia in world axes, xx yy zz xy xz yz: a Schur complement for each."""
    for axis in range(3):
        if locked >> (3 + axis) & 1:
            own = inertia[axis]
            p = 3 if axis < 2 else 4  # where the products with the two other axes stand
            q = 4 if axis == 0 else 5
            u = 1 if axis == 0 else 0
            v = 1 if axis == 2 else 2
            across = 5 if axis == 0 else (4 if axis == 1 else 3)
            if own > 0.0:
                inertia[u] -= inertia[p] * inertia[p] / own
                inertia[v] -= inertia[q] * inertia[q] / own
                inertia[across] -= inertia[p] * inertia[q] / own
            inertia[axis] = 0.0
            inertia[p] = 0.0
            inertia[q] = 0.0
    for axis in range(3):  # what rounding leaves of nothing, and what it makes negative
        if locked >> (3 + axis) & 1 or inertia[axis] < 0.0:
            inertia[axis] = 0.0


@inner
def free_part(locked, k):
    """1 where a translation is free, else 0; `locked` is a body's bits."""
    return 0.0 if locked >> k & 1 else 1.0


@inner
def applied(inertia, x, y, z):
    """The product of a symmetric matrix xx yy zz xy xz yz with a vector."""
    return (
        inertia[0] * x + inertia[3] * y + inertia[4] * z,
        inertia[3] * x + inertia[1] * y + inertia[5] * z,
        inertia[4] * x + inertia[5] * y + inertia[2] * z,
    )


@inner
def world_momentum(body, ox, oy, oz):
    """The angular momentum of a body that turns with a world angular velocity."""
    q = body.rotation
    x, y, z, w = q[0], q[1], q[2], q[3]
    total_x = total_y = total_z = 0.0
    for k in range(3):
        ax = 1.0 - 2.0 * (y * y + z * z) if k == 0 else (2.0 * (x * y - w * z) if k == 1 else 2.0 * (x * z + w * y))
        ay = 2.0 * (x * y + w * z) if k == 0 else (1.0 - 2.0 * (x * x + z * z) if k == 1 else 2.0 * (y * z - w * x))
        az = 2.0 * (x * z - w * y) if k == 0 else (2.0 * (y * z + w * x) if k == 1 else 1.0 - 2.0 * (x * x + y * y))
        along = (ax * ox + ay * oy + az * oz) / body.inverse_inertia[k]
        total_x += along * ax
        total_y += along * ay
        total_z += along * az
    return total_x, total_y, total_z


@inner
def turn_locked(body, room, h):
    """A free turn of a body with locked turns, for the time h; `room` (6,) is for its inertia.

    What holds it takes angular momentum about the locked axes only: that about the free ones is kept. The midpoint rule.
    """
    v = body.velocity
    q = body.rotation
    if v[3] == 0.0 and v[4] == 0.0 and v[5] == 0.0:
        return
    if body.inverse_inertia[0] * body.inverse_inertia[1] * body.inverse_inertia[2] == 0.0:
        dx, dy, dz, dw = turn_by(v[3] * h, v[4] * h, v[5] * h)
        x, y, z, w = multiplied(dx, dy, dz, dw, q[0], q[1], q[2], q[3])
        q[0], q[1], q[2], q[3] = normalized(x, y, z, w)
        return
    lx, ly, lz = world_momentum(body, v[3], v[4], v[5])
    sx, sy, sz, sw = q[0], q[1], q[2], q[3]
    ox, oy, oz = v[3], v[4], v[5]
    for stage in range(2):
        part = 0.5 * h if stage == 0 else h
        dx, dy, dz, dw = turn_by(ox * part, oy * part, oz * part)
        x, y, z, w = multiplied(dx, dy, dz, dw, sx, sy, sz, sw)
        q[0], q[1], q[2], q[3] = normalized(x, y, z, w)
        write_world_inertia(body, room)
        lock_inertia(room, body.locked)
        ox, oy, oz = applied(room, lx, ly, lz)
    v[3], v[4], v[5] = ox, oy, oz
