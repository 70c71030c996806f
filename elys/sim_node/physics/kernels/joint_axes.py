"""What acts on the free coordinate of a joint: springs, motors, limits, cones and gears, with the locked rows held."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.joint_impulses import load_velocity, push_free, store_velocity
from elys.sim_node.physics.kernels.joint_rows import correction, row_rate
from elys.sim_node.physics.kernels.tables import AXIS, JOINT_ROWS, SWING

GEAR_SLIP = 0.01  # error of a gear from which on it pushes against what does not give way, as limits [m], [rad]
GEAR_LEAK = 0.01  # share of its impulse that it forgets each time then: so that it does not grow without end


@inner
def solve_spring(joint, rows, first, row, h):
    """A damped spring by the trapezoidal rule: loses no energy but to its damper, whatever the step."""
    half = h * (0.25 * h * joint.stiffness + 0.5 * joint.spring_friction)
    rate = row_rate(joint, row) + row.lead
    stretch = joint.spring_start - joint.spring_rest
    change = -h * joint.stiffness * stretch - half * (row.start_rate + rate) - joint.spring_impulse
    change /= 1.0 + half / row.effective_mass
    most = joint.spring_limit * h
    new = min(max(joint.spring_impulse + change, -most), most)
    change = new - joint.spring_impulse
    joint.spring_impulse = new
    push_free(joint, rows, first, row, change)


@inner
def limit_impulse(old, mass, opening, start, gap, h, biased):
    """The accumulated impulse of a limit; `gap` [m] or [rad] is left, `opening` is its rate and `start` what that was.

    What the integrator will take back is given beforehand, so that a blow ends on the limit and not behind it.
    """
    if biased:
        lead = 0.5 * min(start, 0.0)
        room = gap / h if gap > 0.0 else correction(gap, h)  # a gap may be used up, but not more
        return max(old - mass * (opening + lead + room), 0.0)
    if old == 0.0 and gap > 0.0:
        return 0.0
    return max(old - mass * opening, 0.0)


@inner
def solve_limits(joint, rows, first, row, h, biased):
    """Keeps the coordinate between its limits, or on them where they are equal."""
    mass = row.effective_mass
    if joint.lower == joint.upper:
        rate = row_rate(joint, row) + row.lead
        if biased:
            rate += correction(joint.coordinate - joint.lower, h)
        joint.lower_impulse -= mass * rate
        push_free(joint, rows, first, row, -mass * rate)
        return abs(rate)
    most = 0.0
    gap = joint.coordinate - joint.lower
    if gap < math.inf:
        rate = row_rate(joint, row) + row.lead
        new = limit_impulse(joint.lower_impulse, mass, rate, row.start_rate, gap, h, biased)
        change = new - joint.lower_impulse
        joint.lower_impulse = new
        push_free(joint, rows, first, row, change)
        most = abs(change)
    gap = joint.upper - joint.coordinate
    if gap < math.inf:
        rate = row_rate(joint, row) + row.lead
        new = limit_impulse(joint.upper_impulse, mass, -rate, -row.start_rate, gap, h, biased)
        change = new - joint.upper_impulse
        joint.upper_impulse = new
        push_free(joint, rows, first, row, -change)
        most = max(most, abs(change))
    return most / mass


@inner
def solve_motor(joint, rows, first, row, h):
    rate = row_rate(joint, row) + row.lead - joint.motor_speed
    most = joint.motor_limit * h
    new = min(max(joint.motor_impulse - row.effective_mass * rate, -most), most)
    change = new - joint.motor_impulse
    joint.motor_impulse = new
    push_free(joint, rows, first, row, change)


@inner
def solve_free(joint, rows, first, h, biased):
    """Springs, motors and limits; returns the largest rate that was left."""
    row = rows[first + AXIS]
    most = 0.0
    if row.effective_mass > 0.0:
        if joint.spring_frequency > 0.0 and joint.stiffness >= 0.0:
            solve_spring(joint, rows, first, row, h)
        if joint.motor_limit > 0.0:
            solve_motor(joint, rows, first, row, h)
        most = solve_limits(joint, rows, first, row, h, biased)
    if joint.free > 1:
        row = rows[first + SWING]
        if row.effective_mass > 0.0:
            rate = row_rate(joint, row) + row.lead
            old = joint.swing_impulse
            gap = joint.swing_limit - joint.swing
            new = limit_impulse(old, row.effective_mass, -rate, -row.start_rate, gap, h, biased)
            joint.swing_impulse = new
            push_free(joint, rows, first, row, old - new)
            most = max(most, abs(new - old) / row.effective_mass)
    return most


@inner
def solve_gear(moving, joints, rows, gear, h, biased):
    """Couples two coordinates; returns the rate that was left."""
    j = gear.gear_row[0]
    k = gear.gear_row[1]
    one = joints[j]
    two = joints[k]
    first = rows[JOINT_ROWS * j + AXIS]
    second = rows[JOINT_ROWS * k + AXIS]
    load_velocity(moving, one)
    load_velocity(moving, two)
    ratio = gear.ratio
    rate = row_rate(one, first) + first.lead
    rate = ratio * rate - row_rate(two, second) - second.lead
    leak = 0.0
    if biased:
        error = ratio * one.coordinate - two.coordinate - gear.gear_offset
        rate += correction(error, h)
        leak = GEAR_LEAK * gear.impulse[0] if abs(error) > GEAR_SLIP else 0.0
    give = 0.0
    if first.effective_mass > 0.0:
        give += ratio * ratio / first.effective_mass
    if second.effective_mass > 0.0:
        give += 1.0 / second.effective_mass
    if give == 0.0:
        return 0.0
    impulse = -rate / give - leak
    gear.impulse[0] += impulse
    one.gear_impulse += ratio * impulse
    two.gear_impulse -= impulse
    push_free(one, rows, JOINT_ROWS * j, first, ratio * impulse)
    store_velocity(moving, one)
    load_velocity(moving, two)  # the two may share a body
    push_free(two, rows, JOINT_ROWS * k, second, -impulse)
    store_velocity(moving, two)
    return abs(rate)
