"""The geometry of joints: where the frames of a joint are, what its errors are, and the directions of its rows.

A row acts on the linear velocities along `direction` and on the angular ones along `arm`; its rate is

    direction . (v_b - v_a) + arm_b . w_b - arm_a . w_a

All of this is done for any time within a substep: frames are found from the displacements since the step began, plus the
mean velocities over the substep times that time.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.placement import write_axes
from elys.sim_node.physics.kernels.rotation import cross, multiplied, rotated, turn_by
from elys.sim_node.physics.kernels.tables import (
    AXIS,
    BALL,
    CONE,
    CORRECTION,
    CORRECTION_SPEED,
    DISTANCE,
    FIXED,
    HINGE,
    MOTOR,
    SLIDER,
    SWING,
)
from elys.sim_node.physics.kernels.trigonometry import arc_tangent

SMALL = 1e-12  # lengths [m] and sines below it have no direction


@inner
def is_rod(joint):
    return joint.kind == DISTANCE and joint.lower == joint.upper


@inner
def locked_count(joint):
    """How many rows of a joint are locked."""
    kind = joint.kind
    if is_rod(joint):
        return 1
    if kind in (FIXED, MOTOR):
        return 6
    if kind in (HINGE, SLIDER):
        return 5
    return 3 if kind in (BALL, CONE) else 0


@inner
def place_frames(joint, time):
    """Writes arms, frames, offset and turns of both sides as they will be after a time [s]."""
    shift = joint.shift
    path = joint.path
    arm = joint.arm
    frame = joint.frame
    turn = joint.turn
    start = joint.start_arm
    old = joint.start_frame
    framed = joint.kind not in (BALL, DISTANCE)
    for side in range(2):
        if joint.mover[side] < 0:  # it stays where it was prepared
            continue
        r = 3 * side
        q = 4 * side
        s = 6 * side + 3
        dx, dy, dz, dw = turn_by(shift[s], shift[s + 1], shift[s + 2])
        if time > 0.0:
            x, y, z, w = turn_by(time * path[s], time * path[s + 1], time * path[s + 2])
            dx, dy, dz, dw = multiplied(x, y, z, w, dx, dy, dz, dw)
        turn[q], turn[q + 1], turn[q + 2], turn[q + 3] = dx, dy, dz, dw
        arm[r], arm[r + 1], arm[r + 2] = rotated(dx, dy, dz, dw, start[r], start[r + 1], start[r + 2])
        if framed:
            x, y, z, w = multiplied(dx, dy, dz, dw, old[q], old[q + 1], old[q + 2], old[q + 3])
            frame[q], frame[q + 1], frame[q + 2], frame[q + 3] = x, y, z, w
    for c in range(3):
        moved = shift[6 + c] - shift[c] + time * (path[6 + c] - path[c])
        joint.offset[c] = joint.start_offset[c] + moved + (arm[3 + c] - start[3 + c]) - (arm[c] - start[c])
    if not framed:
        return
    write_axes(joint.axis_a, frame[0], frame[1], frame[2], frame[3])
    joint.axis_b[0], joint.axis_b[1], joint.axis_b[2] = rotated(frame[4], frame[5], frame[6], frame[7], 1.0, 0.0, 0.0)


@inner
def measure_turn(joint, rows, at):
    """Writes the errors of three locked angles: twice the vector part of the quaternion that turns frame a into frame b."""
    q = joint.frame
    x, y, z, w = multiplied(q[4], q[5], q[6], q[7], -q[0], -q[1], -q[2], q[3])
    scale = 2.0 if w >= 0.0 else -2.0
    rows[at].error = scale * x
    rows[at + 1].error = scale * y
    rows[at + 2].error = scale * z


@inner
def measure_twist(joint):
    """The angle of frame b about the first axis of frame a, nearest to the last known: so it counts turns."""
    q = joint.frame
    x, _, _, w = multiplied(-q[0], -q[1], -q[2], q[3], q[4], q[5], q[6], q[7])
    angle = 2.0 * arc_tangent(x, w)
    turns = math.floor((joint.coordinate - angle) / (2.0 * math.pi) + 0.5)
    joint.coordinate = angle + turns * (2.0 * math.pi)


@inner
def measure(joint, rows, first):
    """Writes errors of the locked rows, the coordinate and the swing from the frames as they are placed."""
    kind = joint.kind
    d = joint.offset
    a = joint.axis_a
    b = joint.axis_b
    if kind == SLIDER:
        for k in range(2):
            rows[first + k].error = d[0] * a[3 + 3 * k] + d[1] * a[4 + 3 * k] + d[2] * a[5 + 3 * k]
        joint.coordinate = d[0] * a[0] + d[1] * a[1] + d[2] * a[2]
        measure_turn(joint, rows, first + 2)
        return
    if kind == DISTANCE:
        joint.coordinate = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        if is_rod(joint):
            rows[first].error = joint.coordinate - joint.lower
        return
    for k in range(3):
        rows[first + k].error = d[k]
    if kind in (FIXED, MOTOR):
        measure_turn(joint, rows, first + 3)
    if kind in (HINGE, CONE):
        measure_twist(joint)
        x, y, z = cross(a[0], a[1], a[2], b[0], b[1], b[2])
        if kind == HINGE:
            for k in range(2):
                rows[first + 3 + k].error = x * a[3 + 3 * k] + y * a[4 + 3 * k] + z * a[5 + 3 * k]
        else:
            joint.swing = arc_tangent(math.sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@inner
def write_angular(row, x, y, z):
    """A row that acts on the relative angular velocity along a direction."""
    d = row.direction
    arm = row.arm
    d[0], d[1], d[2] = 0.0, 0.0, 0.0
    arm[0], arm[1], arm[2] = x, y, z
    arm[3], arm[4], arm[5] = x, y, z


@inner
def write_linear(row, joint, x, y, z, reach):
    """A row that acts on the velocity between the anchors along a direction, on both bodies at ONE point.

    That keeps angular momentum where the anchors are apart, as they are in the middle of a substep. `reach` says where the
    point is: 1 at the anchor of b, for a direction that turns with a; 0.5 in the middle.
    """
    d = row.direction
    arm = row.arm
    r = joint.arm
    o = joint.offset
    d[0], d[1], d[2] = x, y, z
    arm[0], arm[1], arm[2] = cross(r[0] + reach * o[0], r[1] + reach * o[1], r[2] + reach * o[2], x, y, z)
    back = 1.0 - reach
    arm[3], arm[4], arm[5] = cross(r[3] - back * o[0], r[4] - back * o[1], r[5] - back * o[2], x, y, z)


@inner
def write_along(row, joint):
    """A row along the line from anchor to anchor."""
    d = joint.offset
    length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    scale = 1.0 / length if length > SMALL else 0.0
    write_linear(row, joint, d[0] * scale, d[1] * scale, d[2] * scale, 0.5)


@inner
def write_locked(joint, rows, first):
    """The locked rows for the frames as they are placed."""
    kind = joint.kind
    a = joint.axis_a
    if kind == DISTANCE:
        if is_rod(joint):
            write_along(rows[first], joint)
        return
    count = 0
    if kind == SLIDER:
        for k in range(2):
            write_linear(rows[first + k], joint, a[3 + 3 * k], a[4 + 3 * k], a[5 + 3 * k], 1.0)
        count = 2
    else:
        # What a drive moves may be far from where it began: it counts where b is.
        reach = 1.0 if kind == MOTOR else 0.5
        write_linear(rows[first], joint, 1.0, 0.0, 0.0, reach)
        write_linear(rows[first + 1], joint, 0.0, 1.0, 0.0, reach)
        write_linear(rows[first + 2], joint, 0.0, 0.0, 1.0, reach)
        count = 3
    if kind == HINGE:
        for k in range(2):
            write_angular(rows[first + 3 + k], a[3 + 3 * k], a[4 + 3 * k], a[5 + 3 * k])
    elif kind not in (BALL, CONE):
        write_angular(rows[first + count], 1.0, 0.0, 0.0)
        write_angular(rows[first + count + 1], 0.0, 1.0, 0.0)
        write_angular(rows[first + count + 2], 0.0, 0.0, 1.0)


@inner
def write_free(joint, rows, first):
    """The rows of the free coordinate and of the swing."""
    kind = joint.kind
    a = joint.axis_a
    b = joint.axis_b
    axis = rows[first + AXIS]
    if kind == SLIDER:
        write_linear(axis, joint, a[0], a[1], a[2], 1.0)
    elif kind == DISTANCE:
        write_along(axis, joint)
    elif kind in (HINGE, CONE):
        # The rate of a twist about an axis that swings too.
        scale = 1.0 / max(1.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2], 1e-3)
        write_angular(axis, (a[0] + b[0]) * scale, (a[1] + b[1]) * scale, (a[2] + b[2]) * scale)
    if kind == CONE:
        x, y, z = cross(a[0], a[1], a[2], b[0], b[1], b[2])
        sine = math.sqrt(x * x + y * y + z * z)
        scale = 1.0 / sine if sine > SMALL else 0.0
        write_angular(rows[first + SWING], x * scale, y * scale, z * scale)


@inner
def write_rows(joint, rows, first):
    """All rows that anything acts on."""
    write_locked(joint, rows, first)
    if joint.free > 0:
        write_free(joint, rows, first)


@inner
def has_coordinate(kind):
    return kind in (HINGE, SLIDER, DISTANCE, CONE)


@inner
def correction(error, h):
    """The rate at which an error is taken away in a substep."""
    return min(max(CORRECTION / h * error, -CORRECTION_SPEED), CORRECTION_SPEED)


@inner
def row_rate(joint, row):
    """How fast a row's error grows."""
    v = joint.velocity
    d = row.direction
    arm = row.arm
    rate = 0.0
    for c in range(3):
        rate += d[c] * (v[6 + c] - v[c]) + arm[3 + c] * v[9 + c] - arm[c] * v[3 + c]
    return rate
