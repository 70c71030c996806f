"""Batches: eight manifolds side by side, as the contact solver wants them.

A batch is a block of `VECTORS` vectors of eight float32, a lane for each manifold. The names below are places of vectors in
it. All of one colour are independent of each other: no body that can move is in two of their manifolds. What is empty in a
lane is zero, and so are its masses, so that it does nothing.

Everything is expressed in the frame of the contact: two tangents and the normal. There a point is two numbers, its place in
the tangent plane, for both bodies alike, and needs no cross product; with the response of each point to the others' impulses
the bodies' velocities are touched twice a manifold, not twice a point.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.simd import LANES, gather_rows, larger, load, splat, square_root, store, where
from elys.sim_node.physics.kernels.tables import MANIFOLD, POINTS, SOLVER_BODY, SOLVER_DRIVE, float_place

NORMAL = 0  # 3
TANGENT = 3  # 3, the first; the second is normal x tangent
ARM = 6  # 6: from the centre of mass to the centre of friction along tangent, second tangent and normal, on a and on b
FRICTION_MASS = 12  # 3: inverse of the 2 x 2 effective inverse mass, 11 12 22
TWIST_MASS = 15
FRICTION = 16
FRICTION_IMPULSE = 17  # 3: along both tangents, about the normal
LEAD = 20  # what `take_back` will do to the gap, as a speed: only where restitution waits for the exact gap
INERTIA_A = 21  # 6: inverse inertia about tangent, second tangent and normal: 11 22 33 12 13 23
INERTIA_B = 27  # 6
COUPLING = 33  # 6: response of points 01 02 03 12 13 23 to each other
POINT = 39  # four times POINT_SIZE
POINT_SIZE = 7
# Used only where some body has a locked axis, or some collider resists rolling: others never look there.
AXIS_MASS = POINT + POINTS * POINT_SIZE  # 6: inverse mass along x y z, of a and of b
ROLLING = AXIS_MASS + 6  # 2: arms of the normal force that resist rolling, and turning about the normal
ROLLING_MASS = ROLLING + 2  # 3: inverse of the 2 x 2 effective inverse inertia about the tangents, 11 12 22
ROLLING_IMPULSE = ROLLING_MASS + 3  # 2: about both tangents
VECTORS = ROLLING_IMPULSE + 2
FLOATS = VECTORS * LANES

# Of a point:
PLACE = 0  # 2: along both tangents, from the centre of friction
MASS = 2  # effective mass
LEVER = 3  # distance from the centre of friction
GAP = 4  # as the step began
IMPULSE = 5  # of the substep
STEP_IMPULSE = 6

WEDGE = 1e-3  # share of a body's inverse mass below which a normal counts as locked

BODY_FLOATS = SOLVER_BODY.itemsize // 4
DRIVE_FLOATS = SOLVER_DRIVE.itemsize // 4
INERTIA_AT = float_place(SOLVER_DRIVE, "inverse_inertia")
MANIFOLD_FLOATS = MANIFOLD.itemsize // 4
MADE_AT = float_place(MANIFOLD, "made_separation")
ANCHORS_AT = float_place(MANIFOLD, "anchors")
TURNS_AT = float_place(MANIFOLD, "turn_a")
IMPULSES_AT = float_place(MANIFOLD, "normal_impulse")
ROLLING_AT = float_place(MANIFOLD, "rolling_impulse")
RESULTS_AT = float_place(MANIFOLD, "separation")


@inner
def crossed(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inner
def dotted(ax, ay, az, bx, by, bz):
    return ax * bx + ay * by + az * bz


@inner
def load3(batches, at):
    return load(batches, at), load(batches, at + 8), load(batches, at + 16)


@inner
def store3(batches, at, x, y, z):
    store(batches, at, x)
    store(batches, at + 8, y)
    store(batches, at + 16, z)


@inner
def turned(inertia, at, x, y, z):
    """The product of a symmetric matrix that stands at a place with a vector."""
    xx, yy, zz = load3(inertia, at)
    xy, xz, yz = load3(inertia, at + 24)
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inner
def load_frame(batches, o):
    """A manifold's frame: both tangents, then the normal."""
    nx, ny, nz = load3(batches, o + 8 * NORMAL)
    tx, ty, tz = load3(batches, o + 8 * TANGENT)
    sx, sy, sz = crossed(nx, ny, nz, tx, ty, tz)
    return tx, ty, tz, sx, sy, sz, nx, ny, nz


