"""From what a person says about joints to rows of the table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.checks import named
from elys.sim_node.physics.joint_checks import JointNumbers, joint_column, joint_named, kind_column
from elys.sim_node.physics.kernels.tables import CONE, DISTANCE, GEAR, HINGE, JOINT, SLIDER
from elys.sim_node.physics.kernels.trigonometry import arc_tangent

Array = np.ndarray[Any, Any]

WITH_COORDINATE = (HINGE, SLIDER, DISTANCE, CONE)
MOST_SWING = 3.1  # [rad] beyond it a cone has no direction to push in
# As Python, for a few joints need no compiler; not numpy's, whose last bits differ between machines.
_arc_tangent = getattr(arc_tangent, "py_func", arc_tangent)


class JointDrive(TypedDict, total=False):
    """What acts on the coordinate of N joints: one value for all, or a row for each.

    The COORDINATE of a joint is the angle of a hinge or of a cone's twist [rad], 0 where the bodies stand when joined and
    counted over turns; the way of a slider along its axis [m]; the length of a distance joint [m]. Limits, spring and motor
    act on it.
    """

    lower: ArrayLike  # (N,) limits of the coordinate; a distance joint without any keeps its present length
    upper: ArrayLike
    swing_limit: ArrayLike  # (N,) half the opening of a cone [rad]
    spring_frequency: ArrayLike  # (N,) of a spring on the coordinate, for the masses and poses now [Hz]; 0 is none
    spring_damping: ArrayLike  # (N,) damping ratio
    spring_rest: ArrayLike  # (N,) coordinate at which it rests; without it 0, or the present length
    spring_limit: ArrayLike  # (N,) most force [N] or torque [N m]; with it the spring is a position servo
    motor_speed: ArrayLike  # (N,) wanted speed of the coordinate [m/s] or [rad/s]
    motor_limit: ArrayLike  # (N,) most force [N] or torque [N m] of the motor; 0 is none. Speed 0 makes it a brake
    drive_velocity: ArrayLike  # (N, 6) that a motor joint gives b against a, in a's axes [m/s], [rad/s]
    drive_force: ArrayLike  # (N,) most force of a motor joint [N]
    drive_torque: ArrayLike  # (N,) most torque of a motor joint [N m]


class JointDescription(JointDrive, total=False):
    """What N joints are: one value for all, or a row for each."""

    kind: str | Sequence[str]  # fixed, ball, hinge, slider, distance, cone_twist, gear, motor
    entity_a: ArrayLike  # (N,) bodies; 0 is the world, whose space is world space
    entity_b: ArrayLike
    anchor_a: ArrayLike  # (N, 3) in the entity's space [m]; without it where anchor_b stands now
    anchor_b: ArrayLike  # without it where anchor_a stands now (the entity's own place for a distance joint)
    axis_a: ArrayLike  # (N, 3) of a hinge, slider or cone in the entity's space; x where nothing is said
    axis_b: ArrayLike  # without it parallel to axis_a now
    rest_rotation: (
        ArrayLike  # (N, 4) how b is turned in a's space where angles are 0, instead of axis_b; without it as now
    )
    turned: ArrayLike  # (N,) with rest_rotation: about what a hinge's or cone's angle is now, to count turns on [rad]
    frequency: ArrayLike  # (N,) of what the joint locks [Hz]; 0 is rigid
    damping_ratio: ArrayLike  # (N,)
    joint_a: ArrayLike  # (N,) ids of the joints whose coordinates a gear couples
    joint_b: ArrayLike
    ratio: ArrayLike  # (N,) change of the second coordinate for one of the first
    break_force: ArrayLike  # (N,) [N] above which the joint breaks, as a mean over a step
    break_torque: ArrayLike  # (N,) [N m]
    collide_connected: ArrayLike  # (N,) whether the two bodies collide with each other


def new_joints(joints: ArrayLike, bodies: BodyTable, existing: Array, description: JointDescription) -> Array:
    """Checked rows of joints (N,) between bodies, `existing` being the joints there are.

    Raises:
        PhysicsError: a value is out of its range, an entity has no body, or a gear's joints have no coordinate.
    """
    ids = joint_column(joints)
    _refuse_unknown(description, JointDescription.__annotations__)
    rows = np.zeros(len(ids), JOINT)
    rows["id"] = ids
    rows["kind"] = kind_column(description.get("kind", "fixed"), ids)
    rows["body"] = -1
    numbers = JointNumbers(ids)
    _write_numbers(rows, numbers, description)
    gear = rows["kind"] == GEAR
    _write_bodies(rows, gear, bodies, description)
    _write_frames(rows, numbers, bodies, description)
    _write_limits(rows, numbers, description)
    if gear.any():
        _write_gears(rows, gear, existing, description)
    return rows


def changed_joints(rows: Array, changes: JointDrive) -> Array:
    """A copy of joint rows (N,) with other limits, springs or motors.

    Raises:
        PhysicsError: a value is out of its range.
    """
    _refuse_unknown(changes, JointDrive.__annotations__)
    rows = rows.copy()
    numbers = JointNumbers(rows["id"])
    for name in ("lower", "upper", "spring_rest"):
        if name in changes:
            rows[name] = numbers.number(name, changes[name], infinite=name != "spring_rest")
    _refuse_crossed(rows, numbers)
    _write_drive(rows, numbers, changes)
    # What does not act any more must not go on pushing.
    rows["motor_impulse"][rows["motor_limit"] == 0.0] = 0.0
    rows["spring_impulse"][rows["spring_frequency"] == 0.0] = 0.0
    rows["lower_impulse"][np.isneginf(rows["lower"])] = 0.0
    rows["upper_impulse"][np.isposinf(rows["upper"]) | (rows["lower"] == rows["upper"])] = 0.0
    if "spring_frequency" in changes or "spring_damping" in changes:
        rows["stiffness"] = -1.0
    return rows


def _refuse_unknown(given: Mapping[str, Any], known: Iterable[str]) -> None:
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise PhysicsError(f"{unknown[0]!r} cannot be said of joints here: only {', '.join(known)}")


def _write_numbers(rows: Array, numbers: JointNumbers, description: JointDescription) -> None:
    get: Any = description.get
    rows["frequency"] = numbers.number("frequency", get("frequency", 0.0), minimum=0.0)
    rows["damping_ratio"] = numbers.number("damping_ratio", get("damping_ratio", 1.0), minimum=0.0)
    for name in ("break_force", "break_torque"):
        rows[name] = numbers.number(name, get(name, math.inf), minimum=0.0, infinite=True)
    rows["ratio"] = numbers.number("ratio", get("ratio", 1.0))
    rows["collide_connected"] = np.broadcast_to(np.asarray(get("collide_connected", False), bool), len(rows))
    rows["stiffness"] = -1.0
    rows["spring_limit"] = math.inf
    rows["swing_limit"] = MOST_SWING
    _write_drive(rows, numbers, description)


def _write_drive(rows: Array, numbers: JointNumbers, given: JointDrive) -> None:
    """What is given of springs, motors and the cone."""
    values: Mapping[str, Any] = given
    for name in ("spring_frequency", "spring_damping"):
        if name in values:
            rows[name] = numbers.number(name, values[name], minimum=0.0)
    for name in ("spring_limit", "motor_limit"):
        if name in values:
            rows[name] = numbers.number(name, values[name], minimum=0.0, infinite=True)
    for side, name in enumerate(("drive_force", "drive_torque")):
        if name in values:
            rows["drive_limit"][:, side] = numbers.number(name, values[name], minimum=0.0, infinite=True)
    if "motor_speed" in values:
        rows["motor_speed"] = numbers.number("motor_speed", values["motor_speed"])
    if "drive_velocity" in values:
        rows["drive_velocity"] = numbers.number("drive_velocity", values["drive_velocity"], width=6)
    if "swing_limit" in values:
        rows["swing_limit"] = numbers.number("swing_limit", values["swing_limit"], minimum=0.0, maximum=MOST_SWING)


def _write_bodies(rows: Array, gear: Array, bodies: BodyTable, description: JointDescription) -> None:
    for side, name in enumerate(("entity_a", "entity_b")):
        column = np.broadcast_to(np.asarray(description.get(name, 0)), len(rows))
        if column.dtype.kind not in "iu" or (column < 0).any() or (column >= 2**32).any():
            raise PhysicsError(f"{name} must be an entity's id, or 0 for the world")
        entity = np.where(gear, 0, column).astype(np.uint32)
        held = np.flatnonzero(entity)
        rows["entity"][:, side] = entity
        rows["body"][held, side] = bodies.rows_of(entity[held])
    same = (rows["entity"][:, 0] == rows["entity"][:, 1]) & ~gear
    if same.any():
        first = rows[same][0]
        whom = named(first["entity"][0]) if first["entity"][0] else "the world"
        raise PhysicsError(f"{joint_named(first['id'])} joins {whom} with itself: name two different entities")


def _write_frames(rows: Array, numbers: JointNumbers, bodies: BodyTable, description: JointDescription) -> None:
    """Anchors and rotations in the entities' spaces; what is not given follows from where the entities stand."""
    place = np.zeros((2, len(rows), 3))
    turn = np.tile(np.asarray(quaternion.IDENTITY, np.float64), (2, len(rows), 1))
    for side in range(2):
        held = np.flatnonzero(rows["body"][:, side] >= 0)
        place[side, held], turn[side, held] = bodies.entity_poses(rows["body"][held, side])
    given_a, given_b = description.get("anchor_a"), description.get("anchor_b")
    distance = (rows["kind"] == DISTANCE)[:, None]
    b = np.zeros((len(rows), 3)) if given_b is None else numbers.number("anchor_b", given_b, width=3)
    across = place[1] + quaternion.rotate(turn[1], b) - place[0]
    a = quaternion.rotate(quaternion.conjugate(turn[0]), across)
    if given_a is not None:
        a = numbers.number("anchor_a", given_a, width=3)
        if given_b is None:
            across = place[0] + quaternion.rotate(turn[0], a) - place[1]
            b = np.where(distance, 0.0, quaternion.rotate(quaternion.conjugate(turn[1]), across))
    elif distance.any():
        a = np.where(distance, 0.0, a)
    rows["anchor"][:, :3], rows["anchor"][:, 3:] = a, b
    frame_a = rotation_between(
        np.array([[1.0, 0.0, 0.0]]), numbers.axis("axis_a", description.get("axis_a", (1, 0, 0)))
    )
    if "rest_rotation" in description:
        rest = numbers.rotation("rest_rotation", description["rest_rotation"])
        frame_b = quaternion.multiply(quaternion.conjugate(rest), frame_a)
    else:
        frame_b = quaternion.multiply(quaternion.conjugate(turn[1]), quaternion.multiply(turn[0], frame_a))
    if "axis_b" in description and "rest_rotation" not in description:
        now = quaternion.rotate(frame_b, np.array([1.0, 0.0, 0.0]))
        frame_b = quaternion.multiply(rotation_between(now, numbers.axis("axis_b", description["axis_b"])), frame_b)
    rows["rotation"][:, :4], rows["rotation"][:, 4:] = frame_a, frame_b
    world_a = place[0] + quaternion.rotate(turn[0], a)
    world_b = place[1] + quaternion.rotate(turn[1], b)
    axis = quaternion.rotate(quaternion.multiply(turn[0], frame_a), np.array([1.0, 0.0, 0.0]))
    along = ((world_b - world_a) * axis).sum(1)
    length = np.linalg.norm(world_b - world_a, axis=1)
    rows["coordinate"] = np.where(distance[:, 0], length, np.where(rows["kind"] == SLIDER, along, 0.0))
    if "rest_rotation" in description:
        turned = numbers.number("turned", description.get("turned", 0.0))
        for row in np.flatnonzero(np.isin(rows["kind"], (HINGE, CONE))).tolist():
            frames = (quaternion.multiply(turn[0, row], frame_a[row]), quaternion.multiply(turn[1, row], frame_b[row]))
            rows["coordinate"][row] = _twist(*frames, near=float(turned[row]))


