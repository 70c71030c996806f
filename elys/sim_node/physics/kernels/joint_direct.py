"""The locked rows of many joints solved at once, by block elimination: a chain of joints is as stiff as one.

The matrix J M^-1 J^T has a block for each joint and for each two joints on one body. Its factors L D L^T have blocks where
the plan of elimination says so (`JointPlan`); a tree of joints costs as much as its joints one by one.

The diagonal is made softer by a millionth. Rows that say the same, as in a closed loop of hinges, then share their load
instead of being solved at random; what this costs in stiffness is of the order of a micrometre.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.joint_mass import factor_locked, solve_factor, write_response
from elys.sim_node.physics.kernels.tables import JOINT_ROWS, LOCKED

SOFTNESS = 1e-6


@inner
def write_coupling(block, joint, row, other, other_row, rows):
    """How the rows of a joint respond to impulses of another one's, through the bodies that both hold."""
    out = block.response
    for k in range(LOCKED * LOCKED):
        out[k] = 0.0
    for side in range(2):
        body = joint.body[side]
        if body < 0 or joint.inverse_mass[side] == 0.0:
            continue
        for facing in range(2):
            if other.body[facing] != body:
                continue
            sign = 1.0 if side == facing else -1.0
            for i in range(joint.locked):
                row_i = rows[row + i]
                for j in range(other.locked):
                    row_j = rows[other_row + j]
                    total = 0.0
                    for c in range(3):
                        total += joint.axis_mass[3 * side + c] * row_i.direction[c] * row_j.direction[c]
                        total += row_i.arm[3 * side + c] * row_j.turn[3 * facing + c]
                    out[LOCKED * i + j] += sign * total


@inner
def subtract_product(target, gain, response, n, m, inner_size, lower):
    """target -= gain response^T, n x m; with `lower` only on and below the diagonal."""
    for i in range(n):
        for j in range(i + 1 if lower else m):
            total = 0.0
            for k in range(inner_size):
                total += gain[LOCKED * i + k] * response[LOCKED * j + k]
            target[LOCKED * i + j] -= total


@inner
def eliminate(joints, columns, blocks, updates, c):
    """Takes the rows of one joint out of those that come later."""
    column = columns[c]
    joint = joints[column.joint]
    factor_locked(joint)
    n = joint.locked
    work = joint.work
    for b in range(column.first, column.first + column.count):
        block = blocks[b]
        for i in range(joints[block.joint].locked):
            for k in range(n):
                work[k] = block.response[LOCKED * i + k]
            solve_factor(joint, work)
            for k in range(n):
                block.gain[LOCKED * i + k] = work[k]
    update = column.update
    for b in range(column.first, column.first + column.count):
        gain = blocks[b].gain
        later = joints[blocks[b].joint]
        for other in range(column.first, b + 1):
            response = blocks[other].response
            if other == b:
                subtract_product(later.factor, gain, response, later.locked, later.locked, n, True)
                continue
            target = blocks[updates[update]]
            update += 1
            m = joints[blocks[other].joint].locked
            subtract_product(target.response, gain, response, later.locked, m, n, False)


@inner
def factor_joints(joints, rows, columns, first, last, blocks, updates):
    """Assembles and factors the matrix of joints that are solved directly, in columns [first, last)."""
    for c in range(first, last):
        column = columns[c]
        joint = joints[column.joint]
        write_response(joint, rows, JOINT_ROWS * column.joint, SOFTNESS)
        for b in range(column.first, column.first + column.count):
            other = blocks[b].joint
            write_coupling(blocks[b], joints[other], JOINT_ROWS * other, joint, JOINT_ROWS * column.joint, rows)
    for c in range(first, last):
        eliminate(joints, columns, blocks, updates, c)


@inner
def substitute(joints, columns, first, last, blocks):
    """Solves for the impulses of all these joints, from and into their `work`."""
    for c in range(first, last):
        column = columns[c]
        x = joints[column.joint].work
        for b in range(column.first, column.first + column.count):
            later = joints[blocks[b].joint]
            for i in range(later.locked):
                for k in range(joints[column.joint].locked):
                    later.work[i] -= blocks[b].gain[LOCKED * i + k] * x[k]
    for c in range(last - 1, first - 1, -1):
        column = columns[c]
        joint = joints[column.joint]
        solve_factor(joint, joint.work)
        for b in range(column.first, column.first + column.count):
            later = joints[blocks[b].joint]
            for i in range(later.locked):
                for k in range(joint.locked):
                    joint.work[k] -= blocks[b].gain[LOCKED * i + k] * later.work[i]