@inner
def along_tangents(frame, x, y, z):
    """A world vector's parts along the tangents of a frame."""
    return dotted(x, y, z, frame[0], frame[1], frame[2]), dotted(x, y, z, frame[3], frame[4], frame[5])


@inner
def into_frame(frame, x, y, z):
    """A world vector's parts along the axes of a frame."""
    t, s = along_tangents(frame, x, y, z)
    return t, s, dotted(x, y, z, frame[6], frame[7], frame[8])


@inner
def out_of_frame(frame, t, s, n):
    """The world vector with these parts along the axes of a frame."""
    return (
        t * frame[0] + s * frame[3] + n * frame[6],
        t * frame[1] + s * frame[4] + n * frame[7],
        t * frame[2] + s * frame[5] + n * frame[8],
    )


@inner
def inverse_or_zero(value):
    zero = splat(0.0)
    return where(value > zero, splat(1.0) / value, zero)


@inner
def write_frame(batches, o, nx, ny, nz):
    """The normal and a first tangent, which changes smoothly with it except in one place."""
    zero = splat(0.0)
    steep = larger(nx, -nx) > splat(0.57735)
    h = where(steep, nx, nz)
    squared = h * h + ny * ny
    scale = where(squared > zero, splat(1.0) / square_root(squared), zero)
    tx = where(steep, ny * scale, zero)
    ty = where(steep, -nx * scale, nz * scale)
    tz = where(steep, zero, -ny * scale)
    store3(batches, o + 8 * NORMAL, nx, ny, nz)
    store3(batches, o + 8 * TANGENT, tx, ty, tz)


@inner
def write_gaps(batches, o, count, live, slots, lanes, manifolds, margin):
    """Gaps of all points; returns the centre of friction, from both centres of mass: where the surfaces touch."""
    zero = splat(0.0)
    one = splat(1.0)
    made = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, MADE_AT)
    turns = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, TURNS_AT)
    nx, ny, nz = load3(batches, o + 8 * NORMAL)
    opened = dotted(made[4], made[5], made[6], nx, ny, nz)
    # The turn of an arm moves its end along the normal by turn . (arm x normal) = arm . (normal x turn).
    ax, ay, az = crossed(nx, ny, nz, turns[0], turns[1], turns[2])
    bx, by, bz = crossed(nx, ny, nz, turns[3], turns[4], turns[5])
    steep = splat(-4.0 / margin)
    cax = cay = caz = cbx = cby = cbz = weights = zero
    for k in range(count):
        anchors = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, ANCHORS_AT + 6 * k)
        is_live = live > splat(k)
        made_gap = made[0] if k == 0 else (made[1] if k == 1 else (made[2] if k == 2 else made[3]))
        gap = made_gap + opened + dotted(anchors[3], anchors[4], anchors[5], bx, by, bz)
        gap = gap - dotted(anchors[0], anchors[1], anchors[2], ax, ay, az)
        store(batches, o + 8 * (POINT + POINT_SIZE * k + GAP), where(is_live, gap, zero))
        weight = one + steep * gap
        weight = where(weight > one, one, where(weight < splat(0.01), splat(0.01), weight))
        weight = where(is_live, weight, zero)
        weights = weights + weight
        cax = cax + weight * anchors[0]
        cay = cay + weight * anchors[1]
        caz = caz + weight * anchors[2]
        cbx = cbx + weight * anchors[3]
        cby = cby + weight * anchors[4]
        cbz = cbz + weight * anchors[5]
    scale = inverse_or_zero(weights)
    return cax * scale, cay * scale, caz * scale, cbx * scale, cby * scale, cbz * scale


