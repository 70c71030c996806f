"""What a step has left, in numbers: energy, momentum, overlap, errors of joints and what the solver did not get done.

Only reads. Sums are in double precision and in the order of rows, so that the same state gives the same numbers.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inlined, inner, kernel
from elys.sim_node.physics.kernels.quads import axes_of, next_axes, quad, quad_at
from elys.sim_node.physics.kernels.rotation import cross, multiplied, rotated
from elys.sim_node.physics.kernels.tables import BALL, CONE, DISTANCE, DYNAMIC, FIXED, HINGE, SLIDER
from elys.sim_node.physics.kernels.trigonometry import arc_tangent


@inner
def attraction_energy(x, y, z, constants):
    """Energy for each kilogram in the fields of what attracts: 0 far from it [J/kg]."""
    potential = 0.0
    for k in range(constants.attractor_count):
        at = 5 * k
        dx = x - constants.attractors[at]
        dy = y - constants.attractors[at + 1]
        dz = z - constants.attractors[at + 2]
        squared = dx * dx + dy * dy + dz * dz + constants.attractors[at + 4]
        if squared > 0.0:
            potential -= constants.attractors[at + 3] / math.sqrt(squared)
    return potential


@inlined
def crossed(a, b):
    """Of two vectors, each in the first three of four numbers."""
    return next_axes(a * next_axes(b) - next_axes(a) * b)


@inlined
def turned(axis, w, v):
    """A vector turned by the quaternion (axis, w): v + w t + axis x t with t = 2 axis x v."""
    t = crossed(axis, v)
    t = t + t
    return v + quad(w, w, w) * t + crossed(axis, t)


@inner
def measure_bodies(bodies, masses, inertia, listed, count, is_listed, measures, constants):
    """Adds up energy and momentum of dynamic bodies, and counts those that are awake: three axes at a time."""
    none = quad(0.0, 0.0, 0.0)
    work = weighed = momentum = angular = none  # twice the kinetic energy; weights times places
    awake = 0
    for index in range(count):
        i = listed[index] if is_listed else index
        body = bodies[i]
        if body.motion != DYNAMIC:
            continue
        awake += 1 if body.asleep == 0 else 0
        mass = masses[i]
        weight = mass * body.gravity_scale
        p = quad_at(body.position, 0)
        v = quad_at(body.velocity, 0)
        w = quad_at(body.velocity, 3)
        ix, iy, iz = inertia[i, 0], inertia[i, 1], inertia[i, 2]
        spin = quad(mass, mass, mass) * quad(ix, iy, iz)
        if ix == iy and ix == iz:
            spin = spin * w
        else:
            axis = quad_at(body.rotation, 0)
            real = body.rotation[3]
            spin = turned(axis, real, spin * turned(axis, -real, w))
        push = quad(mass, mass, mass) * v
        weighed = weighed + quad(weight, weight, weight) * p
        momentum = momentum + push
        angular = angular + (crossed(p, push) + spin)
        work = work + (push * v + spin * w)
    g = constants.gravity
    x, y, z = axes_of(work)
    measures.kinetic = 0.5 * (x + y + z)
    x, y, z = axes_of(weighed)
    measures.potential = -(g[0] * x + g[1] * y + g[2] * z)
    measures.momentum_x, measures.momentum_y, measures.momentum_z = axes_of(momentum)
    measures.angular_x, measures.angular_y, measures.angular_z = axes_of(angular)
    measures.awake_count = awake


@inner
def measure_attraction(bodies, masses, listed, count, is_listed, measures, constants):
    """Adds the energy that dynamic bodies have in the fields of what attracts."""
    total = 0.0
    for index in range(count):
        i = listed[index] if is_listed else index
        body = bodies[i]
        if body.motion == DYNAMIC:
            p = body.position
            total += masses[i] * body.gravity_scale * attraction_energy(p[0], p[1], p[2], constants)
    measures.potential += total


@inner
def count_islands(bodies, listed, count, is_listed, parent, measures):
    islands = 0
    for index in range(count):
        i = listed[index] if is_listed else index
        body = bodies[i]
        if body.motion == DYNAMIC and body.asleep == 0 and parent[i] == i:
            islands += 1
    measures.island_count = islands


@inner
def write_approach(first, second, manifold, out):
    """Writes how fast the surfaces come nearer: at the centres of mass, and how much more for each metre from them (3,), twice.

    At r from the centre, n . (w x r) = r . (n x w).
    """
    n = manifold.normal
    nx, ny, nz = float(n[0]), float(n[1]), float(n[2])
    v = first.velocity
    w = second.velocity
    out[1], out[2], out[3] = cross(nx, ny, nz, v[3], v[4], v[5])
    out[4], out[5], out[6] = cross(nx, ny, nz, w[3], w[4], w[5])
    out[0] = nx * (v[0] - w[0]) + ny * (v[1] - w[1]) + nz * (v[2] - w[2])


@inlined
def approach_at(rates, r, at):
    """How fast the surfaces come nearer at the anchors that stand in r from `at` on [m/s]."""
    of_a = rates[1] * r[at] + rates[2] * r[at + 1] + rates[3] * r[at + 2]
    return rates[0] + of_a - (rates[4] * r[at + 3] + rates[5] * r[at + 4] + rates[6] * r[at + 5])


@inner
def clear_glance(glance):
    glance.deepest_overlap = glance.residual = 0.0
    glance.deepest_a = glance.deepest_b = glance.restless_a = glance.restless_b = 0


@inner
def measure_contacts(bodies, colliders, pairs, touching, begin, end, manifolds, rates, glance):
    """Notes the deepest overlap, and the fastest approach that the solver left, where they are worse among touching[begin:end].

    A contact shall let its surfaces come no nearer than to touch: where they overlap by d after a substep h, and approach at
    u, then of u the part min(u, d / h) should not be.
    """
    deepest = glance.deepest_overlap
    worst = glance.residual
    for t in range(begin, end):
        pair = pairs[touching[t]]
        manifold = manifolds[touching[t]]
        depth = 0.0
        for k in range(manifold.point_count):
            depth = max(depth, -float(manifold.separation[k]))
        a = bodies[colliders[pair.a].body]
        b = bodies[colliders[pair.b].body]
        if depth > deepest:
            deepest = depth
            glance.deepest_a, glance.deepest_b = a.entity, b.entity
        h = float(manifold.impulse_time)
        if h == 0.0 or depth <= worst * h:
            continue
        write_approach(a, b, manifold, rates)
        for k in range(manifold.point_count):
            left = min(approach_at(rates, manifold.anchors, 6 * k), -float(manifold.separation[k]) / h)
            if left > worst:
                worst = left
                glance.restless_a, glance.restless_b = a.entity, b.entity
    glance.deepest_overlap = deepest
    glance.residual = worst


@inner
def write_worst(glances, measures):
    """Writes the worst of both glances."""
    glance = glances[0] if glances[0].deepest_overlap >= glances[1].deepest_overlap else glances[1]
    measures.deepest_overlap = glance.deepest_overlap
    measures.deepest_a, measures.deepest_b = glance.deepest_a, glance.deepest_b
    glance = glances[0] if glances[0].residual >= glances[1].residual else glances[1]
    measures.residual = glance.residual
    measures.restless_a, measures.restless_b = glance.restless_a, glance.restless_b


@inner
def write_end(bodies, joint, side, out):
    """Writes where the anchor (3,) and the frame (4,) of one side of a joint are in the world."""
    p = joint.local_anchor
    q = joint.local_rotation
    at = 3 * side
    turn = 4 * side
    row = joint.body[side]
    if row < 0:
        for k in range(3):
            out[7 * side + k] = p[at + k]
        for k in range(4):
            out[7 * side + 3 + k] = q[turn + k]
        return
    body = bodies[row]
    r = body.rotation
    x, y, z = rotated(r[0], r[1], r[2], r[3], p[at], p[at + 1], p[at + 2])
    o = body.position
    out[7 * side], out[7 * side + 1], out[7 * side + 2] = o[0] + x, o[1] + y, o[2] + z
    x, y, z, w = multiplied(r[0], r[1], r[2], r[3], q[turn], q[turn + 1], q[turn + 2], q[turn + 3])
    out[7 * side + 3], out[7 * side + 4], out[7 * side + 5], out[7 * side + 6] = x, y, z, w


@inner
def distance_error(joint, ends):
    """How far a joint's anchors are from where they are held [m]."""
    dx, dy, dz = ends[7] - ends[0], ends[8] - ends[1], ends[9] - ends[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if joint.kind == DISTANCE:
        return max(joint.lower - length, length - joint.upper, 0.0)
    if joint.kind == SLIDER:  # free along the first axis of a
        ax, ay, az = rotated(ends[3], ends[4], ends[5], ends[6], 1.0, 0.0, 0.0)
        x, y, z = cross(ax, ay, az, dx, dy, dz)
        return math.sqrt(x * x + y * y + z * z)
    return length


@inner
def angle_error(joint, ends):
    """How far a joint's frames are turned from where they are held [rad]."""
    if joint.kind == FIXED or joint.kind == SLIDER:
        x, y, z, w = multiplied(-ends[3], -ends[4], -ends[5], ends[6], ends[10], ends[11], ends[12], ends[13])
        return 2.0 * arc_tangent(math.sqrt(x * x + y * y + z * z), abs(w))
    if joint.kind == HINGE:
        ax, ay, az = rotated(ends[3], ends[4], ends[5], ends[6], 1.0, 0.0, 0.0)
        bx, by, bz = rotated(ends[10], ends[11], ends[12], ends[13], 1.0, 0.0, 0.0)
        x, y, z = cross(ax, ay, az, bx, by, bz)
        return arc_tangent(math.sqrt(x * x + y * y + z * z), ax * bx + ay * by + az * bz)
    return 0.0


@inner
def is_awake(bodies, joint):
    awake = False
    for side in range(2):
        row = joint.body[side]
        awake = awake or (row >= 0 and bodies[row].motion == DYNAMIC and bodies[row].asleep == 0)
    return awake


@kernel
def measure_joints(bodies, joints, ends, all_measures):
    """Finds the joints (J,) that hold an awake body and are farthest off; `ends` (14,) is for work."""
    measures = all_measures[0]
    distance = angle = 0.0
    measures.joint = measures.turned_joint = 0
    for j in range(joints.shape[0]):
        joint = joints[j]
        kind = joint.kind
        holds = kind in (FIXED, BALL, HINGE, SLIDER, DISTANCE, CONE)
        if not holds or joint.broken != 0 or not is_awake(bodies, joint):
            continue
        write_end(bodies, joint, 0, ends)
        write_end(bodies, joint, 1, ends)
        error = distance_error(joint, ends)
        if error > distance:
            distance = error
            measures.joint = joint.id
        error = angle_error(joint, ends)
        if error > angle:
            angle = error
            measures.turned_joint = joint.id
    measures.joint_error = distance
    measures.joint_angle_error = angle


@kernel
def measure_step(
    bodies,
    masses,
    inertia,
    listed,
    listed_count,
    is_listed,
    parent,
    has_new_islands,
    colliders,
    pairs,
    touching,
    touching_count,
    begin,
    end,
    manifolds,
    room,
    glances,
    all_measures,
    all_constants,
):
    """Measures what a step has left of bodies and contacts, into the one row of `all_measures`.

    Parameters:

    - masses (N,) [kg], inertia (N, 3) for 1 kg [m^2];
    - listed (N,) int32: rows of bodies, of which the first `listed_count` are summed; without `is_listed` so many rows from
      the first on are;
    - parent (N,) int32 as `build_islands` left it: with `has_new_islands` they are counted, else their number stays;
    - pairs touching[begin:end] of `touching_count` are looked at. The worst is told of those and of what glances (2,) hold: of
      the round that is going on, which begins with `begin` 0, and of the one before;
    - room (7,) is for work.
    """
    measures, constants = all_measures[0], all_constants[0]
    measure_bodies(bodies, masses, inertia, listed, listed_count, is_listed, measures, constants)
    if constants.attractor_count > 0:
        measure_attraction(bodies, masses, listed, listed_count, is_listed, measures, constants)
    if has_new_islands:
        count_islands(bodies, listed, listed_count, is_listed, parent, measures)
    if begin == 0:
        glances[1] = glances[0]
        clear_glance(glances[0])
    if end - begin == touching_count:
        clear_glance(glances[1])
    measure_contacts(bodies, colliders, pairs, touching, begin, end, manifolds, room, glances[0])
    write_worst(glances, measures)


@kernel
def sleeping_potential(bodies, masses, all_constants):
    """The potential energy of all dynamic bodies that sleep [J]; at rest they have no other, and no momentum."""
    constants = all_constants[0]
    total = 0.0
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if body.motion == DYNAMIC and body.asleep != 0:
            p, g = body.position, constants.gravity
            potential = attraction_energy(p[0], p[1], p[2], constants) - (g[0] * p[0] + g[1] * p[1] + g[2] * p[2])
            total += masses[i] * body.gravity_scale * potential
    return total
