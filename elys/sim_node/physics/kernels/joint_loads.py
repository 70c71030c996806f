"""Bodies under so much tension that turning them a little turns them back faster than a substep can follow.

A force F on an arm r resists turning like a spring of stiffness F r across the arm. Where that swings faster than the
substeps, as in a light chain with a thousandfold weight, joints see the body with more inertia, by the square of the substep
times this stiffness: Andrews, Teichmann & Kovecses, "Geometric Stiffness for Real-time Constrained Multibody Dynamics" (2017).
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import GEAR

MOST_TURN = (
    1.5  # square of angle by which a body may swing in a substep, summed over its axes, until it is made heavier
)


@inner
def add_load(load, impulse, arm, at, h):
    """Adds the stiffness of an impulse (first three numbers) on an arm, times h^2: xx yy zz xy xz yz."""
    x, y, z = arm[at], arm[at + 1], arm[at + 2]
    length = math.sqrt(x * x + y * y + z * z)
    force = math.sqrt(impulse[0] * impulse[0] + impulse[1] * impulse[1] + impulse[2] * impulse[2])
    if length == 0.0 or force == 0.0:
        return
    scale = h * force / length
    load[0] += scale * (y * y + z * z)
    load[1] += scale * (x * x + z * z)
    load[2] += scale * (x * x + y * y)
    load[3] -= scale * x * y
    load[4] -= scale * x * z
    load[5] -= scale * y * z


@inner
def stiffen(inertia, at, load):
    """Changes a world inverse inertia A for a load S: A (1 + s S A)^-1, with a share s that begins at nothing."""
    xx, yy, zz = inertia[at], inertia[at + 1], inertia[at + 2]
    xy, xz, yz = inertia[at + 3], inertia[at + 4], inertia[at + 5]
    swing = xx * load[0] + yy * load[1] + zz * load[2] + 2.0 * (xy * load[3] + xz * load[4] + yz * load[5])
    if swing <= MOST_TURN:
        return
    s = 1.0 - MOST_TURN / swing
    a, b, c, d, e, f = s * load[0], s * load[1], s * load[2], s * load[3], s * load[4], s * load[5]
    m00 = 1.0 + a * xx + d * xy + e * xz
    m01 = a * xy + d * yy + e * yz
    m02 = a * xz + d * yz + e * zz
    m10 = d * xx + b * xy + f * xz
    m11 = 1.0 + d * xy + b * yy + f * yz
    m12 = d * xz + b * yz + f * zz
    m20 = e * xx + f * xy + c * xz
    m21 = e * xy + f * yy + c * yz
    m22 = 1.0 + e * xz + f * yz + c * zz
    c00 = m11 * m22 - m12 * m21
    c01 = m12 * m20 - m10 * m22
    c02 = m10 * m21 - m11 * m20
    inverse = 1.0 / (m00 * c00 + m01 * c01 + m02 * c02)
    # The columns of the adjugate that the upper triangle of A adj(M) needs.
    c10 = m02 * m21 - m01 * m22
    c11 = m00 * m22 - m02 * m20
    c12 = m01 * m20 - m00 * m21
    c20 = m01 * m12 - m02 * m11
    c21 = m02 * m10 - m00 * m12
    c22 = m00 * m11 - m01 * m10
    inertia[at] = (xx * c00 + xy * c01 + xz * c02) * inverse
    inertia[at + 1] = (xy * c10 + yy * c11 + yz * c12) * inverse
    inertia[at + 2] = (xz * c20 + yz * c21 + zz * c22) * inverse
    inertia[at + 3] = (xx * c10 + xy * c11 + xz * c12) * inverse
    inertia[at + 4] = (xx * c20 + xy * c21 + xz * c22) * inverse
    inertia[at + 5] = (xy * c20 + yy * c21 + yz * c22) * inverse


@inner
def spread_loads(joints, order, first, last, loads, h):
    """Makes bodies heavier that carried too much in the last substep; `loads` (N, 6) is room to sum over bodies.

    All joints of a body see the same, or the matrix of their responses would not be symmetric.
    """
    for place in range(first, last):
        j = order[place]
        for side in range(2):
            row = joints[j].body[side]
            if row >= 0:
                for c in range(6):
                    loads[row, c] = 0.0
    for place in range(first, last):
        j = order[place]
        joint = joints[j]
        for side in range(2):
            row = joint.body[side]
            if joint.live != 0 and joint.kind != GEAR and row >= 0:
                add_load(loads[row], joint.applied, joint.arm, 3 * side, h)
    for place in range(first, last):
        j = order[place]
        joint = joints[j]
        for side in range(2):
            row = joint.body[side]
            if joint.live != 0 and joint.kind != GEAR and row >= 0 and joint.inverse_mass[side] > 0.0:
                stiffen(joint.inertia, 6 * side, loads[row])