@inner
def write_places(batches, o, count, live, slots, lanes, manifolds, cax, cay, caz, cbx, cby, cbz):
    """Where the points lie in the tangent plane. Seen from either body that is the same: points of both lie on one normal.

    The body whose arms are shorter tells it more exactly.
    """
    frame = load_frame(batches, o)
    arm_a = into_frame(frame, cax, cay, caz)
    arm_b = into_frame(frame, cbx, cby, cbz)
    store3(batches, o + 8 * ARM, arm_a[0], arm_a[1], arm_a[2])
    store3(batches, o + 8 * (ARM + 3), arm_b[0], arm_b[1], arm_b[2])
    zero = splat(0.0)
    by_b = dotted(cbx, cby, cbz, cbx, cby, cbz) < dotted(cax, cay, caz, cax, cay, caz)
    for k in range(count):
        anchors = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, ANCHORS_AT + 6 * k)
        x = where(by_b, anchors[3] - cbx, anchors[0] - cax)
        y = where(by_b, anchors[4] - cby, anchors[1] - cay)
        z = where(by_b, anchors[5] - cbz, anchors[2] - caz)
        u, v = along_tangents(frame, x, y, z)
        is_live = live > splat(k)
        u = where(is_live, u, zero)
        v = where(is_live, v, zero)
        at = o + 8 * (POINT + POINT_SIZE * k)
        store(batches, at + 8 * PLACE, u)
        store(batches, at + 8 * (PLACE + 1), v)
        store(batches, at + 8 * LEVER, square_root(u * u + v * v))
        store(batches, at + 8 * STEP_IMPULSE, zero)


@inner
def carry_arms(batches, o, frame, shift, mass_a, mass_b):
    """Moves the arm on what nothing can push, such as a turning platform, as the other body moved since the points were made."""
    zero = splat(0.0)
    along = along_tangents(frame, shift[4], shift[5], shift[6])
    for side in range(2):
        carried = where((mass_a if side == 0 else mass_b) > zero, zero, splat(1.0 if side == 0 else -1.0))
        at = o + 8 * (ARM + 3 * side)
        store(batches, at, load(batches, at) + carried * along[0])
        store(batches, at + 8, load(batches, at + 8) + carried * along[1])


@inner
def write_inertia(batches, o, frame, xx, yy, zz, xy, xz, yz):
    """Stores a symmetric matrix given in world axes as it is in a frame."""
    ax, ay, az = frame[0], frame[1], frame[2]
    bx, by, bz = frame[3], frame[4], frame[5]
    cx, cy, cz = frame[6], frame[7], frame[8]
    x, y, z = xx * ax + xy * ay + xz * az, xy * ax + yy * ay + yz * az, xz * ax + yz * ay + zz * az
    store(batches, o, dotted(x, y, z, ax, ay, az))
    store(batches, o + 24, dotted(x, y, z, bx, by, bz))
    store(batches, o + 32, dotted(x, y, z, cx, cy, cz))
    x, y, z = xx * bx + xy * by + xz * bz, xy * bx + yy * by + yz * bz, xz * bx + yz * by + zz * bz
    store(batches, o + 8, dotted(x, y, z, bx, by, bz))
    store(batches, o + 40, dotted(x, y, z, cx, cy, cz))
    x, y, z = xx * cx + xy * cy + xz * cz, xy * cx + yy * cy + yz * cz, xz * cx + yz * cy + zz * cz
    store(batches, o + 16, dotted(x, y, z, cx, cy, cz))


@inner
def load_block(batches, at):
    """The part of a matrix that is about the tangents: 11 12 22."""
    return load(batches, at), load(batches, at + 24), load(batches, at + 8)


@inner
def write_responses(batches, o, count, live, mass):
    """How each point answers to an impulse at itself and at the others."""
    zero = splat(0.0)
    arm_a = load3(batches, o + 8 * ARM)
    arm_b = load3(batches, o + 8 * (ARM + 3))
    a11, a12, a22 = load_block(batches, o + 8 * INERTIA_A)
    b11, b12, b22 = load_block(batches, o + 8 * INERTIA_B)
    coupling = 0
    for k in range(POINTS):
        if k >= count:
            break
        # arm x normal has the parts (v, -u) about the tangents
        at = o + 8 * (POINT + POINT_SIZE * k)
        u, v = load(batches, at), load(batches, at + 8)
        ua, va, ub, vb = arm_a[0] + u, arm_a[1] + v, arm_b[0] + u, arm_b[1] + v
        a1, a2 = a11 * va - a12 * ua, a12 * va - a22 * ua
        b1, b2 = b11 * vb - b12 * ub, b12 * vb - b22 * ub
        own = mass + (a1 * va - a2 * ua) + (b1 * vb - b2 * ub)
        store(batches, at + 8 * MASS, where(live > splat(k), inverse_or_zero(own), zero))
        for other in range(k + 1, POINTS):
            if other < count:
                to = o + 8 * (POINT + POINT_SIZE * other)
                u, v = load(batches, to), load(batches, to + 8)
                response = mass + (a1 * (arm_a[1] + v) - a2 * (arm_a[0] + u))
                response = response + (b1 * (arm_b[1] + v) - b2 * (arm_b[0] + u))
                store(batches, o + 8 * (COUPLING + coupling), response)
            coupling += 1


