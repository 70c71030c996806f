"""What a sweep varies: `gravity=1.62,9.81`, `seed=0..99`, `Cube 3.RigidBody.mass=1..10:4`, and the scenes that come of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, Final

import msgspec
import numpy as np

from elys.common.components import declaration_of
from elys.common.errors import ComponentError, ElysError
from elys.common.scene import OpenedScene, SceneSettings
from elys.common.scene_naming import Names

MOST_RUNS: Final = 1_000_000
_AXES: Final = "xyzw"
_SETTINGS: Final = ("gravity", "tick_rate", "substeps", "strengths")

Value = float | int | bool | str


class Variation(msgspec.Struct, frozen=True):
    """A name and the values that it takes."""

    name: str
    values: tuple[Value, ...]


def parse_variation(text: str) -> Variation:
    """Reads `NAME=A,B,C`, `NAME=A..B` (whole numbers) or `NAME=A..B:N` (N values from A to B).

    Raises:
        ElysError: it is none of them.
    """
    name, equals, values = text.partition("=")
    if not equals or not name.strip() or not values.strip():
        raise ElysError(f"'{text}' varies nothing: write NAME=VALUES, for instance gravity=1.62,9.81 or seed=0..99")
    start, dots, stop = values.partition("..")
    if not dots:
        return Variation(name.strip(), tuple(_value(part) for part in values.split(",")))
    stop, colon, count = stop.partition(":")
    first, last = _value(start), _value(stop)
    if colon:
        if not (_is_number(first) and _is_number(last) and count.isdecimal() and 0 < int(count) <= MOST_RUNS):
            raise ElysError(f"'{text}' is no range: write {name}=A..B:N for N values from the number A to the number B")
        return Variation(name.strip(), tuple(np.linspace(float(first), float(last), int(count)).tolist()))
    if not (isinstance(first, int) and isinstance(last, int)):
        raise ElysError(f"'{text}' leaves open how many values there are: write {name}={start}..{stop}:N")
    if not 0 <= last - first < MOST_RUNS:
        raise ElysError(f"'{text}' is no range: it goes upwards, over at most {MOST_RUNS} whole numbers")
    return Variation(name.strip(), tuple(range(first, last + 1)))


def _is_number(value: Value) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def _value(text: str) -> Value:
    text = text.strip()
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def combinations(variations: Sequence[Variation]) -> list[dict[str, Value]]:
    """Every combination of the values, the last name varying fastest. Raises ElysError for too many, or a name given twice."""
    names = [variation.name for variation in variations]
    for name in names:
        if names.count(name) > 1:
            raise ElysError(f"'{name}' is varied twice; give all its values at once")
    count = int(np.prod([len(variation.values) for variation in variations], dtype=float))
    if count > MOST_RUNS:
        raise ElysError(f"that would be {count} runs; up to {MOST_RUNS} can be asked for")
    return [dict(zip(names, values, strict=True)) for values in product(*(v.values for v in variations))]


def varied(scene: OpenedScene, values: dict[str, Value], *, jitter: float) -> OpenedScene:
    """The scene with these values.

    `seed` moves every body that is nobody's child by up to `jitter` [m] along each axis.

    Raises:
        ElysError: a name is not known, or its value cannot be.
    """
    for name, value in values.items():
        if name == "seed":
            scene = _jittered(scene, value, jitter)
        elif name.partition(".")[0] in _SETTINGS:
            scene = _with_setting(scene, name, value)
        elif name.count(".") >= 2:
            scene = _with_field(scene, name, value)
        else:
            raise ElysError(
                f"'{name}' cannot be varied: there are seed, {', '.join(_SETTINGS)}, and fields as ENTITY.COMPONENT.FIELD"
            )
    return scene


def _jittered(scene: OpenedScene, seed: Value, jitter: float) -> OpenedScene:
    if not isinstance(seed, int) or seed < 0:
        raise ElysError(f"a seed is a whole number of 0 or more, not {seed!r}")
    random = np.random.default_rng(seed)
    records = list(scene.records)
    for row, record in enumerate(records):
        body = record.components.get("RigidBody")
        if (
            body is None
            or body.get("motion", "dynamic") != "dynamic"
            or (record.parent >= 0 and _is_body(scene, record.parent))
        ):
            continue
        transform = dict(record.components.get("Transform", {}))
        moved = np.add(transform.get("position", (0.0, 0.0, 0.0)), jitter * random.uniform(-1.0, 1.0, 3))
        transform["position"] = moved.tolist()
        records[row] = msgspec.structs.replace(record, components={**record.components, "Transform": transform})
    return msgspec.structs.replace(scene, records=records)


def _is_body(scene: OpenedScene, row: int) -> bool:
    while row >= 0:
        if "RigidBody" in scene.records[row].components:
            return True
        row = scene.records[row].parent
    return False


def _with_setting(scene: OpenedScene, name: str, value: Value) -> OpenedScene:
    field, _, axis = name.partition(".")
    new: Any = value
    if field == "gravity":
        gravity: list[Any] = list(scene.settings.gravity)
        if axis:
            gravity[_axis(axis, name, 3)] = value
        else:
            gravity = [0.0, -value, 0.0] if isinstance(value, (int, float)) else [value]
        new = gravity
    try:
        changed = {**msgspec.to_builtins(scene.settings), field: new}
        settings = msgspec.convert(changed, SceneSettings)
    except msgspec.ValidationError as error:
        raise ElysError(f"{name}={value} cannot be: {error}") from error
    return msgspec.structs.replace(scene, settings=settings)


def _with_field(scene: OpenedScene, name: str, value: Value) -> OpenedScene:
    parts = name.split(".")
    axis = parts.pop() if len(parts) > 3 and len(parts[-1]) == 1 else ""
    field, component = parts.pop(), parts.pop()
    row = Names([(record.name, record.parent) for record in scene.records]).find(".".join(parts))
    record = scene.records[row]
    if component not in record.components:
        raise ElysError(f"{name}: {record.name} has no {component}; it has {', '.join(record.components)}")
    try:
        known = {declared.name: declared for declared in declaration_of(component).fields}
    except ComponentError as error:
        raise ElysError(f"{name}: {error}") from error
    if field not in known:
        raise ElysError(f"{name}: {component} has no field {field}; it has {', '.join(known)}")
    values = dict(record.components[component])
    new: Any = value
    if axis:
        whole = list(values.get(field, known[field].default))
        whole[_axis(axis, name, len(whole))] = value
        new = whole
    values[field] = new
    records: list[Any] = list(scene.records)
    records[row] = msgspec.structs.replace(record, components={**record.components, component: values})
    return msgspec.structs.replace(scene, records=records)


def _axis(text: str, name: str, length: int) -> int:
    place = _AXES.find(text)
    if not 0 <= place < length:
        raise ElysError(f"{name}: '{text}' is no axis; there are {', '.join(_AXES[:length])}")
    return place


def described(values: dict[str, Value]) -> Iterator[str]:
    """Values as a person reads them."""
    return (f"{name}={value}" for name, value in values.items())
