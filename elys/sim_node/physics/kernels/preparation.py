"""From manifolds to the solver's rows: levers, effective masses and the impulses to start with."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.manifold import turned_since
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.tables import POINTS


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
def prepare_points(row, row_points, first, manifold, points, source, body_a, body_b, constants):
    """The contact points of a row; returns the centre at which friction acts: where the surfaces really touch.

    The centre is given from both centres of mass. `first` and `source` are the places of the first point in the two tables.
    """
    n = row.normal
    nx, ny, nz = n[0], n[1], n[2]
    opened = 0.0
    for d in range(3):
        opened += (body_b.position[d] - body_a.position[d] - manifold.made_offset[d]) * n[d]
    ax, ay, az = turned_since(manifold.made_rotation_a, body_a.rotation)
    bx, by, bz = turned_since(manifold.made_rotation_b, body_b.rotation)
    mass = body_a.inverse_mass + body_b.inverse_mass
    cx = cy = cz = dx = dy = dz = weights = 0.0
    for k in range(row.point_count):
        point = points[source + k]
        out = row_points[first + k]
        arm = out.arm
        ra = point.anchor_a
        rb = point.anchor_b
        response = mass
        for side in range(2):
            r = ra if side == 0 else rb
            inertia = body_a.world_inverse_inertia if side == 0 else body_b.world_inverse_inertia
            response += write_arm(arm, out.turn, 3 * side, inertia, r[0], r[1], r[2], nx, ny, nz)
        gap = point.made_separation + opened
        gap += bx * arm[3] + by * arm[4] + bz * arm[5] - ax * arm[0] - ay * arm[1] - az * arm[2]
        out.separation = gap
        out.effective_mass = inverse_or_zero(response)
        out.impulse = point.normal_impulse
        out.step_impulse = 0.0
        weight = min(max(1.0 - 4.0 * gap / constants.margin, 0.01), 1.0)
        weights += weight
        cx += weight * ra[0]
        cy += weight * ra[1]
        cz += weight * ra[2]
        dx += weight * rb[0]
        dy += weight * rb[1]
        dz += weight * rb[2]
    scale = 1.0 / weights
    cx *= scale
    cy *= scale
    cz *= scale
    for k in range(row.point_count):
        ra = points[source + k].anchor_a
        x, y, z = ra[0] - cx, ra[1] - cy, ra[2] - cz
        row_points[first + k].lever = math.sqrt(x * x + y * y + z * z)
    return cx, cy, cz, dx * scale, dy * scale, dz * scale


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
def prepare_friction(row, manifold, body_a, body_b, cx, cy, cz, dx, dy, dz):
    """Friction of a row at one centre: a 2 x 2 block in the tangent plane and a twist about the normal."""
    n = row.normal
    t = row.tangent
    write_tangents(t, n)
    arm = row.friction_arm
    turn = row.friction_turn
    ia = body_a.world_inverse_inertia
    ib = body_b.world_inverse_inertia
    mass = row.friction_mass
    for direction in range(2):
        at = 3 * direction
        x, y, z = t[at], t[at + 1], t[at + 2]
        response = body_a.inverse_mass + body_b.inverse_mass
        response += write_arm(arm, turn, 2 * at, ia, cx, cy, cz, x, y, z)
        response += write_arm(arm, turn, 2 * at + 3, ib, dx, dy, dz, x, y, z)
        mass[2 * direction] = response
    k11 = mass[0]
    k22 = mass[2]
    k12 = 0.0
    for c in range(6):
        k12 += arm[c] * turn[6 + c]
    inverse = inverse_or_zero(k11 * k22 - k12 * k12)
    mass[0], mass[1], mass[2] = k22 * inverse, -k12 * inverse, k11 * inverse
    twist = row.twist_turn
    response = 0.0
    for side in range(2):
        inertia = ib if side == 1 else ia
        at = 3 * side
        twist[at] = inertia[0] * n[0] + inertia[3] * n[1] + inertia[4] * n[2]
        twist[at + 1] = inertia[3] * n[0] + inertia[1] * n[1] + inertia[5] * n[2]
        twist[at + 2] = inertia[4] * n[0] + inertia[5] * n[1] + inertia[2] * n[2]
        response += twist[at] * n[0] + twist[at + 1] * n[1] + twist[at + 2] * n[2]
    row.twist_mass = inverse_or_zero(response)
    old = manifold.friction_impulse
    new = row.friction_impulse
    new[0] = old[0] * t[0] + old[1] * t[1] + old[2] * t[2]
    new[1] = old[0] * t[3] + old[1] * t[4] + old[2] * t[5]
    new[2] = manifold.twist_impulse


@inner
def prepare_material(row, a, b, body_a, body_b, constants):
    """How two surfaces rub, bounce and give way: geometric mean of friction, smaller restitution."""
    row.friction = math.sqrt(a.friction * b.friction)
    row.restitution = min(a.restitution, b.restitution)
    ga = body_a.gravity_scale if body_a.inverse_mass > 0.0 else 0.0
    gb = body_b.gravity_scale if body_b.inverse_mass > 0.0 else 0.0
    g = constants.gravity
    row.closing = (ga - gb) * (g[0] * row.normal[0] + g[1] * row.normal[1] + g[2] * row.normal[2])
    both = body_a.inverse_mass > 0.0 and body_b.inverse_mass > 0.0
    softness = constants.soft if both else constants.firm
    row.push_rate = softness[0]
    row.mass_scale = softness[1]
    row.impulse_scale = softness[2]


@kernel
def prepare_contacts(bodies, colliders, pairs, touching, row_count, manifolds, points, rows, row_points, all_constants):
    """Fills the first `row_count` rows, each with its points, from the touching pairs."""
    constants = all_constants[0]
    for r in range(row_count):
        pair = pairs[touching[r]]
        a = colliders[pair.a]
        b = colliders[pair.b]
        manifold = manifolds[pair.slot]
        row = rows[r]
        row.slot = pair.slot
        row.body_a = a.body
        row.body_b = b.body
        row.point_count = manifold.point_count
        for d in range(3):
            row.normal[d] = manifold.normal[d]
        body_a = bodies[a.body]
        body_b = bodies[b.body]
        prepare_material(row, a, b, body_a, body_b, constants)
        cx, cy, cz, dx, dy, dz = prepare_points(
            row, row_points, r * POINTS, manifold, points, pair.slot * POINTS, body_a, body_b, constants
        )
        prepare_friction(row, manifold, body_a, body_b, cx, cy, cz, dx, dy, dz)
