"""How jointed bodies turn within a step.

Contacts may take a step's turns as small and add them up. Joints may not: where a body stands is what they are about. So their
bodies turn exactly in every substep, one turn after the other, and spin on as Euler's equations say.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.locks import TURNS
from elys.sim_node.physics.kernels.rotation import multiplied, normalized, rotated, spun, turn_by
from elys.sim_node.physics.kernels.tables import JOINTED
from elys.sim_node.physics.kernels.trigonometry import arc_tangent

MOST_TURN = 3.0  # in a substep [rad]: beyond it nothing could be integrated, and nothing would be seen
STILL = 1e-24  # squared turn [rad^2] below which turns may be added up


@inner
def keep_turn(q, x, y, z, w, displacement, turned):
    """Writes the rotation vector that leads from the orientation q, as the step began, to another one."""
    x, y, z, w = multiplied(x, y, z, w, -q[0], -q[1], -q[2], q[3])
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * arc_tangent(sine, abs(w)) / sine if sine > 0.0 else 2.0
    if w < 0.0:
        scale = -scale
    displacement[3], displacement[4], displacement[5] = scale * x, scale * y, scale * z
    for k in range(3):
        turned[k] = displacement[3 + k]


@inner
def turn_jointed(body, solved, drive, rest, turned, h):
    """Makes one turn of what was added to the rotation vector: in a substep of length h, or at its end where h is 0.

    In a substep the body flies freely. At its end it is turned back with the angular momentum it has.
    """
    d = solved.displacement
    t = turned
    tx, ty, tz = float(t[0]), float(t[1]), float(t[2])
    rx, ry, rz = d[3] - tx, d[4] - ty, d[5] - tz
    squared = rx * rx + ry * ry + rz * rz
    if squared < STILL:
        for k in range(3):
            turned[k] = d[3 + k]
        return
    if squared > MOST_TURN * MOST_TURN:
        scale = MOST_TURN / math.sqrt(squared)
        rx, ry, rz = scale * rx, scale * ry, scale * rz
    q = body.rotation
    inverse = body.inverse_inertia
    ix, iy, iz = inverse[0], inverse[1], inverse[2]
    if ix * iy * iz == 0.0 or body.locked & TURNS:
        ix, iy, iz = 1.0, 1.0, 1.0
    x, y, z, w = turn_by(tx, ty, tz)
    x, y, z, w = multiplied(x, y, z, w, q[0], q[1], q[2], q[3])
    v = solved.velocity
    if h > 0.0:
        ox, oy, oz = rx / h, ry / h, rz / h
        x, y, z, w, px, py, pz = spun(x, y, z, w, ox, oy, oz, ix, iy, iz, h)
    else:
        ox, oy, oz = float(v[3]), float(v[4]), float(v[5])
        px, py, pz = rotated(-x, -y, -z, w, ox, oy, oz)
        lx, ly, lz = rotated(x, y, z, w, px / ix, py / iy, pz / iz)
        px, py, pz, pw = turn_by(rx, ry, rz)
        x, y, z, w = multiplied(px, py, pz, pw, x, y, z, w)
        x, y, z, w = normalized(x, y, z, w)
        px, py, pz = rotated(-x, -y, -z, w, lx, ly, lz)
        px, py, pz = rotated(x, y, z, w, px * ix, py * iy, pz * iz)
    keep_turn(q, x, y, z, w, d, turned)
    if ix == iy and iy == iz:
        return
    free = drive.free_velocity
    start = drive.start_velocity
    for k, change in ((3, px - ox), (4, py - oy), (5, pz - oz)):
        exact = v[k] + change
        v[k] = exact
        rest[k] += exact - v[k]
        free[k] += change
        start[k] += change


@inner
def turn_all(joints, held, first, last, solver_bodies, drives, h):
    """Turns the jointed ones among held bodies, see `turn_jointed`."""
    for index in range(first, last):
        i = held[index]
        if joints.bodies[i].held == JOINTED:
            turn_jointed(joints.bodies[i], solver_bodies[i], drives[i], joints.rest[i], joints.turned[i], h)
