"""One pass over a batch of contacts: eight manifolds' normal impulses, then friction within the cone of their sum."""

from __future__ import annotations

from elys.sim_node.compilation import inlined, inner
from elys.sim_node.physics.kernels.batch import (
    ARM,
    AXIS_MASS,
    BODY_FLOATS,
    COUPLING,
    FLOATS,
    FRICTION,
    FRICTION_IMPULSE,
    FRICTION_MASS,
    GAP,
    IMPULSE,
    IMPULSES_AT,
    INERTIA_A,
    INERTIA_B,
    LEAD,
    LEVER,
    MANIFOLD_FLOATS,
    MASS,
    PLACE,
    POINT,
    POINT_SIZE,
    RESULTS_AT,
    ROLLING,
    ROLLING_AT,
    ROLLING_IMPULSE,
    ROLLING_MASS,
    STEP_IMPULSE,
    TWIST_MASS,
    along_tangents,
    dotted,
    friction_torque,
    into_frame,
    load3,
    load_frame,
    out_of_frame,
    store3,
    turned,
)
from elys.sim_node.physics.kernels.simd import (
    bits_of,
    gather_rows,
    larger,
    load,
    scatter_rows,
    smaller,
    splat,
    square_root,
    store,
    where,
)

# A gap that was closed exactly is 0 give or take rounding, and rounding must not choose between hard and soft [m].
TOUCHING = 1e-6
# Nor must an impulse that is nothing but rounding count as a contact that pushes [m/s].
FELT = 1e-6
# A manifold whose points together change speeds by more than this in one pass [m/s] takes a blow, or lets go of one.
BLOW = 0.1


@inlined
def push(batches, body_a, body_b, batch, solver, can_lock, frame, a, b, px, py, pz, turn_a, turn_b, struck):
    """Writes back the velocities of both sides after an impulse p on b, the opposite on a, and turns given in the frame."""
    ma = a[6]
    mb = b[6]
    x, y, z = out_of_frame(frame, turn_a[0], turn_a[1], turn_a[2])
    u, v, w = out_of_frame(frame, turn_b[0], turn_b[1], turn_b[2])
    ax, ay, az = ma * px, ma * py, ma * pz
    bx, by, bz = mb * px, mb * py, mb * pz
    if can_lock:
        at = batch * FLOATS + 8 * AXIS_MASS
        fx, fy, fz = load3(batches, at)
        gx, gy, gz = load3(batches, at + 24)
        ax, ay, az = fx * px, fy * py, fz * pz
        bx, by, bz = gx * px, gy * py, gz * pz
    va = (a[0] - ax, a[1] - ay, a[2] - az, a[3] - x, a[4] - y, a[5] - z, ma, larger(a[7], struck))
    vb = (b[0] + bx, b[1] + by, b[2] + bz, b[3] + u, b[4] + v, b[5] + w, mb, larger(b[7], struck))
    scatter_rows(solver, body_a, batch * 8, BODY_FLOATS, 0, va)
    scatter_rows(solver, body_b, batch * 8, BODY_FLOATS, 0, vb)


