"""What a field's edit means for each of the selected entities, and what there is to say of a field besides its value."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from elys.common.components import (
    Camera,
    Collider,
    Component,
    ComponentDeclaration,
    FieldDeclaration,
    Joint,
    Kind,
    Light,
    check_value,
)
from elys.common.errors import ComponentError
from elys.editor_node.expressions import Entry
from elys.editor_node.language import tr
from elys.editor_node.rotations import degrees_from, rotation_from

NUMBERS: Final = (Kind.FLOAT, Kind.INT, Kind.VEC3, Kind.COLOR, Kind.QUAT)
BAR_STEPS: Final = 1000  # a range of more steps than this is no bar: a pixel would be worth too many
_PROPORTIONAL: Final = ("scale", "size")  # vectors that may keep their proportions
_SWITCHES: Final = ("enabled", "visible")
# Fields that matter only to some shapes and joints, and to which.
_SHAPES_WITH: Final = {
    "size": ("box", "height_field"),
    "radius": ("sphere", "capsule", "cylinder"),
    "half_length": ("capsule", "cylinder"),
    "heights": ("height_field",),
}
_WITH_COORDINATE: Final = ("hinge", "slider", "distance", "cone_twist")
_JOINTS_WITH: Final = {
    "axis": ("hinge", "slider", "cone_twist"),
    "swing_limit": ("cone_twist",),
    **dict.fromkeys(("limited", "lower", "upper", "motor_speed", "motor_limit"), _WITH_COORDINATE),
    **dict.fromkeys(("spring_frequency", "spring_damping", "spring_rest", "spring_limit"), _WITH_COORDINATE),
    **dict.fromkeys(("drive_velocity", "drive_spin", "drive_force", "drive_torque"), ("motor",)),
    **dict.fromkeys(("joint_a", "joint_b", "ratio"), ("gear",)),
}
_CAMERAS_WITH: Final = {"field_of_view": "perspective", "ortho_height": "orthographic"}


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldChange:
    """What a person made of a field, seen on the primary entity: `value`, in which `axis` is the one element that changed.

    A rotation's value is three Euler degrees. `entry` is what was typed, for entities to apply to their own values; with
    `keeps_proportions` the other elements go along.
    """

    value: Any
    axis: int | None = None
    stroke: object = None
    entry: Entry | None = None
    keeps_proportions: bool = False


@dataclass(frozen=True, slots=True)
class NameOffer:
    """What a text may name. Without `longer` the text is one of the `names`; else it lists several.

    Attributes:
        longer: what a text becomes with each name that can be added to it.
    """

    names: tuple[str, ...]
    longer: Callable[[str], Mapping[str, str]] | None = None


def has_effect(component: Component, field: str) -> bool:
    """Whether a field matters, as the component's other fields stand."""
    match component:
        case Collider(shape=shape) if field in _SHAPES_WITH:
            return shape in _SHAPES_WITH[field]
        case Joint(kind=kind) if field in _JOINTS_WITH:
            return kind in _JOINTS_WITH[field]
        case Camera(projection=projection) if field in _CAMERAS_WITH:
            return projection == _CAMERAS_WITH[field]
        case Light(kind=kind) if field in ("inner_cone_angle", "outer_cone_angle"):
            return kind == "spot"
        case Light(kind=kind) if field == "range":
            return kind != "directional"
        case _:
            return True


def may_keep_proportions(field: FieldDeclaration) -> bool:
    """Whether the field's elements may be edited as one, by a common factor."""
    return field.kind is Kind.VEC3 and field.name in _PROPORTIONAL


def has_bar(field: FieldDeclaration) -> bool:
    """Whether the field's range is small enough for a bar that shows where in it the value is."""
    if field.minimum is None or field.maximum is None or field.kind not in (Kind.FLOAT, Kind.INT):
        return False
    return (field.maximum - field.minimum) / field.step <= BAR_STEPS


def is_radiance(field: FieldDeclaration) -> bool:
    """Whether a colour may be brighter than white."""
    return field.kind is Kind.COLOR and field.maximum is None


def switch_of(declaration: ComponentDeclaration) -> FieldDeclaration | None:
    """The field that turns a whole component on and off, if its declaration has one."""
    for field in declaration.fields:
        if field.kind is Kind.BOOL and field.name in _SWITCHES:
            return field
    return None


def label_of(field: FieldDeclaration) -> str:
    """The field's name as one says it; English."""
    return field.name.replace("_", " ").capitalize()


def shown_number(value: float, unit: str = "") -> str:
    """A number with the digits that matter."""
    return f"{value:.6g}{f' {unit}' if unit else ''}"


def shown_value(field: FieldDeclaration, value: Any) -> str:
    """A value as a sentence says it."""
    if field.kind is Kind.QUAT:
        return ", ".join(f"{angle:.6g}°" for angle in degrees_from(value))
    if field.kind is Kind.CURVE:
        return tr("{count} keys", count=len(value))
    if isinstance(value, tuple):
        return f"{', '.join(f'{element:.6g}' for element in value)}{f' {field.unit}' if field.unit else ''}"
    if isinstance(value, float):
        return shown_number(value, field.unit)
    return str(value)


def is_close(left: Any, right: Any) -> bool:
    """Whether two values of a field are the same to what 32 bits hold."""
    if isinstance(left, tuple) and isinstance(right, tuple):
        return len(left) == len(right) and all(map(is_close, left, right))
    if isinstance(left, float) and isinstance(right, float):
        return math.isclose(left, right, rel_tol=1e-6, abs_tol=1e-7)
    return bool(left == right)


def values_of_each(
    declaration: ComponentDeclaration, field: FieldDeclaration, own: Mapping[int, Any], change: FieldChange
) -> dict[int, Any]:
    """What each entity is to be sent, from the values they have (before the stroke, where the change is of one).

    Raises:
        ComponentError: for one of them it is no value of the field; then none is to be sent.
    """
    return {
        entity: check_value(declaration, field, _changed(field, value, change, is_bare=len(own) == 1))
        for entity, value in own.items()
    }


def _changed(field: FieldDeclaration, own: Any, change: FieldChange, *, is_bare: bool) -> Any:
    """The value of one entity. One that is alone (`is_bare`) takes the angles of a rotation as they were shown."""
    if field.kind is Kind.QUAT:
        if change.axis is None and change.entry is None:
            return rotation_from(change.value) if len(change.value) == 3 else change.value
        if is_bare and change.entry is None:
            return rotation_from(change.value)
        shown = change.value if is_bare and change.entry is not None else degrees_from(own)
        return rotation_from(_with_element(shown, change, proportional=False))
    if change.axis is None:
        if change.entry is None:
            return change.value
        return _whole(field, change.entry.applied(float(own)))
    return _with_element(own, change, proportional=change.keeps_proportions)


def _with_element(own: Sequence[float], change: FieldChange, *, proportional: bool) -> tuple[float, ...]:
    axis = change.axis
    assert axis is not None
    element = change.value[axis] if change.entry is None else change.entry.applied(own[axis])
    if not proportional:
        return (*own[:axis], element, *own[axis + 1 :])
    if own[axis] == 0.0:  # nothing has a proportion to it
        return tuple(element for _ in own)
    factor = element / own[axis]
    return tuple(element if place == axis else value * factor for place, value in enumerate(own))


def _whole(field: FieldDeclaration, value: float) -> float | int:
    """What a field of whole numbers takes of a number that was typed."""
    if field.kind is not Kind.INT:
        return value
    if not math.isfinite(value) or not value.is_integer():
        raise ComponentError(f"{label_of(field)} must be a whole number, not {value:g}")
    return int(value)
