"""Values between two values of a component's field, and the spin that turns a body from one rotation to another."""

from __future__ import annotations

from typing import Any, Final

from elys.common.components import check_value, declaration_of
from elys.common.components.declaration import Kind
from elys.common.math import poses, quaternion
from elys.sim_node.scripts.vector import Rotation, Vector

_NUMBERS: Final = (Kind.FLOAT, Kind.INT)
_VECTORS: Final = (Kind.VEC3, Kind.COLOR)


def goal_of(component: str, field: str, value: Any) -> Any:
    """The value as the field takes it. Raises ComponentError if it does not, TypeError where nothing is between two."""
    declaration = declaration_of(component)
    declared = declaration.field(field)
    if declared.kind not in (*_NUMBERS, *_VECTORS, Kind.QUAT):
        raise TypeError(f"{component}.{field} cannot be tweened: it is a {declared.kind.value}; set it when it is time")
    plain = tuple(value) if declared.kind not in _NUMBERS else value
    return check_value(declaration, declared, plain)


def between(component: str, field: str, start: Any, goal: Any, share: float) -> Any:
    """Part of the way from one to the other; whole numbers are rounded, rotations take the shorter way."""
    match declaration_of(component).field(field).kind:
        case Kind.QUAT:
            return tuple(quaternion.slerp(start, goal, share).tolist())
        case Kind.INT:
            return round(start + (goal - start) * share)
        case Kind.FLOAT:
            return start + (goal - start) * share
    return tuple(a + (b - a) * share for a, b in zip(start, goal, strict=True))


def turned(start: Rotation, goal: Rotation, share: float) -> Rotation:
    """Part of the shorter way from one rotation to another."""
    return Rotation(quaternion.slerp(start, goal, share).tolist())


def spin_between(now: Rotation, goal: Rotation, dt: float) -> Vector:
    """The turning speed [rad/s] that brings one rotation to another in a tick, by the series of the arc sine."""
    x, y, z, w = poses.multiply(goal, now.inverse)
    side = -1.0 if w < 0.0 else 1.0
    square = x * x + y * y + z * z
    factor = 1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (15.0 / 336.0)))
    return Vector(x, y, z) * (2.0 * side * factor / dt)
