"""Batches: eight manifolds side by side, as the contact solver wants them.

A batch is a block of `VECTORS` vectors of eight float32, a lane for each manifold. The names below are places of vectors in
it. All of one colour are independent of each other: no body that can move is in two of their manifolds. What is empty in a
lane is zero, and so are its masses, so that it does nothing.

Everything is expressed in contact space: with the levers r x n and the response of each point to the others' impulses the
solver needs no cross product and touches the bodies' velocities twice a manifold, not twice a point.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.simd import LANES, gather_rows, larger, load, splat, square_root, store, where
from elys.sim_node.physics.kernels.tables import MANIFOLD, POINTS, SOLVER_BODY, SOLVER_DRIVE, float_place

NORMAL = 0  # 3
TANGENT = 3  # 3, the first; the second is normal x tangent
FRICTION_ARM = 6  # 12: r x tangent at the centre of friction, on a and b for the first, on a and b for the second
FRICTION_MASS = 18  # 3: inverse of the 2 x 2 effective inverse mass, 11 12 22
TWIST_MASS = 21
FRICTION = 22
FRICTION_IMPULSE = 23  # 3: along both tangents, about the normal
LEVER = 26  # 4: distance of each point from the centre of friction
INERTIA_A = 30  # 6: inverse inertia xx yy zz xy xz yz
INERTIA_B = 36  # 6
MASS = 42  # 4: effective mass of each point
COUPLING = 46  # 6: response of points 01 02 03 12 13 23 to each other
LEAD = 52  # what `take_back` will do to the gap, as a speed: only where restitution waits for the exact gap
STEP_IMPULSE = 53  # 4
POINT = 57  # four times POINT_SIZE: r x n on a (3), on b (3), gap as the step began, impulse
POINT_SIZE = 8
# Used only where some body has a locked axis, or some collider resists rolling: others never look there.
AXIS_MASS = POINT + POINTS * POINT_SIZE  # 6: inverse mass along x y z, of a and of b
ROLLING = AXIS_MASS + 6  # 2: arms of the normal force that resist rolling, and turning about the normal
ROLLING_MASS = ROLLING + 2  # 3: inverse of the 2 x 2 effective inverse inertia about the tangents, 11 12 22
ROLLING_IMPULSE = ROLLING_MASS + 3  # 2: about both tangents
VECTORS = ROLLING_IMPULSE + 2
FLOATS = VECTORS * LANES

GAP = 6
IMPULSE = 7

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
def write_points(batches, o, count, live, slots, lanes, manifolds, margin):
    """Levers and gaps of all points; returns the centre of friction, from both centres of mass: where the surfaces touch."""
    zero = splat(0.0)
    one = splat(1.0)
    made = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, MADE_AT)
    turns = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, TURNS_AT)
    impulses = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, IMPULSES_AT)
    nx, ny, nz = load3(batches, o + 8 * NORMAL)
    opened = dotted(made[4], made[5], made[6], nx, ny, nz)
    steep = splat(-4.0 / margin)
    cax = cay = caz = cbx = cby = cbz = weights = zero
    for k in range(POINTS):
        at = o + 8 * (POINT + POINT_SIZE * k)
        store(batches, o + 8 * (STEP_IMPULSE + k), zero)
        if k >= count:
            for vector in range(POINT_SIZE):
                store(batches, at + 8 * vector, zero)
            continue
        anchors = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, ANCHORS_AT + 6 * k)
        is_live = live > splat(k)
        ax, ay, az = crossed(anchors[0], anchors[1], anchors[2], nx, ny, nz)
        bx, by, bz = crossed(anchors[3], anchors[4], anchors[5], nx, ny, nz)
        made_gap = made[0] if k == 0 else (made[1] if k == 1 else (made[2] if k == 2 else made[3]))
        impulse = impulses[0] if k == 0 else (impulses[1] if k == 1 else (impulses[2] if k == 2 else impulses[3]))
        gap = made_gap + opened + dotted(turns[3], turns[4], turns[5], bx, by, bz)
        gap = gap - dotted(turns[0], turns[1], turns[2], ax, ay, az)
        store3(batches, at, where(is_live, ax, zero), where(is_live, ay, zero), where(is_live, az, zero))
        store3(batches, at + 24, where(is_live, bx, zero), where(is_live, by, zero), where(is_live, bz, zero))
        store(batches, at + 8 * GAP, where(is_live, gap, zero))
        store(batches, at + 8 * IMPULSE, where(is_live, impulse, zero))
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
    cax, cay, caz = cax * scale, cay * scale, caz * scale
    for k in range(count):
        anchors = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, ANCHORS_AT + 6 * k)
        x, y, z = anchors[0] - cax, anchors[1] - cay, anchors[2] - caz
        store(batches, o + 8 * (LEVER + k), square_root(dotted(x, y, z, x, y, z)))
    return cax, cay, caz, cbx * scale, cby * scale, cbz * scale


@inner
def write_responses(batches, o, count, live, mass):
    """How each point answers to an impulse at itself and at the others."""
    zero = splat(0.0)
    for k in range(POINTS):
        store(batches, o + 8 * (MASS + k), zero)
    coupling = 0
    for k in range(POINTS):
        if k >= count:
            break
        at = o + 8 * (POINT + POINT_SIZE * k)
        ax, ay, az = load3(batches, at)
        bx, by, bz = load3(batches, at + 24)
        x, y, z = turned(batches, o + 8 * INERTIA_A, ax, ay, az)
        u, v, w = turned(batches, o + 8 * INERTIA_B, bx, by, bz)
        own = mass + dotted(x, y, z, ax, ay, az) + dotted(u, v, w, bx, by, bz)
        store(batches, o + 8 * (MASS + k), where(live > splat(k), inverse_or_zero(own), zero))
        for other in range(k + 1, POINTS):
            if other < count:
                to = o + 8 * (POINT + POINT_SIZE * other)
                ax, ay, az = load3(batches, to)
                bx, by, bz = load3(batches, to + 24)
                response = mass + dotted(x, y, z, ax, ay, az) + dotted(u, v, w, bx, by, bz)
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
def response_along(batches, o, ux, uy, uz, vx, vy, vz):
    """u M v with the inverse masses along the axes, of both bodies together."""
    x, y, z = load3(batches, o + 8 * AXIS_MASS)
    u, v, w = load3(batches, o + 8 * (AXIS_MASS + 3))
    return dotted((x + u) * ux, (y + v) * uy, (z + w) * uz, vx, vy, vz)


@inner
def write_rolling(batches, o, scale, slots, lanes, manifolds):
    """Resistance against rolling: a 2 x 2 block about both tangents, and last step's impulses, which are kept in world axes."""
    kept = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, ROLLING_AT)
    nx, ny, nz = load3(batches, o + 8 * NORMAL)
    tx, ty, tz = load3(batches, o + 8 * TANGENT)
    sx, sy, sz = crossed(nx, ny, nz, tx, ty, tz)
    store(batches, o + 8 * ROLLING, kept[3])
    store(batches, o + 8 * (ROLLING + 1), kept[4])
    along = dotted(kept[0], kept[1], kept[2], tx, ty, tz) * scale
    store(batches, o + 8 * ROLLING_IMPULSE, along)
    store(batches, o + 8 * (ROLLING_IMPULSE + 1), dotted(kept[0], kept[1], kept[2], sx, sy, sz) * scale)
    x, y, z = turned(batches, o + 8 * INERTIA_A, tx, ty, tz)
    u, v, w = turned(batches, o + 8 * INERTIA_B, tx, ty, tz)
    k11 = dotted(x + u, y + v, z + w, tx, ty, tz)
    k12 = dotted(x + u, y + v, z + w, sx, sy, sz)
    x, y, z = turned(batches, o + 8 * INERTIA_A, sx, sy, sz)
    u, v, w = turned(batches, o + 8 * INERTIA_B, sx, sy, sz)
    k22 = dotted(x + u, y + v, z + w, sx, sy, sz)
    inverse = inverse_or_zero(k11 * k22 - k12 * k12)
    store3(batches, o + 8 * ROLLING_MASS, k22 * inverse, -k12 * inverse, k11 * inverse)