@inlined
def warm_start(batches, body_a, body_b, batch, count, solver, constants):
    """Begins the step with the impulses of the last one."""
    o = batch * FLOATS
    a = gather_rows(solver, body_a, batch * 8, BODY_FLOATS, 0)
    b = gather_rows(solver, body_b, batch * 8, BODY_FLOATS, 0)
    frame = load_frame(batches, o)
    f1, f2, twist = load3(batches, o + 8 * FRICTION_IMPULSE)
    total = along1 = along2 = splat(0.0)
    for k in range(count):
        at = o + 8 * (POINT + POINT_SIZE * k)
        impulse = load(batches, at + 8 * IMPULSE)
        total = total + impulse
        along1 = along1 + impulse * load(batches, at + 8 * PLACE)
        along2 = along2 + impulse * load(batches, at + 8 * (PLACE + 1))
    r1 = r2 = splat(0.0)
    if constants.can_roll != 0:
        r1 = load(batches, o + 8 * ROLLING_IMPULSE)
        r2 = load(batches, o + 8 * (ROLLING_IMPULSE + 1))
    arm_a = load3(batches, o + 8 * ARM)
    arm_b = load3(batches, o + 8 * (ARM + 3))
    fa = friction_torque(arm_a, f1, f2, twist)
    fb = friction_torque(arm_b, f1, f2, twist)
    ta = (arm_a[1] * total + along2 + r1, r2 - (arm_a[0] * total + along1))
    tb = (arm_b[1] * total + along2 + r1, r2 - (arm_b[0] * total + along1))
    turn_a = turned(batches, o + 8 * INERTIA_A, ta[0] + fa[0], ta[1] + fa[1], fa[2])
    turn_b = turned(batches, o + 8 * INERTIA_B, tb[0] + fb[0], tb[1] + fb[1], fb[2])
    px, py, pz = out_of_frame(frame, f1, f2, total)
    lock = constants.can_lock != 0
    push(batches, body_a, body_b, batch, solver, lock, frame, a, b, px, py, pz, turn_a, turn_b, splat(0.0))


@inner
def turned_by_normals(batches, at, arm, total, along1, along2):
    """The turn, in the frame, that normal impulses give: their sum and the sums of their moments about the tangents."""
    xx, yy = load(batches, at), load(batches, at + 8)
    xy, xz, yz = load3(batches, at + 24)
    x = arm[1] * total + along2
    y = -(arm[0] * total + along1)
    return xx * x + xy * y, xy * x + yy * y, xz * x + yz * y


@inner
def coupled(batches, o, k, c0, c1, c2):
    """The opening speed that point k has got from the changes of the impulses of the points before it."""
    at = o + 8 * COUPLING
    if k == 1:
        return load(batches, at) * c0
    if k == 2:
        return load(batches, at + 8) * c0 + load(batches, at + 24) * c1
    return load(batches, at + 16) * c0 + load(batches, at + 32) * c1 + load(batches, at + 40) * c2


@inner
def resist_rolling(batches, o, load_sum, roll1, roll2):
    """Changes a manifold's rolling impulse towards no relative turn about the tangents; returns its change about both.

    The impulse stays within the rolling friction, an arm, times the sum of the normal impulses.
    """
    m11, m12, m22 = load3(batches, o + 8 * ROLLING_MASS)
    at = o + 8 * ROLLING_IMPULSE
    old1, old2 = load(batches, at), load(batches, at + 8)
    r1 = old1 - (m11 * roll1 + m12 * roll2)
    r2 = old2 - (m12 * roll1 + m22 * roll2)
    most = load(batches, o + 8 * ROLLING) * load_sum
    squared = r1 * r1 + r2 * r2
    scale = where(squared > most * most, most / square_root(squared), splat(1.0))
    r1 = r1 * scale
    r2 = r2 * scale
    store(batches, at, r1)
    store(batches, at + 8, r2)
    return r1 - old1, r2 - old2


@inner
def opening(arm_a, arm_b, turn_a, turn_b):
    """How fast two turns, given about the tangents, open the gap at the centre of friction."""
    return arm_b[1] * turn_b[0] - arm_b[0] * turn_b[1] - (arm_a[1] * turn_a[0] - arm_a[0] * turn_a[1])


@inner
def carried_speed(frame, a, b, da, db, wa, wb, ahead):
    """What a platform's speed along the tangents, where the other body is after a time, differs from that where the step began.

    A rider would leave along the tangent else. A whole substep ahead when its velocities are sought: half of it because what
    counts is the chord, half for what `take_back` does to the change.
    """
    zero = splat(0.0)
    h = splat(ahead)
    t, s, n = into_frame(
        frame,
        (db[0] - da[0]) + h * (b[0] - a[0]),
        (db[1] - da[1]) + h * (b[1] - a[1]),
        (db[2] - da[2]) + h * (b[2] - a[2]),
    )
    x = where(a[6] > zero, zero, wa[0]) + where(b[6] > zero, zero, wb[0])
    y = where(a[6] > zero, zero, wa[1]) + where(b[6] > zero, zero, wb[1])
    z = where(a[6] > zero, zero, wa[2]) + where(b[6] > zero, zero, wb[2])
    return y * n - z * s, z * t - x * n