@inner
def write_axis_masses(batches, o, mass_a, mass_b, locked_a, locked_b):
    """Inverse masses along the axes of the world, 0 where a translation is locked."""
    zero = splat(0.0)
    for side in range(2):
        mass = mass_a if side == 0 else mass_b
        left = locked_a if side == 0 else locked_b
        for axis in range(2, -1, -1):
            bit = splat(float(1 << axis))
            is_locked = left >= bit
            store(batches, o + 8 * (AXIS_MASS + 3 * side + axis), where(is_locked, zero, mass))
            left = where(is_locked, left - bit, left)


@inner
def response_along(batches, o, side, ux, uy, uz, vx, vy, vz):
    """u M v with the inverse masses along the axes of one body."""
    x, y, z = load3(batches, o + 8 * (AXIS_MASS + 3 * side))
    return dotted(x * ux, y * uy, z * uz, vx, vy, vz)


@inner
def normal_response(batches, o, side, mass, nx, ny, nz):
    """n M n of one body; nothing where n is all but locked: a wedge so thin would shoot away sideways."""
    response = response_along(batches, o, side, nx, ny, nz, nx, ny, nz)
    return where(response > splat(WEDGE) * mass, response, splat(0.0))


@inner
def write_inverse(batches, at, k11, k12, k22):
    """Stores the inverse of a symmetric 2 x 2 block as 11, 12, 22.

    Locked axes can leave but one direction that gives way: then the pseudo-inverse of a matrix of rank one.
    """
    product = k11 * k22
    determinant = product - k12 * k12
    trace = k11 + k22
    single = inverse_or_zero(trace * trace)
    is_regular = (determinant > splat(1e-6) * product) & (determinant > splat(1e-30))
    inverse = inverse_or_zero(determinant)
    store3(
        batches,
        at,
        where(is_regular, k22 * inverse, k11 * single),
        where(is_regular, -k12 * inverse, k12 * single),
        where(is_regular, k11 * inverse, k22 * single),
    )


@inner
def write_rolling(batches, o, scale, slots, lanes, manifolds):
    """Resistance against rolling: a 2 x 2 block about both tangents, and last step's impulses, which are kept in world axes."""
    kept = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, ROLLING_AT)
    frame = load_frame(batches, o)
    store(batches, o + 8 * ROLLING, kept[3])
    store(batches, o + 8 * (ROLLING + 1), kept[4])
    first, second = along_tangents(frame, kept[0], kept[1], kept[2])
    store(batches, o + 8 * ROLLING_IMPULSE, first * scale)
    store(batches, o + 8 * (ROLLING_IMPULSE + 1), second * scale)
    a11, a12, a22 = load_block(batches, o + 8 * INERTIA_A)
    b11, b12, b22 = load_block(batches, o + 8 * INERTIA_B)
    write_inverse(batches, o + 8 * ROLLING_MASS, a11 + b11, a12 + b12, a22 + b22)


@inner
def friction_torque(arm, d1, d2, d3):
    """The torque of friction impulses along both tangents and about the normal, in their frame."""
    return -(arm[2] * d2), arm[2] * d1, arm[0] * d2 - arm[1] * d1 + d3


@inner
def write_friction(batches, o, along1, across, along2):
    """Friction at one centre: a 2 x 2 block in the tangent plane and a twist about the normal.

    How the masses alone respond is given: along the first tangent, across both, along the second.
    """
    zero = splat(0.0)
    one = splat(1.0)
    k11, k12, k22, twist = along1, across, along2, zero
    for side in range(2):
        arm = load3(batches, o + 8 * (ARM + 3 * side))
        at = o + 8 * (INERTIA_A + 6 * side)
        p = friction_torque(arm, one, zero, zero)
        q = friction_torque(arm, zero, one, zero)
        x, y, z = turned(batches, at, p[0], p[1], p[2])
        k11 = k11 + dotted(x, y, z, p[0], p[1], p[2])
        k12 = k12 + dotted(x, y, z, q[0], q[1], q[2])
        x, y, z = turned(batches, at, q[0], q[1], q[2])
        k22 = k22 + dotted(x, y, z, q[0], q[1], q[2])
        twist = twist + load(batches, at + 16)
    write_inverse(batches, o + 8 * FRICTION_MASS, k11, k12, k22)
    store(batches, o + 8 * TWIST_MASS, inverse_or_zero(twist))