@inner
def write_friction(batches, o, along1, across, along2, cax, cay, caz, cbx, cby, cbz):
    """Friction at one centre: a 2 x 2 block in the tangent plane and a twist about the normal.

    How the masses alone respond is given: along the first tangent, across both, along the second.
    """
    nx, ny, nz = load3(batches, o + 8 * NORMAL)
    tx, ty, tz = load3(batches, o + 8 * TANGENT)
    sx, sy, sz = crossed(nx, ny, nz, tx, ty, tz)
    ax, ay, az = crossed(cax, cay, caz, tx, ty, tz)
    bx, by, bz = crossed(cbx, cby, cbz, tx, ty, tz)
    ex, ey, ez = crossed(cax, cay, caz, sx, sy, sz)
    fx, fy, fz = crossed(cbx, cby, cbz, sx, sy, sz)
    at = o + 8 * FRICTION_ARM
    store3(batches, at, ax, ay, az)
    store3(batches, at + 24, bx, by, bz)
    store3(batches, at + 48, ex, ey, ez)
    store3(batches, at + 72, fx, fy, fz)
    x, y, z = turned(batches, o + 8 * INERTIA_A, ax, ay, az)
    u, v, w = turned(batches, o + 8 * INERTIA_B, bx, by, bz)
    k11 = along1 + dotted(x, y, z, ax, ay, az) + dotted(u, v, w, bx, by, bz)
    k12 = across + dotted(x, y, z, ex, ey, ez) + dotted(u, v, w, fx, fy, fz)
    x, y, z = turned(batches, o + 8 * INERTIA_A, ex, ey, ez)
    u, v, w = turned(batches, o + 8 * INERTIA_B, fx, fy, fz)
    k22 = along2 + dotted(x, y, z, ex, ey, ez) + dotted(u, v, w, fx, fy, fz)
    inverse = inverse_or_zero(k11 * k22 - k12 * k12)
    store3(batches, o + 8 * FRICTION_MASS, k22 * inverse, -k12 * inverse, k11 * inverse)
    x, y, z = turned(batches, o + 8 * INERTIA_A, nx, ny, nz)
    u, v, w = turned(batches, o + 8 * INERTIA_B, nx, ny, nz)
    store(batches, o + 8 * TWIST_MASS, inverse_or_zero(dotted(x, y, z, nx, ny, nz) + dotted(u, v, w, nx, ny, nz)))