@inlined
def solve_batch(batches, body_a, body_b, batch, count, solver, strength, constants, biased, last, again, carries):
    """One pass over a batch: normal impulses, then friction within the cone of their sum.

    With `biased` overlap is pushed out softly, else only approach is stopped. `last` when no other pass follows in this
    substep: its impulses are what acted. `again` when the pass before was over the same batch. `carries` when anything that
    nothing can push turns. Returns whether anything in the batch took a blow.
    """
    zero = splat(0.0)
    one = splat(1.0)
    o = batch * FLOATS
    lanes = batch * 8
    a = gather_rows(solver, body_a, lanes, BODY_FLOATS, 0)
    b = gather_rows(solver, body_b, lanes, BODY_FLOATS, 0)
    da = gather_rows(solver, body_a, lanes, BODY_FLOATS, 8)
    db = gather_rows(solver, body_b, lanes, BODY_FLOATS, 8)
    frame = load_frame(batches, o)
    nx, ny, nz = frame[6], frame[7], frame[8]
    if biased:
        both = a[6] * b[6] > zero
        soft = strength.soft
        firm = strength.firm
        rate = where(both, splat(soft[0]), splat(firm[0]))
        share = where(both, splat(soft[1]), splat(firm[1]))
        leak = where(both, splat(soft[2]), splat(firm[2]))
        least = splat(-1.0)
    else:
        rate = zero
        share = one
        leak = zero
        least = splat(FELT)
    slowest = splat(-strength.push_speed)
    inverse_h = splat(1.0 / strength.substep)
    lead = load(batches, o + 8 * LEAD)
    arm_a = load3(batches, o + 8 * ARM)
    arm_b = load3(batches, o + 8 * (ARM + 3))
    wa = into_frame(frame, a[3], a[4], a[5])
    wb = into_frame(frame, b[3], b[4], b[5])
    leant_a = along_tangents(frame, da[3], da[4], da[5])
    leant_b = along_tangents(frame, db[3], db[4], db[5])
    rx, ry, rz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    speed = dotted(rx, ry, rz, nx, ny, nz) + opening(arm_a, arm_b, wa, wb)
    apart = dotted(db[0] - da[0], db[1] - da[1], db[2] - da[2], nx, ny, nz) + opening(arm_a, arm_b, leant_a, leant_b)
    tilt1, tilt2 = wb[0] - wa[0], wb[1] - wa[1]
    leant1, leant2 = leant_b[0] - leant_a[0], leant_b[1] - leant_a[1]
    carried1 = carried2 = zero
    if carries:
        ahead = strength.substep if biased else 0.0
        carried1, carried2 = carried_speed(frame, a, b, da, db, wa, wb, ahead)
    total = load_sum = turning = struck = along1 = along2 = zero
    c0 = c1 = c2 = zero
    for k in range(count):
        at = o + 8 * (POINT + POINT_SIZE * k)
        u, v = load(batches, at + 8 * PLACE), load(batches, at + 8 * (PLACE + 1))
        mass = load(batches, at + 8 * MASS)
        old = load(batches, at + 8 * IMPULSE)
        gap = load(batches, at + 8 * GAP) + apart + (v * leant1 - u * leant2)
        closing = speed + (v * tilt1 - u * tilt2)
        if k > 0:
            closing = closing + coupled(batches, o, k, c0, c1, c2)
        is_open = gap > splat(TOUCHING)
        wanted = where(is_open, gap * inverse_h + lead, larger(rate * gap, slowest))
        new = old - mass * where(is_open, one, share) * (closing + wanted) - where(is_open, zero, leak) * old
        # What is about to touch is left to the next substep: the relaxation begins no contact.
        new = where(old <= mass * least, zero, larger(new, zero))
        store(batches, at + 8 * IMPULSE, new)
        felt = mass * splat(FELT)
        struck = where((old <= felt) & (new > felt), one, struck)
        change = new - old
        if k == 0:
            c0 = change
        elif k == 1:
            c1 = change
        elif k == 2:
            c2 = change
        if last:
            place = at + 8 * STEP_IMPULSE
            store(batches, place, load(batches, place) + (change if again else new))
        total = total + change
        load_sum = load_sum + new
        turning = turning + new * load(batches, at + 8 * LEVER)
        along1 = along1 + change * u
        along2 = along2 + change * v
    turn_a = turned_by_normals(batches, o + 8 * INERTIA_A, arm_a, total, along1, along2)
    turn_b = turned_by_normals(batches, o + 8 * INERTIA_B, arm_b, total, along1, along2)
    hold = zero
    # The normal impulses' own change of the linear velocities is perpendicular to both tangents.
    if constants.can_lock != 0:  # or not: where an axis is locked
        fx, fy, fz = load3(batches, o + 8 * AXIS_MASS)
        gx, gy, gz = load3(batches, o + 8 * (AXIS_MASS + 3))
        rx, ry, rz = rx + total * nx * (fx + gx), ry + total * ny * (fy + gy), rz + total * nz * (fz + gz)
    if constants.can_roll != 0:
        hold = load(batches, o + 8 * (ROLLING + 1)) * load_sum
        roll1 = (wb[0] + turn_b[0]) - (wa[0] - turn_a[0])
        roll2 = (wb[1] + turn_b[1]) - (wa[1] - turn_a[1])
        q1, q2 = resist_rolling(batches, o, load_sum, roll1, roll2)
        x, y, z = turned(batches, o + 8 * INERTIA_A, q1, q2, zero)
        turn_a = (turn_a[0] + x, turn_a[1] + y, turn_a[2] + z)
        x, y, z = turned(batches, o + 8 * INERTIA_B, q1, q2, zero)
        turn_b = (turn_b[0] + x, turn_b[1] + y, turn_b[2] + z)
    wa = (wa[0] - turn_a[0], wa[1] - turn_a[1], wa[2] - turn_a[2])
    wb = (wb[0] + turn_b[0], wb[1] + turn_b[1], wb[2] + turn_b[2])
    slip1, slip2 = along_tangents(frame, rx, ry, rz)
    slip1, slip2 = slip1 - carried1, slip2 - carried2
    slip1 = slip1 + (arm_b[2] * wb[1] - arm_b[1] * wb[2]) - (arm_a[2] * wa[1] - arm_a[1] * wa[2])
    slip2 = slip2 + (arm_b[0] * wb[2] - arm_b[2] * wb[0]) - (arm_a[0] * wa[2] - arm_a[2] * wa[0])
    old1, old2, old3 = load3(batches, o + 8 * FRICTION_IMPULSE)
    m11, m12, m22 = load3(batches, o + 8 * FRICTION_MASS)
    friction = load(batches, o + 8 * FRICTION)
    f1 = old1 - (m11 * slip1 + m12 * slip2)
    f2 = old2 - (m12 * slip1 + m22 * slip2)
    most = friction * load_sum
    squared = f1 * f1 + f2 * f2
    scale = where(squared > most * most, most / square_root(squared), one)
    f1 = f1 * scale
    f2 = f2 * scale
    hold = hold + friction * turning
    f3 = larger(smaller(old3 - load(batches, o + 8 * TWIST_MASS) * (wb[2] - wa[2]), hold), -hold)
    store3(batches, o + 8 * FRICTION_IMPULSE, f1, f2, f3)
    d1, d2, d3 = f1 - old1, f2 - old2, f3 - old3
    px, py, pz = out_of_frame(frame, d1, d2, total)
    ta = friction_torque(arm_a, d1, d2, d3)
    tb = friction_torque(arm_b, d1, d2, d3)
    x, y, z = turned(batches, o + 8 * INERTIA_A, ta[0], ta[1], ta[2])
    turn_a = (turn_a[0] + x, turn_a[1] + y, turn_a[2] + z)
    x, y, z = turned(batches, o + 8 * INERTIA_B, tb[0], tb[1], tb[2])
    turn_b = (turn_b[0] + x, turn_b[1] + y, turn_b[2] + z)
    lock = constants.can_lock != 0
    blow = splat(BLOW) * load(batches, o + 8 * (POINT + MASS))
    struck = where(total > blow, one, struck)
    push(batches, body_a, body_b, batch, solver, lock, frame, a, b, px, py, pz, turn_a, turn_b, struck)
    return bits_of(larger(total, -total) > blow) != 0


