"""Checking values against declarations: what comes from a file, a message or a widget becomes a Component or is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from elys.common.components.curve import KEY_WIDTH, MAX_KEYS, Curve, CurveKey
from elys.common.components.declaration import Component, ComponentDeclaration, FieldDeclaration, Kind, declaration_of
from elys.common.errors import ComponentError

MOST_OF_A_CURVE: Final = 1e9  # in times, values and slopes
MAX_TEXT_LENGTH: Final = 4096  # characters: every text is kept, and travels in every snapshot


def component_from(name: str, values: Mapping[str, Any], *, base: Component | None = None) -> Component:
    """The component `name` with `values` over `base` (over the defaults when there is none).

    Raises:
        ComponentError: the component or a field does not exist, or a value is of the wrong kind or out of range; the
            message names component and field and says what was expected.
    """
    declaration = declaration_of(name)
    checked = {field: check_value(declaration, declaration.field(field), value) for field, value in values.items()}
    current = {} if base is None else {f.name: getattr(base, f.name) for f in declaration.fields}
    return declaration.struct(**{**current, **checked})


def values_of(component: Component, *, only_changed: bool = False) -> dict[str, Any]:
    """The fields of a component as plain JSON-able values; with `only_changed` those that differ from their defaults."""
    declaration = declaration_of(component)
    values = {field.name: getattr(component, field.name) for field in declaration.fields}
    if only_changed:
        values = {f.name: values[f.name] for f in declaration.fields if values[f.name] != f.default}
    return values


def laid_over(component: str, before: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of some fields over those of a component; named values one by one, of which None takes one away."""
    laid = {**before, **values}
    for field in declaration_of(component).fields:
        if field.kind is Kind.VALUES and isinstance(over := values.get(field.name), Mapping):
            both = {**before.get(field.name, {}), **over}
            laid[field.name] = {name: value for name, value in both.items() if value is not None}
    return laid


def check_value(declaration: ComponentDeclaration, field: FieldDeclaration, value: Any) -> Any:
    """`value` in the field's own type (lists become tuples, ints become floats), or ComponentError."""
    where = f"{declaration.name}.{field.name}"
    checked = _checked(where, field, value)
    if field.check is not None:
        field.check(where, checked)
    return checked


def _checked(where: str, field: FieldDeclaration, value: Any) -> Any:
    match field.kind:
        case Kind.FLOAT:
            return _in_range(where, field, _number(where, value))
        case Kind.INT:
            if isinstance(value, bool) or not isinstance(value, int):
                raise ComponentError(f"{where} must be a whole number, not {_shown(value)}")
            if not -(2**31) <= value < 2**31:
                raise ComponentError(f"{where} must fit 32 bits, not {_shown(value)}")
            return int(_in_range(where, field, value))
        case Kind.BOOL:
            if not isinstance(value, bool):
                raise ComponentError(f"{where} must be true or false, not {_shown(value)}")
            return value
        case Kind.CHOICE:
            if value not in field.choices:
                raise ComponentError(f"{where} must be one of {', '.join(field.choices)}, not {_shown(value)}")
            return value
        case Kind.TEXT | Kind.ASSET:
            if not isinstance(value, str):
                raise ComponentError(f"{where} must be a text, not {_shown(value)}")
            if len(value) > MAX_TEXT_LENGTH:
                raise ComponentError(f"{where} may have {MAX_TEXT_LENGTH} characters, not {len(value)}")
            return _text(where, value)
        case Kind.VALUES:
            return _named_values(where, value)
        case Kind.ENTITY:
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
                raise ComponentError(f"{where} must be an entity id (0 for none), not {_shown(value)}")
            return value
        case Kind.QUAT:
            return _unit(where, _numbers(where, field, value))
        case Kind.CURVE:
            return _curve(where, field, value)
        case Kind.VEC3 | Kind.COLOR:
            return tuple(_in_range(where, field, element) for element in _numbers(where, field, value))


def _text(where: str, value: str) -> str:
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ComponentError(f"{where} holds half of a surrogate pair, which is no character") from None
    return value


