"""Effective masses of joints: the locked rows together as one block, the free rows with the locked ones held."""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.placement import write_axes
from elys.sim_node.physics.kernels.tables import AXIS, LOCKED, MOTOR

# A row that keeps less than this share of its own mobility when the rows before it are held is no further condition.
SINGULAR = 1e-9


@inner
def turn_inertia(joint):
    """Turns the world inverse inertias with the bodies: R I R^T."""
    source = joint.start_inertia
    out = joint.inertia
    for side in range(2):
        i = 6 * side
        is_round = source[i] == source[i + 1] and source[i] == source[i + 2] and source[i + 3] == 0.0 == source[i + 4]
        if is_round or joint.turns_locked[side] != 0:
            for k in range(6):  # as round as a ball, or immovable, or as it is about the axes that are free
                out[i + k] = source[i + k]
            continue
        q = joint.turn
        # Columns of R, in room that the locked rows' factor does not need yet.
        m = joint.factor
        write_axes(m, q[4 * side], q[4 * side + 1], q[4 * side + 2], q[4 * side + 3])
        xx, yy, zz, xy, xz, yz = (source[i], source[i + 1], source[i + 2], source[i + 3], source[i + 4], source[i + 5])
        for k in range(3):  # R I, row by row
            a, b, c = m[k], m[3 + k], m[6 + k]
            m[9 + 3 * k] = a * xx + b * xy + c * xz
            m[10 + 3 * k] = a * xy + b * yy + c * yz
            m[11 + 3 * k] = a * xz + b * yz + c * zz
        out[i] = m[9] * m[0] + m[10] * m[3] + m[11] * m[6]
        out[i + 1] = m[12] * m[1] + m[13] * m[4] + m[14] * m[7]
        out[i + 2] = m[15] * m[2] + m[16] * m[5] + m[17] * m[8]
        out[i + 3] = m[9] * m[1] + m[10] * m[4] + m[11] * m[7]
        out[i + 4] = m[9] * m[2] + m[10] * m[5] + m[11] * m[8]
        out[i + 5] = m[12] * m[2] + m[13] * m[5] + m[14] * m[8]


@inner
def write_turn(joint, row):
    """How a unit impulse of the row changes both angular velocities."""
    inertia = joint.inertia
    arm = row.arm
    turn = row.turn
    for side in range(2):
        i = 6 * side
        r = 3 * side
        x, y, z = arm[r], arm[r + 1], arm[r + 2]
        turn[r] = inertia[i] * x + inertia[i + 3] * y + inertia[i + 4] * z
        turn[r + 1] = inertia[i + 3] * x + inertia[i + 1] * y + inertia[i + 5] * z
        turn[r + 2] = inertia[i + 4] * x + inertia[i + 5] * y + inertia[i + 2] * z


@inner
def response(joint, row, other):
    """How much a unit impulse of one row changes the rate of another."""
    total = 0.0
    mass = joint.axis_mass
    for c in range(3):
        total += (mass[c] + mass[3 + c]) * row.direction[c] * other.direction[c]
    for c in range(6):
        total += row.turn[c] * other.arm[c]
    return total


@inner
def write_response(joint, rows, first, softness):
    """How the locked rows respond to impulses of one another, as a lower triangle.

    Force and torque of a drive are solved one after the other, as each has a limit of its own.
    """
    f = joint.factor
    for i in range(joint.locked):
        for j in range(i + 1):
            apart = joint.kind == MOTOR and j < 3 <= i
            f[LOCKED * i + j] = 0.0 if apart else response(joint, rows[first + i], rows[first + j])
        rows[first + i].own = f[LOCKED * i + i]
        f[LOCKED * i + i] *= 1.0 + softness


@inner
def factor_locked(joint):
    """L D L^T of the locked rows' responses, in place: L below the diagonal, the inverse of D on it."""
    f = joint.factor
    for i in range(joint.locked):
        own = f[LOCKED * i + i]
        rest = own
        for j in range(i):
            value = f[LOCKED * i + j]
            for k in range(j):
                value -= f[LOCKED * i + k] * f[LOCKED * j + k]  # what stands in row i is not divided by D yet
            f[LOCKED * i + j] = value
        for k in range(i):
            value = f[LOCKED * i + k] * f[LOCKED * k + k]
            rest -= value * f[LOCKED * i + k]
            f[LOCKED * i + k] = value
        f[LOCKED * i + i] = 1.0 / rest if rest > SINGULAR * own else 0.0


@inner
def solve_factor(joint, x):
    """Solves for the locked rows' impulses in place; x is (6,)."""
    n = joint.locked
    f = joint.factor
    for i in range(n):
        for k in range(i):
            x[i] -= f[LOCKED * i + k] * x[k]
    for i in range(n):
        x[i] *= f[LOCKED * i + i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= f[LOCKED * k + i] * x[k]


@inner
def prepare_free(joint, rows, first, row):
    """The effective mass of a free row, and how the locked rows answer to it. Soft ones do not: they give way."""
    n = joint.locked if joint.frequency == 0.0 else 0
    own = response(joint, row, row)
    rest = own
    answer = row.answer
    for k in range(n, joint.locked):
        answer[k] = 0.0
    for k in range(n):
        answer[k] = response(joint, row, rows[first + k])
        joint.work[k] = answer[k]
    if n > 0:
        solve_factor(joint, answer)
    for k in range(n):
        rest -= answer[k] * joint.work[k]
    row.effective_mass = 1.0 / rest if rest > SINGULAR * own else 0.0


@inner
def prepare_masses(joint, rows, first):
    """All that depends on the masses, for the rows as they are written."""
    for k in range(joint.locked):
        write_turn(joint, rows[first + k])
    write_response(joint, rows, first, 0.0)
    factor_locked(joint)
    for k in range(AXIS, AXIS + joint.free):
        write_turn(joint, rows[first + k])
        prepare_free(joint, rows, first, rows[first + k])