def _twist(frame_a: Array, frame_b: Array, *, near: float) -> float:
    """The angle of frame b about the first axis of frame a, counted over turns so that it is nearest to `near` [rad]."""
    x, _, _, w = quaternion.multiply(quaternion.conjugate(frame_a), frame_b).tolist()
    angle = 2.0 * _arc_tangent(x, w)
    return float(angle + math.floor((near - angle) / (2.0 * math.pi) + 0.5) * (2.0 * math.pi))


def _write_limits(rows: Array, numbers: JointNumbers, description: JointDescription) -> None:
    """Where none are given a distance joint is a rod of its present length or a spring, and all else is free."""
    distance = rows["kind"] == DISTANCE
    length = rows["coordinate"]
    kept = distance & (rows["spring_frequency"] == 0.0) & ("lower" not in description) & ("upper" not in description)
    lower = np.where(kept, length, np.where(distance, 0.0, -math.inf))
    rows["lower"] = numbers.number("lower", description.get("lower", lower), infinite=True)
    rows["upper"] = numbers.number("upper", description.get("upper", np.where(kept, length, math.inf)), infinite=True)
    _refuse_crossed(rows, numbers)
    rest = np.where(distance, length, 0.0)
    rows["spring_rest"] = numbers.number("spring_rest", description.get("spring_rest", rest))


