"""Bounces, each at its own time.

A contact that bounces is not left to the soft solver. Within the substep of length h, gap s, approach speed u and closing
acceleration a, it touches at t = 2 s / (u + sqrt(u^2 + 2 a s)) with the speed u + a t, and leaves with e times that. The
impulse acts from t on: its displacement is weighted with h - t, by shifting the bodies back by t times the change of
velocity. A ball then bounces to the right height whatever the step.

Points of one manifold bounce together (generalised reflection, Smith et al., "Reflections on Simultaneous Impact", 2012):
first the impulses that just stop them all, then 1 + e times these. Manifolds follow one another until none approaches, so
that a row of balls hands the blow on.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.batch import WEDGE
from elys.sim_node.physics.kernels.tables import POINTS

SWEEPS = 24  # over all manifolds: how far a blow is handed on within a substep
POINT_SWEEPS = 40  # over the points of one manifold: converges like 0.5^n for a box on its face


@inner
def along(va, vb, n, arm):
    """How fast a point opens, for velocities; how far it has opened, for displacements."""
    total = 0.0
    for c in range(3):
        total += (vb[c] - va[c]) * n[c] + vb[3 + c] * arm[3 + c] - va[3 + c] * arm[c]
    return total


@inner
def response_along(body, drive, u, at, v, to):
    """u M v with a body's inverse mass, where `u[at]` and `v[to]` begin three numbers; nothing along a locked axis."""
    locked = int(drive.locked)
    if locked == 0:  # the directions are of unit length, and perpendicular
        return body.inverse_mass * (1.0 if at == to else 0.0)
    total = 0.0
    for c in range(3):
        if not locked >> c & 1:
            total += u[at + c] * v[to + c]
    if at == to and total < WEDGE:
        return body.inverse_mass * 0.0
    return body.inverse_mass * total


@inner
def find_bounces(a, b, drive_a, drive_b, row, row_points, first, h, bounce_speed):
    """Writes when each point of a row hits within this substep; returns how many do.

    What was struck already counts as if it had flown with its present velocity since the substep began: from where that
    would have been, `impact_shift` away. So a blow that is handed on comes no earlier than it was received.
    """
    closing = row.closing
    n = row.normal
    hits = 0
    for k in range(first, first + row.point_count):
        point = row_points[k]
        point.bounce = 0.0
        point.bounce_time = -1.0
        u = -along(a.velocity, b.velocity, n, point.arm)
        if u <= bounce_speed:
            continue
        gap = point.separation + along(a.displacement, b.displacement, n, point.arm)
        gap = max(gap + along(drive_a.impact_shift, drive_b.impact_shift, n, point.arm), 0.0)
        squared = u * u + 2.0 * closing * gap
        if squared < 0.0:
            continue
        time = 2.0 * gap / (u + math.sqrt(squared))
        # What would fall back within the same substep rests instead, and is left to the solver.
        if time < h and row.restitution * (u + closing * time) > closing * (h - time):
            point.bounce_time = time
            hits += 1
    return hits


@inner
def compress(a, b, drive_a, drive_b, row, row_points, first):
    """Writes the impulses that together just stop the hitting points of a row."""
    n = row.normal
    mass = response_along(a, drive_a, n, 0, n, 0) + response_along(b, drive_b, n, 0, n, 0)
    speed = 0.0
    ax = ay = az = bx = by = bz = 0.0
    for _ in range(POINT_SWEEPS):
        most = 0.0
        for k in range(first, first + row.point_count):
            point = row_points[k]
            if point.bounce_time < 0.0:
                continue
            arm = point.arm
            turn = point.turn
            opening = along(a.velocity, b.velocity, n, arm) - row.closing * point.bounce_time + speed
            opening += bx * arm[3] + by * arm[4] + bz * arm[5] - ax * arm[0] - ay * arm[1] - az * arm[2]
            new = max(point.bounce - point.effective_mass * opening, 0.0)
            change = new - point.bounce
            point.bounce = new
            most = max(most, abs(change * mass))
            speed += change * mass
            ax -= change * turn[0]
            ay -= change * turn[1]
            az -= change * turn[2]
            bx += change * turn[3]
            by += change * turn[4]
            bz += change * turn[5]
        if most < 1e-12:
            break