@inlined
def store_impulses(batches, body_a, body_b, slots, batch, count, solver, manifolds, can_roll):
    """Keeps impulses and gaps of a batch for the next step, friction as a world vector: the tangents may be others then."""
    o = batch * FLOATS
    lanes = batch * 8
    zero = splat(0.0)
    frame = load_frame(batches, o)
    f1, f2, twist = load3(batches, o + 8 * FRICTION_IMPULSE)
    da = gather_rows(solver, body_a, lanes, BODY_FLOATS, 8)
    db = gather_rows(solver, body_b, lanes, BODY_FLOATS, 8)
    leant_a = along_tangents(frame, da[3], da[4], da[5])
    leant_b = along_tangents(frame, db[3], db[4], db[5])
    arm_a = load3(batches, o + 8 * ARM)
    arm_b = load3(batches, o + 8 * (ARM + 3))
    apart = dotted(db[0] - da[0], db[1] - da[1], db[2] - da[2], frame[6], frame[7], frame[8])
    apart = apart + opening(arm_a, arm_b, leant_a, leant_b)
    leant1, leant2 = leant_b[0] - leant_a[0], leant_b[1] - leant_a[1]
    i0 = i1 = i2 = i3 = zero
    g0 = g1 = g2 = g3 = zero
    s0 = s1 = s2 = s3 = zero
    for k in range(count):
        at = o + 8 * (POINT + POINT_SIZE * k)
        u, v = load(batches, at + 8 * PLACE), load(batches, at + 8 * (PLACE + 1))
        gap = load(batches, at + 8 * GAP) + apart + (v * leant1 - u * leant2)
        impulse = load(batches, at + 8 * IMPULSE)
        step_impulse = load(batches, at + 8 * STEP_IMPULSE)
        if k == 0:
            i0, g0, s0 = impulse, gap, step_impulse
        elif k == 1:
            i1, g1, s1 = impulse, gap, step_impulse
        elif k == 2:
            i2, g2, s2 = impulse, gap, step_impulse
        else:
            i3, g3, s3 = impulse, gap, step_impulse
    fx, fy, fz = out_of_frame(frame, f1, f2, zero)
    scatter_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, IMPULSES_AT, (i0, i1, i2, i3, fx, fy, fz, twist))
    scatter_rows(manifolds, slots, lanes, MANIFOLD_FLOATS, RESULTS_AT, (g0, g1, g2, g3, s0, s1, s2, s3))
    if can_roll:
        r1 = load(batches, o + 8 * ROLLING_IMPULSE)
        r2 = load(batches, o + 8 * (ROLLING_IMPULSE + 1))
        rolling, spin = load(batches, o + 8 * ROLLING), load(batches, o + 8 * (ROLLING + 1))
        rx, ry, rz = out_of_frame(frame, r1, r2, zero)
        scatter_rows(
            manifolds, slots, lanes, MANIFOLD_FLOATS, ROLLING_AT, (rx, ry, rz, rolling, spin, zero, zero, zero)
        )