def _refuse_crossed(rows: Array, numbers: JointNumbers) -> None:
    limits = np.array([rows["lower"], rows["upper"]]).T
    numbers.refuse(rows["lower"] > rows["upper"], limits, "lower must not be above upper")


def _write_gears(rows: Array, gear: Array, existing: Array, description: JointDescription) -> None:
    gears = np.flatnonzero(gear)
    for side, name in enumerate(("joint_a", "joint_b")):
        ids = np.broadcast_to(np.asarray(description.get(name, 0)), len(rows))[gears].astype(np.uint32)
        rows["geared"][gears, side] = ids
        known = np.concatenate([existing, rows])
        order = np.argsort(known["id"], kind="stable")
        place = np.minimum(np.searchsorted(known["id"][order], ids), len(known) - 1)
        found = known[order][place]
        bad = (found["id"] != ids) | ~np.isin(found["kind"], WITH_COORDINATE)
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise PhysicsError(
                f"{joint_named(rows['id'][gears[first]])} is a gear on {joint_named(ids[first])}, which must be a hinge, slider, "
                f"distance or cone_twist joint that exists: add that first or beside it"
            )
        change = rows["ratio"][gears] if side == 0 else -1.0
        rows["gear_offset"][gears] += change * found["coordinate"]
    same = rows["geared"][gears, 0] == rows["geared"][gears, 1]
    if same.any():
        raise PhysicsError(f"{joint_named(rows['id'][gears[same]][0])} couples a joint with itself: name two joints")


def rotation_between(start: Array, end: Array) -> Array:
    """Quaternions (M, 4) that turn unit vectors into others (M, 3) the shortest way."""
    start = np.broadcast_to(start, end.shape)
    out = np.concatenate([np.cross(start, end), 1.0 + (start * end).sum(1, keepdims=True)], axis=1)
    opposite = out[:, 3] < 1e-12
    least = np.eye(3)[np.argmin(abs(start[opposite]), axis=1)]
    out[opposite, :3] = np.cross(start[opposite], least)
    out[opposite, 3] = 0.0
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))
