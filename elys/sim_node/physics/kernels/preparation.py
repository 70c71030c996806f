"""What the solver works on in this step: bodies, and the contacts that may bounce."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.impact import response_along
from elys.sim_node.physics.kernels.integrator import begin_body, begin_nobody
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.tables import DYNAMIC, POINTS


@kernel
def prepare_bodies(bodies, forces, held, held_end, groups, solver_bodies, drives, strengths, all_constants):
    """Fills the solver's rows of all held bodies; those that no force moves stand in `held` behind the last group."""
    constants = all_constants[0]
    begin_nobody(solver_bodies[bodies.shape[0]], drives[bodies.shape[0]])
    end = 0
    for g in range(groups.shape[0]):
        end = groups[g].last_body
        h = strengths[groups[g].strength].substep
        for index in range(groups[g].first_body, end):
            i = held[index]
            begin_body(bodies[i], forces[i], solver_bodies[i], drives[i], h, constants)
    for index in range(end, held_end):
        i = held[index]
        begin_body(bodies[i], forces[i], solver_bodies[i], drives[i], 0.0, constants)


@inner
def write_arm(arm, turn, at, inertia, rx, ry, rz, dx, dy, dz):
    """Stores r x d and its inverse inertia product at a place; returns how fast a unit impulse along d turns r along d."""
    x, y, z = cross(rx, ry, rz, dx, dy, dz)
    tx = inertia[0] * x + inertia[3] * y + inertia[4] * z
    ty = inertia[3] * x + inertia[1] * y + inertia[5] * z
    tz = inertia[4] * x + inertia[5] * y + inertia[2] * z
    arm[at], arm[at + 1], arm[at + 2] = x, y, z
    turn[at], turn[at + 1], turn[at + 2] = tx, ty, tz
    return x * tx + y * ty + z * tz


@inner
def inverse_or_zero(value):
    return 1.0 / value if value > 0.0 else 0.0


@inner
def prepare_points(row, row_points, first, manifold, a, b, drive_a, drive_b, constants):
    """The contact points of a row; returns the centre at which friction acts, from both centres of mass."""
    n = row.normal
    nx, ny, nz = n[0], n[1], n[2]
    shift = manifold.shift
    opened = shift[0] * nx + shift[1] * ny + shift[2] * nz
    turn_a = manifold.turn_a
    turn_b = manifold.turn_b
    anchors = manifold.anchors
    cx = cy = cz = dx = dy = dz = 0.0
    mass = response_along(a, drive_a, n, 0, n, 0) + response_along(b, drive_b, n, 0, n, 0)
    for k in range(row.point_count):
        out = row_points[first + k]
        arm = out.arm
        at = 6 * k
        response = mass
        response += write_arm(
            arm, out.turn, 0, drive_a.inverse_inertia, anchors[at], anchors[at + 1], anchors[at + 2], nx, ny, nz
        )
        response += write_arm(
            arm, out.turn, 3, drive_b.inverse_inertia, anchors[at + 3], anchors[at + 4], anchors[at + 5], nx, ny, nz
        )
        gap = manifold.made_separation[k] + opened
        for c in range(3):
            gap += turn_b[c] * arm[3 + c] - turn_a[c] * arm[c]
        out.separation = gap
        out.effective_mass = inverse_or_zero(response)
        out.step_impulse = 0.0
        cx += anchors[at]
        cy += anchors[at + 1]
        cz += anchors[at + 2]
        dx += anchors[at + 3]
        dy += anchors[at + 4]
        dz += anchors[at + 5]
    scale = 1.0 / row.point_count
    return cx * scale, cy * scale, cz * scale, dx * scale, dy * scale, dz * scale


@inner
def write_tangents(tangent, n):
    """Two unit vectors that make a frame with a unit normal; they change smoothly with it except in one place."""
    if abs(n[0]) > 0.57735:
        scale = 1.0 / math.sqrt(n[0] * n[0] + n[1] * n[1])
        tangent[0], tangent[1], tangent[2] = n[1] * scale, -n[0] * scale, 0.0
    else:
        scale = 1.0 / math.sqrt(n[1] * n[1] + n[2] * n[2])
        tangent[0], tangent[1], tangent[2] = 0.0, n[2] * scale, -n[1] * scale
    x, y, z = cross(n[0], n[1], n[2], tangent[0], tangent[1], tangent[2])
    tangent[3], tangent[4], tangent[5] = x, y, z