@inner
def write_impulses(batches, o, count, scale, slots, lanes, manifolds):
    """Last step's impulses, of a substep as long as those to come; friction was kept as a vector in world axes."""
    impulses = gather_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, IMPULSES_AT)
    for k in range(count):
        at = o + 8 * (POINT + POINT_SIZE * k + IMPULSE)
        store(batches, at, load(batches, at) * scale)
    nx, ny, nz = load3(batches, o + 8 * NORMAL)
    tx, ty, tz = load3(batches, o + 8 * TANGENT)
    sx, sy, sz = crossed(nx, ny, nz, tx, ty, tz)
    fx, fy, fz = impulses[4] * scale, impulses[5] * scale, impulses[6] * scale
    along = dotted(fx, fy, fz, tx, ty, tz)
    across = dotted(fx, fy, fz, sx, sy, sz)
    store3(batches, o + 8 * FRICTION_IMPULSE, along, across, impulses[7] * scale)


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
    store3(batches, o + 8 * INERTIA_A, ia[0], ia[1], ia[2])
    store3(batches, o + 8 * (INERTIA_A + 3), ia[3], ia[4], ia[5])
    store3(batches, o + 8 * INERTIA_B, ib[0], ib[1], ib[2])
    store3(batches, o + 8 * (INERTIA_B + 3), ib[3], ib[4], ib[5])
    g = constants.gravity
    along = dotted(splat(g[0]), splat(g[1]), splat(g[2]), head[0], head[1], head[2])
    closing = (ia[6] - ib[6]) * along
    zero = splat(0.0)
    lead = where(head[4] > zero, splat(0.5 * substep) * larger(closing, zero), zero)
    store(batches, o + 8 * LEAD, lead)
    cax, cay, caz, cbx, cby, cbz = write_points(batches, o, count, live, slots, lanes, manifolds, constants.margin)
    along1 = along2 = mass
    across = zero
    if constants.can_lock != 0:
        write_axis_masses(batches, o, va[6], vb[6], ia[7], ib[7])
        nx, ny, nz = head[0], head[1], head[2]
        tx, ty, tz = load3(batches, o + 8 * TANGENT)
        sx, sy, sz = crossed(nx, ny, nz, tx, ty, tz)
        mass = response_along(batches, o, nx, ny, nz, nx, ny, nz)
        along1 = response_along(batches, o, tx, ty, tz, tx, ty, tz)
        across = response_along(batches, o, tx, ty, tz, sx, sy, sz)
        along2 = response_along(batches, o, sx, sy, sz, sx, sy, sz)
    write_responses(batches, o, count, live, mass)
    write_friction(batches, o, along1, across, along2, cax, cay, caz, cbx, cby, cbz)
    # An impulse belongs to a length of time: where substeps have become shorter or longer it is another one.
    scale = where(head[6] > zero, splat(substep) / head[6], splat(1.0))
    write_impulses(batches, o, count, scale, slots, lanes, manifolds)
    if constants.can_roll != 0:
        write_rolling(batches, o, scale, slots, lanes, manifolds)