def _named_values(where: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ComponentError(f"{where} must be an object of named values, not {_shown(value)}")
    checked: dict[str, Any] = {}
    for name, item in value.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise ComponentError(f"{where}: {_shown(name)} is no name of a field")
        if isinstance(item, list | tuple) and 1 <= len(item) <= 4:
            checked[name] = tuple(_number(f"{where}.{name}", element) for element in item)
        elif isinstance(item, str):
            checked[name] = _text(f"{where}.{name}", item)
        elif isinstance(item, bool) or (isinstance(item, int) and -(2**53) <= item <= 2**53):
            checked[name] = item
        elif isinstance(item, float):
            checked[name] = _number(f"{where}.{name}", item)
        else:
            raise ComponentError(
                f"{where}.{name} must be a number, true or false, a text or up to 4 numbers, not {_shown(item)}"
            )
    if len(values_text(checked)) > MAX_TEXT_LENGTH:
        raise ComponentError(f"{where} may have {MAX_TEXT_LENGTH} characters as JSON, not {len(values_text(checked))}")
    return checked


def values_text(values: Mapping[str, Any]) -> str:
    """Named values as one text, the same for the same values; "" for none."""
    return json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=False) if values else ""


def values_from(text: str) -> dict[str, Any]:
    """The named values that `values_text` made a text of."""
    found: dict[str, Any] = json.loads(text) if text else {}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in found.items()}


def _number(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ComponentError(f"{where} must be a number, not {_shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ComponentError(f"{where} must be a finite number, not {_shown(value)}")
    return number


def _numbers(where: str, field: FieldDeclaration, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) != field.width:
        raise ComponentError(f"{where} must be {field.width} numbers, not {_shown(value)}")
    return tuple(_number(where, element) for element in value)


def _curve(where: str, field: FieldDeclaration, value: Any) -> Curve:
    if not isinstance(value, list | tuple):
        raise ComponentError(f"{where} must be a list of keys, not {_shown(value)}")
    if len(value) > MAX_KEYS:
        raise ComponentError(f"{where} may have {MAX_KEYS} keys, not {len(value)}")
    keys: list[CurveKey] = []
    for key in value:
        if not isinstance(key, list | tuple) or len(key) != KEY_WIDTH:
            raise ComponentError(f"{where} has keys of time, value, slope before and slope after, not {_shown(key)}")
        time, number, before, after = (_number(where, element) for element in key)
        if max(map(abs, (time, number, before, after))) > MOST_OF_A_CURVE:
            raise ComponentError(f"{where} may have numbers up to {MOST_OF_A_CURVE:g}, not {_shown(key)}")
        if time < 0.0:
            raise ComponentError(f"{where} begins at 0 s at the earliest, not at {time:g}")
        # As they are stored: times that 32 bits do not tell apart are one.
        if keys and not np.float32(keys[-1][0]) < np.float32(time):
            raise ComponentError(f"{where} has keys whose times rise, not {keys[-1][0]:g} s and then {time:g} s")
        keys.append((time, _in_range(where, field, number), before, after))
    return tuple(keys)


def _in_range(where: str, field: FieldDeclaration, value: float) -> float:
    unit = f" {field.unit}" if field.unit else ""
    if field.minimum is not None and value < field.minimum:
        raise ComponentError(f"{where} must be at least {field.minimum:g}{unit}, not {value:g}")
    if field.maximum is not None and value > field.maximum:
        raise ComponentError(f"{where} must be at most {field.maximum:g}{unit}, not {value:g}")
    return value


def _unit(where: str, value: tuple[float, ...]) -> tuple[float, ...]:
    length = math.sqrt(sum(element * element for element in value))
    if length < 1e-6:
        raise ComponentError(f"{where} must be a rotation (x, y, z, w) of length 1, not {_shown(value)}")
    # What is a unit quaternion to rounding stays as it is, so that files and recordings round-trip exactly.
    if abs(length - 1.0) <= 1e-6:
        return value
    return tuple(element / length for element in value)


def _shown(value: Any) -> str:
    """A value as it stands in a sentence."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of thousands of digits, which Python does not write
        return "a huge number"
    return text if len(text) <= 100 else f"{text[:97]}..."