@inner
def prepare_friction(row, a, b, drive_a, drive_b, cx, cy, cz, dx, dy, dz):
    """Friction of a row at one centre: a 2 x 2 block in the tangent plane."""
    t = row.tangent
    write_tangents(t, row.normal)
    arm = row.friction_arm
    turn = row.friction_turn
    mass = row.friction_mass
    for direction in range(2):
        at = 3 * direction
        x, y, z = t[at], t[at + 1], t[at + 2]
        response = response_along(a, drive_a, t, at, t, at) + response_along(b, drive_b, t, at, t, at)
        response += write_arm(arm, turn, 2 * at, drive_a.inverse_inertia, cx, cy, cz, x, y, z)
        response += write_arm(arm, turn, 2 * at + 3, drive_b.inverse_inertia, dx, dy, dz, x, y, z)
        mass[2 * direction] = response
    k11 = mass[0]
    k22 = mass[2]
    k12 = response_along(a, drive_a, t, 0, t, 3) + response_along(b, drive_b, t, 0, t, 3)
    for c in range(6):
        k12 += arm[c] * turn[6 + c]
    determinant = k11 * k22 - k12 * k12
    inverse = inverse_or_zero(determinant) if determinant > 1e-12 * k11 * k22 else 0.0  # only one direction gives way
    mass[0], mass[1], mass[2] = k22 * inverse, -k12 * inverse, k11 * inverse


@inner
def prepare_row(row, row_points, first, slot, manifold, body_a, body_b, solver_bodies, drives, constants):
    """One manifold that may bounce."""
    row.slot = slot
    row.body_a = body_a
    row.body_b = body_b
    row.point_count = manifold.point_count
    row.friction = manifold.friction
    row.restitution = manifold.restitution
    a, b = solver_bodies[body_a], solver_bodies[body_b]
    drive_a, drive_b = drives[body_a], drives[body_b]
    g = constants.gravity
    along = 0.0
    for d in range(3):
        row.normal[d] = manifold.normal[d]
        along += g[d] * manifold.normal[d]
    row.closing = (drive_a.gravity_scale - drive_b.gravity_scale) * along
    cx, cy, cz, dx, dy, dz = prepare_points(row, row_points, first, manifold, a, b, drive_a, drive_b, constants)
    prepare_friction(row, a, b, drive_a, drive_b, cx, cy, cz, dx, dy, dz)


@inner
def group_of_pair(bodies, group_of, a, b):
    """The group of two touching bodies: that of the one that moves."""
    return group_of[a] if bodies[a].motion == DYNAMIC else group_of[b]


@kernel
def prepare_impacts(
    bodies,
    colliders,
    pairs,
    touching,
    touching_count,
    manifolds,
    rows,
    row_points,
    group_of,
    groups,
    solver_bodies,
    drives,
    all_constants,
):
    """Lists the manifolds that may bounce as rows, group by group; returns how many."""
    constants = all_constants[0]
    for g in range(groups.shape[0]):
        groups[g].first_row = groups[g].last_row = 0
    if constants.can_bounce == 0:
        return 0
    for t in range(touching_count):
        if manifolds[touching[t]].restitution != 0.0:
            pair = pairs[touching[t]]
            groups[group_of_pair(bodies, group_of, colliders[pair.a].body, colliders[pair.b].body)].last_row += 1
    count = 0
    for g in range(groups.shape[0]):
        groups[g].first_row = count
        count += groups[g].last_row
        groups[g].last_row = groups[g].first_row
    for t in range(touching_count):
        slot = touching[t]
        pair = pairs[slot]
        manifold = manifolds[slot]
        if manifold.restitution == 0.0:
            continue
        a = colliders[pair.a].body
        b = colliders[pair.b].body
        group = groups[group_of_pair(bodies, group_of, a, b)]
        a = a if bodies[a].held != 0 else bodies.shape[0]
        b = b if bodies[b].held != 0 else bodies.shape[0]
        r = group.last_row
        prepare_row(rows[r], row_points, r * POINTS, slot, manifold, a, b, solver_bodies, drives, constants)
        group.last_row += 1
    return count
