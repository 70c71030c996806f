"""Contacts, solved by sequential impulses in substeps.

Each substep solves all contacts with a soft push against overlap, moves the bodies, and solves again without the push, so
that no energy stays from it ("relaxation"). Impulses are accumulated and clamped: normal impulses not below zero, friction
to the Coulomb CONE of the sum of the manifold's normal impulses, and the next substep begins with them.

After Macklin et al., "Small Steps in Physics Simulation" (2019), and Catto, "Solver2D" (2024). Friction comes before the
normal impulses: the other order makes heavy stacks shake.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.impact import bounce_contacts
from elys.sim_node.physics.kernels.integrator import begin_step, integrate_positions, integrate_velocities, take_back
from elys.sim_node.physics.kernels.joints import solve_joints, warm_start_joints
from elys.sim_node.physics.kernels.tables import POINTS

# A gap that was closed exactly is 0 give or take rounding, and rounding must not choose between hard and soft [m].
TOUCHING = 1e-9
# Nor must an impulse that is nothing but rounding count as a contact that pushes [m/s].
FELT = 1e-9


@inner
def push_bodies(a, b, px, py, pz):
    """A linear impulse on body b, and the opposite on body a."""
    va = a.velocity
    vb = b.velocity
    ma = a.inverse_mass
    mb = b.inverse_mass
    va[0] -= ma * px
    va[1] -= ma * py
    va[2] -= ma * pz
    vb[0] += mb * px
    vb[1] += mb * py
    vb[2] += mb * pz


@inner
def apply_friction(a, b, row, f1, f2, twist):
    """Friction impulses of a row: along both tangents and about the normal."""
    t = row.tangent
    push_bodies(a, b, f1 * t[0] + f2 * t[3], f1 * t[1] + f2 * t[4], f1 * t[2] + f2 * t[5])
    va = a.velocity
    vb = b.velocity
    turn = row.friction_turn
    about = row.twist_turn
    for c in range(3):
        va[3 + c] -= f1 * turn[c] + f2 * turn[6 + c] + twist * about[c]
        vb[3 + c] += f1 * turn[3 + c] + f2 * turn[9 + c] + twist * about[3 + c]


@inner
def warm_start(bodies, rows, row_points, row_count):
    """Begins the step with the impulses of the last one."""
    for r in range(row_count):
        row = rows[r]
        a = bodies[row.body_a]
        b = bodies[row.body_b]
        va = a.velocity
        vb = b.velocity
        total = 0.0
        for k in range(r * POINTS, r * POINTS + row.point_count):
            point = row_points[k]
            impulse = point.impulse
            turn = point.turn
            total += impulse
            for c in range(3):
                va[3 + c] -= impulse * turn[c]
                vb[3 + c] += impulse * turn[3 + c]
        n = row.normal
        push_bodies(a, b, total * n[0], total * n[1], total * n[2])
        f = row.friction_impulse
        apply_friction(a, b, row, f[0], f[1], f[2])


@inner
def solve_friction(a, b, row, row_points, first):
    """Stops sliding and twisting of a row as far as its normal impulses allow."""
    load = 0.0
    torque = 0.0
    for k in range(first, first + row.point_count):
        load += row_points[k].impulse
        torque += row_points[k].impulse * row_points[k].lever
    old = row.friction_impulse
    f1, f2, f3 = old[0], old[1], old[2]
    load *= row.friction
    if load == 0.0 and f1 == 0.0 and f2 == 0.0 and f3 == 0.0:
        return
    torque *= row.friction
    va = a.velocity
    vb = b.velocity
    t = row.tangent
    n = row.normal
    arm = row.friction_arm
    slip1 = slip2 = spin = 0.0
    for c in range(3):
        linear = vb[c] - va[c]
        slip1 += linear * t[c] + vb[3 + c] * arm[3 + c] - va[3 + c] * arm[c]
        slip2 += linear * t[3 + c] + vb[3 + c] * arm[9 + c] - va[3 + c] * arm[6 + c]
        spin += (vb[3 + c] - va[3 + c]) * n[c]
    mass = row.friction_mass
    g1 = f1 - (mass[0] * slip1 + mass[1] * slip2)
    g2 = f2 - (mass[1] * slip1 + mass[2] * slip2)
    squared = g1 * g1 + g2 * g2
    if squared > load * load:
        scale = load / math.sqrt(squared)
        g1 *= scale
        g2 *= scale
    g3 = min(max(f3 - row.twist_mass * spin, -torque), torque)
    apply_friction(a, b, row, g1 - f1, g2 - f2, g3 - f3)
    old[0], old[1], old[2] = g1, g2, g3


@inner
def solve_normals(a, b, row, row_points, first, constants, biased):
    """Keeps the points of a row apart. With `biased` overlap is pushed out softly, else only approach is stopped."""
    va = a.velocity
    vb = b.velocity
    da = a.displacement
    db = b.displacement
    n = row.normal
    nx, ny, nz = n[0], n[1], n[2]
    mass = a.inverse_mass + b.inverse_mass
    apart = (db[0] - da[0]) * nx + (db[1] - da[1]) * ny + (db[2] - da[2]) * nz
    speed = (vb[0] - va[0]) * nx + (vb[1] - va[1]) * ny + (vb[2] - va[2]) * nz
    ax, ay, az = va[3], va[4], va[5]
    bx, by, bz = vb[3], vb[4], vb[5]
    inverse_h = 1.0 / constants.substep
    lead = 0.0
    if row.restitution > 0.0:  # the gap at the end of the substep as `take_back` will leave it
        lead = 0.5 * constants.substep * max(row.closing, 0.0)
    total = 0.0
    struck = False
    for k in range(first, first + row.point_count):
        point = row_points[k]
        arm = point.arm
        gap = point.separation + apart + db[3] * arm[3] + db[4] * arm[4] + db[5] * arm[5]
        gap -= da[3] * arm[0] + da[4] * arm[1] + da[5] * arm[2]
        opening = speed + bx * arm[3] + by * arm[4] + bz * arm[5] - ax * arm[0] - ay * arm[1] - az * arm[2]
        old = point.impulse
        felt = point.effective_mass * FELT
        if not biased and old <= felt:  # what is about to touch is left to the next substep
            new = 0.0
        elif gap > TOUCHING:  # may close the gap, but not more
            new = old - point.effective_mass * (opening + gap * inverse_h + lead)
        elif biased:
            push = max(row.push_rate * gap, -constants.push_speed)
            new = old - point.effective_mass * row.mass_scale * (opening + push) - row.impulse_scale * old
        else:
            new = old - point.effective_mass * opening
        new = max(new, 0.0)
        point.impulse = new
        struck = struck or (old <= felt < new)
        if not biased:
            point.step_impulse += new
        change = new - old
        total += change
        speed += change * mass
        turn = point.turn
        ax -= change * turn[0]
        ay -= change * turn[1]
        az -= change * turn[2]
        bx += change * turn[3]
        by += change * turn[4]
        bz += change * turn[5]
    push_bodies(a, b, total * nx, total * ny, total * nz)
    va[3], va[4], va[5] = ax, ay, az
    vb[3], vb[4], vb[5] = bx, by, bz
    if struck:
        a.struck = 1
        b.struck = 1


@inner
def solve_rows(bodies, rows, row_points, row_count, constants, biased):
    for r in range(row_count):
        row = rows[r]
        a = bodies[row.body_a]
        b = bodies[row.body_b]
        solve_friction(a, b, row, row_points, r * POINTS)
        solve_normals(a, b, row, row_points, r * POINTS, constants, biased)


@inner
def store_impulses(bodies, manifolds, points, rows, row_points, row_count):
    """Keeps the impulses for the next step, friction as a world vector: the tangents may be others then."""
    for r in range(row_count):
        row = rows[r]
        n = row.normal
        da = bodies[row.body_a].displacement
        db = bodies[row.body_b].displacement
        for k in range(row.point_count):
            source = row_points[r * POINTS + k]
            point = points[row.slot * POINTS + k]
            arm = source.arm
            gap = source.separation
            for c in range(3):
                gap += (db[c] - da[c]) * n[c] + db[3 + c] * arm[3 + c] - da[3 + c] * arm[c]
            point.separation = gap
            point.normal_impulse = source.impulse
            point.step_impulse = source.step_impulse
        f = row.friction_impulse
        t = row.tangent
        manifold = manifolds[row.slot]
        for c in range(3):
            manifold.friction_impulse[c] = f[0] * t[c] + f[1] * t[3 + c]
        manifold.twist_impulse = f[2]


@kernel
def solve_contacts(
    bodies,
    manifolds,
    points,
    rows,
    row_points,
    row_count,
    joints,
    joint_rows,
    joint_count,
    columns,
    blocks,
    updates,
    loads,
    all_constants,
):
    """All substeps of a step: velocities and displacements of the bodies, impulses of the contacts and joints.

    The two solves stand in a loop because a call with True and one with False would be compiled twice.
    """
    constants = all_constants[0]
    begin_step(bodies)
    for substep in range(constants.substeps):
        if constants.can_bounce != 0:
            bounce_contacts(bodies, rows, row_points, row_count, constants)
        integrate_velocities(bodies, constants)
        if substep == 0:
            warm_start(bodies, rows, row_points, row_count)
            warm_start_joints(bodies, joints, joint_rows, joint_count)
        for phase in range(2):
            solve_joints(
                bodies, joints, joint_rows, joint_count, columns, blocks, updates, loads, constants, phase == 0
            )
            solve_rows(bodies, rows, row_points, row_count, constants, phase == 0)
            if phase == 0:
                integrate_positions(bodies, constants)
        take_back(bodies, constants)
    store_impulses(bodies, manifolds, points, rows, row_points, row_count)