@inner
def strike(a, b, drive_a, drive_b, impulse, directions, at, turns, turns_at, time):
    """Changes both velocities as if an impulse had acted at a time within the substep.

    The impulse on b points along `directions[at]`, the change of angular velocity of a and b by a unit of it stands at
    `turns[turns_at]`, three numbers each.
    """
    for side in range(2):
        body = a if side == 0 else b
        drive = drive_a if side == 0 else drive_b
        push = -impulse if side == 0 else impulse
        linear = push * body.inverse_mass
        locked = int(drive.locked)
        for c in range(3):
            change = 0.0 if locked >> c & 1 else linear * directions[at + c]
            body.velocity[c] += change
            drive.free_velocity[c] += change
            drive.impact_shift[c] -= time * change
            change = push * turns[turns_at + 3 * side + c]
            body.velocity[3 + c] += change
            drive.free_velocity[3 + c] += change
            drive.impact_shift[3 + c] -= time * change


@inner
def rub(a, b, drive_a, drive_b, row, most, time):
    """Friction during a bounce: stops sliding as far as the cone of the bounce's own normal impulse allows."""
    va = a.velocity
    vb = b.velocity
    t = row.tangent
    arm = row.friction_arm
    slip1 = slip2 = 0.0
    for c in range(3):
        linear = vb[c] - va[c]
        slip1 += linear * t[c] + vb[3 + c] * arm[3 + c] - va[3 + c] * arm[c]
        slip2 += linear * t[3 + c] + vb[3 + c] * arm[9 + c] - va[3 + c] * arm[6 + c]
    mass = row.friction_mass
    f1 = -(mass[0] * slip1 + mass[1] * slip2)
    f2 = -(mass[1] * slip1 + mass[2] * slip2)
    squared = f1 * f1 + f2 * f2
    if squared > most * most:
        scale = most / math.sqrt(squared)
        f1 *= scale
        f2 *= scale
    for direction in range(2):
        impulse = f1 if direction == 0 else f2
        strike(a, b, drive_a, drive_b, impulse, t, 3 * direction, row.friction_turn, 6 * direction, time)


@inner
def rebound(a, b, drive_a, drive_b, row, row_points, first):
    """Applies 1 + e times the compression impulses, and the friction that goes with them."""
    load = 0.0
    moment = 0.0
    for k in range(first, first + row.point_count):
        point = row_points[k]
        impulse = (1.0 + row.restitution) * point.bounce
        if impulse == 0.0:
            continue
        load += impulse
        moment += impulse * point.bounce_time
        point.step_impulse += impulse
        strike(a, b, drive_a, drive_b, impulse, row.normal, 0, point.turn, 0, point.bounce_time)
    if load > 0.0 and row.friction > 0.0:
        rub(a, b, drive_a, drive_b, row, row.friction * load, moment / load)


@inner
def bounce_contacts(solver_bodies, drives, rows, row_points, first, last, h, bounce_speed):
    """All bounces of one substep of length h in rows [first, last), before its velocities are integrated.

    What was struck is put where it would have begun to arrive where it does with its new velocity: so the solver, which takes
    every velocity for that of the whole substep, finds the gaps that are left at its end.
    """
    hand_on_bounces(solver_bodies, drives, rows, row_points, first, last, h, bounce_speed)
    for r in range(first, last):
        for side in range(2):
            i = rows[r].body_a if side == 0 else rows[r].body_b
            if solver_bodies[i].inverse_mass == 0.0:  # nothing strikes it, and other threads read it
                continue
            shift = drives[i].impact_shift
            for c in range(6):
                solver_bodies[i].displacement[c] += shift[c]
                shift[c] = 0.0


@inner
def hand_on_bounces(solver_bodies, drives, rows, row_points, first, last, h, bounce_speed):
    """Sweeps over the rows until none approaches."""
    for _ in range(SWEEPS):
        quiet = True
        for r in range(first, last):
            row = rows[r]
            a = solver_bodies[row.body_a]
            b = solver_bodies[row.body_b]
            drive_a = drives[row.body_a]
            drive_b = drives[row.body_b]
            if find_bounces(a, b, drive_a, drive_b, row, row_points, r * POINTS, h, bounce_speed) > 0:
                quiet = False
                compress(a, b, drive_a, drive_b, row, row_points, r * POINTS)
                rebound(a, b, drive_a, drive_b, row, row_points, r * POINTS)
        if quiet:
            return