@inner
def write_impulses(batches, o, count, live, scale, slots, lanes, manifolds):
    """Last step's impulses, of a substep as long as those to come; friction was kept as a vector in world axes."""
    kept = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, IMPULSES_AT)
    for k in range(count):
        impulse = kept[0] if k == 0 else (kept[1] if k == 1 else (kept[2] if k == 2 else kept[3]))
        at = o + 8 * (POINT + POINT_SIZE * k + IMPULSE)
        store(batches, at, where(live > splat(k), impulse * scale, splat(0.0)))
    first, second = along_tangents(load_frame(batches, o), kept[4] * scale, kept[5] * scale, kept[6] * scale)
    store3(batches, o + 8 * FRICTION_IMPULSE, first, second, kept[7] * scale)


@inner
def write_batch(batches, batch, count, body_a, body_b, slots, solver, drive, manifolds, constants, substep):
    """Fills one batch from its manifolds and bodies; `solver`, `drive` and `manifolds` are flat float32 views."""
    o = batch * FLOATS
    lanes = batch * 8
    head = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, 0)
    live = head[5]
    ia = gather_rows(drive, body_a, lanes, DRIVE_FLOATS, INERTIA_AT)
    ib = gather_rows(drive, body_b, lanes, DRIVE_FLOATS, INERTIA_AT)
    va = gather_rows(solver, body_a, lanes, BODY_FLOATS, 0)
    vb = gather_rows(solver, body_b, lanes, BODY_FLOATS, 0)
    mass = va[6] + vb[6]
    write_frame(batches, o, head[0], head[1], head[2])
    store(batches, o + 8 * FRICTION, head[3])
    frame = load_frame(batches, o)
    write_inertia(batches, o + 8 * INERTIA_A, frame, ia[0], ia[1], ia[2], ia[3], ia[4], ia[5])
    write_inertia(batches, o + 8 * INERTIA_B, frame, ib[0], ib[1], ib[2], ib[3], ib[4], ib[5])
    g = constants.gravity
    along = dotted(splat(g[0]), splat(g[1]), splat(g[2]), head[0], head[1], head[2])
    closing = (ia[6] - ib[6]) * along
    zero = splat(0.0)
    lead = where(head[4] > zero, splat(0.5 * substep) * larger(closing, zero), zero)
    store(batches, o + 8 * LEAD, lead)
    cax, cay, caz, cbx, cby, cbz = write_gaps(batches, o, count, live, slots, lanes, manifolds, constants.margin)
    write_places(batches, o, count, live, slots, lanes, manifolds, cax, cay, caz, cbx, cby, cbz)
    shift = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, MADE_AT)
    carry_arms(batches, o, frame, shift, va[6], vb[6])
    along1 = along2 = mass
    across = zero
    if constants.can_lock != 0:
        write_axis_masses(batches, o, va[6], vb[6], ia[7], ib[7])
        tx, ty, tz, sx, sy, sz, nx, ny, nz = frame
        mass = normal_response(batches, o, 0, va[6], nx, ny, nz) + normal_response(batches, o, 1, vb[6], nx, ny, nz)
        along1 = across = along2 = zero
        for side in range(2):
            along1 = along1 + response_along(batches, o, side, tx, ty, tz, tx, ty, tz)
            across = across + response_along(batches, o, side, tx, ty, tz, sx, sy, sz)
            along2 = along2 + response_along(batches, o, side, sx, sy, sz, sx, sy, sz)
    write_responses(batches, o, count, live, mass)
    write_friction(batches, o, along1, across, along2)
    # An impulse belongs to a length of time: where substeps have become shorter or longer it is another one.
    scale = where(head[6] > zero, splat(substep) / head[6], splat(1.0))
    write_impulses(batches, o, count, live, scale, slots, lanes, manifolds)
    if constants.can_roll != 0:
        write_rolling(batches, o, scale, slots, lanes, manifolds)
