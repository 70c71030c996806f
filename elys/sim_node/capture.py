"""The one place that walks a simulation's objects, to keep what is in them or to put it back.

Whatever an object of this package holds is part of its state, without being listed: a new attribute is captured from the day it
is written. What is not captured is listed below, with the reason; what cannot be captured is an error.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from types import MethodType
from typing import Any, Final

import numpy as np

from elys.common.assets.store import AssetStore
from elys.common.components import ComponentDeclaration, declarations
from elys.common.components.columns import StringTable
from elys.common.errors import ComponentError, StateError
from elys.sim_node.ecs.columns import ComponentTable
from elys.sim_node.ecs.query import Query
from elys.sim_node.input_actions import PlayerActions
from elys.sim_node.physics.kernels.tables import GEAR
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.scripts.runner import Scripts
from elys.sim_node.state import ATOMS, RECORDS, Column, copied

# What follows from the rest, by class. Numbers that say "something is other than before" only ever rise: to put one back would
# make what was derived at another time pass for new.
DERIVED: Final[Mapping[str, frozenset[str]]] = {
    # `systems` are code, and keep no state that this could know of; times are of the last step alone; where the scene came from
    # and how it was edited is what a person saves, and decides nothing.
    "Simulation": frozenset({"name", "path", "edited", "systems", "stage_times", "_threads"}),
    "World": frozenset({"_queries"}),  # lists of what is in the tables
    "Hierarchy": frozenset({"version", "enabled_version", "_walked_version"}),
    "ComponentTable": frozenset({"structure_version"}),
    "RigidBodies": frozenset({"_seen", "_moving_rows"}),  # versions of lists, and rows of what moves: found anew
    # All that characters are is in their components.
    "Characters": frozenset({"_seen", "_problems", "_told"}),
    "Cameras": frozenset({"_known"}),  # which of them were told of: readers are told all anew
    # Clips are read from assets, and who plays them is bound by the tree and the components as they are.
    "Animations": frozenset(
        {"library", "_binding", "_crew", "_poser", "_markers", "_moved", "_written", "_seen", "_driven", "_events"}
    ),
    "RootWalks": frozenset({"_walkers", "_stretches", "_held", "_tracks"}),
}
_STRANGERS: Final = (AssetStore, ComponentDeclaration, Query, MethodType)
_SELF_KEPT: Final = (PhysicsWorld, Scripts, PlayerActions)  # that say themselves what is kept, and how it comes back
# What came to be after states that are still around: parts that were empty then, and fields that had their defaults.
_LATER: Final = frozenset({"Voices", "RestPoses", "RootWalks", "TickTime"})
_LATER_FIELDS: Final[Mapping[str, tuple[str, ...]]] = {"Animation": ("fade", "passes"), "Camera": ("player",)}
_PACKAGE: Final = "elys.sim_node."


def captured(root: object, previous: Mapping[str, Any]) -> dict[str, Any]:
    """All state below an object, by path; arrays and containers are those of `previous` where they are equal.

    Raises:
        TypeError: something is there of which nobody could say how to put it back.
    """
    values: dict[str, Any] = {}
    for path, part in _parts(root):
        ours: set[int] = set()  # arrays that were made to be kept
        if isinstance(part, _SELF_KEPT):
            held: Mapping[str, Any] = part.saved()
            ours = {id(held[name]) for name in ("pairs", "manifolds") if name in held}
        elif isinstance(part, dict):
            held = part
        else:
            held = _state_of(part)
        for name, value in held.items():
            key = f"{path}{name}"
            values[key] = _kept(value, previous.get(key), key, is_ours=id(value) in ours)
    return values


def restored(root: object, values: Mapping[str, Any], *, is_ours: bool) -> None:
    """Puts back what was captured; `is_ours` if it never left this process.

    Raises:
        StateError, PhysicsError: the values are not of such an object, or of another version of its components. Before anything
            is changed.
    """
    for path in values:
        component = path.split("/")[2] if path.startswith("world/_tables/") else ""
        if component and component not in declarations():
            raise StateError(f"this state has a component {component}, which this ELYS does not know")
    _make_tables(root, values)
    parts = dict(_parts(root))
    plan = [(part, path, _wanted(part, path, values)) for path, part in parts.items()]
    unknown = values.keys() - {f"{path}{name}" for _, path, wanted in plan for name in wanted}
    if unknown:
        raise StateError(f"this state holds {min(unknown)}, which this simulation has not: it is of another version")
    if not is_ours:
        _check_numbers(values)
    for part, _, wanted in plan:
        if isinstance(part, _SELF_KEPT):
            part.load(wanted)
        elif isinstance(part, dict):
            part.update(wanted)
        else:
            for name, value in wanted.items():
                setattr(part, name, value)


def _parts(root: object) -> Iterator[tuple[str, Any]]:
    """The root and all objects of this package below it, and dicts of arrays, each once, with where it is: "world/strings/"."""
    seen: set[int] = set()
    waiting: deque[tuple[str, Any]] = deque([("", root)])  # the shortest way to each
    while waiting:
        path, part = waiting.popleft()
        if id(part) in seen:
            continue
        seen.add(id(part))
        yield path, part
        if isinstance(part, (*_SELF_KEPT, dict)):
            continue
        left_out = derived_of(part)
        for name, value in vars(part).items():
            if name in left_out:
                continue
            if _is_part(value) or _is_table(value):
                waiting.append((f"{path}{name}/", value))
            elif _has_parts(value):
                waiting += [(f"{path}{name}/{key}/", item) for key, item in value.items()]


def derived_of(part: object) -> frozenset[str]:
    """The attributes of an object that are not captured."""
    return frozenset().union(*(DERIVED.get(base.__name__, frozenset()) for base in type(part).__mro__))


def _state_of(part: object) -> dict[str, Any]:
    """The attributes that are values: not other parts, not what is derived, not what has no state."""
    left_out = derived_of(part)
    return {
        name: value
        for name, value in vars(part).items()
        if not (name in left_out or _is_part(value) or _is_table(value) or _has_parts(value))
        and not isinstance(value, _STRANGERS)
    }


def _is_part(value: object) -> bool:
    kind = type(value)
    if isinstance(value, _STRANGERS) or RECORDS.get(kind.__name__) is kind:
        return False
    return kind.__module__.startswith(_PACKAGE) or isinstance(value, StringTable)


def _is_table(value: object) -> bool:
    return isinstance(value, dict) and bool(value) and all(isinstance(item, np.ndarray) for item in value.values())


def _has_parts(value: object) -> bool:
    return isinstance(value, dict) and bool(value) and all(_is_part(item) for item in value.values())


def _kept(value: Any, previous: Any, key: str, *, is_ours: bool) -> Any:
    if isinstance(value, np.ndarray):
        return Column.of(value, previous, is_ours=is_ours)
    if type(value) in ATOMS:
        return value
    if type(previous) is type(value) and previous == value:
        return previous
    try:
        return copied(value)
    except TypeError as error:
        raise TypeError(
            f"{key}: {error}; capture between ticks, and list in capture.DERIVED what follows from the rest"
        ) from None


def _make_tables(root: Any, values: Mapping[str, Any]) -> None:
    """Makes the tables of components that were used when the state was captured; empties those that were not."""
    names = dict.fromkeys(path.split("/")[2] for path in values if path.startswith("world/_tables/"))
    world = getattr(root, "world", None)
    if world is None:
        return
    for name in names:
        world.table(name)
    for table in world.tables():
        if table.declaration.name not in names:
            table.clear()


def _wanted(part: Any, path: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """What the values say of a part, ready to be put into it."""
    if isinstance(part, ComponentTable) and f"{path}count" not in values:
        return {}  # nobody had the component, and nobody has
    if isinstance(part, _SELF_KEPT):
        return {name: _fitting(values.get(f"{path}{name}"), now, f"{path}{name}") for name, now in part.saved().items()}
    if isinstance(part, dict) and not any(key.startswith(path) for key in values):
        return {}
    wanted = {}
    for name, present in (part if isinstance(part, dict) else _state_of(part)).items():
        key = f"{path}{name}"
        if key not in values and (later := _added_later(part, path, name, values)) is not None:
            wanted[name] = later
            continue
        if key not in values:
            raise StateError(f"this state lacks {key}: it is of another version")
        wanted[name] = _fitting(values[key], present, key)
    return wanted


def _added_later(part: Any, path: str, name: str, values: Mapping[str, Any]) -> Any:
    """What a state of before there was such a thing says of it; None if there always was."""
    if type(part).__name__ in _LATER:
        value = getattr(part, name)
        return value[:0] if isinstance(value, np.ndarray) else type(value)()
    _, _, component, *rest = (*path.split("/"), "", "")
    if name in _LATER_FIELDS.get(component, ()) and rest[0] == "_columns":
        known = next(values[key] for key in values if key.startswith(path))
        field = declarations()[component].field(name)
        return np.full((known.shape[0], *part[name].shape[1:]), field.default, part[name].dtype)
    return None


def _fitting(value: Any, present: Any, key: str) -> Any:
    """A copy of a value that is of the kind of what is there now."""
    if isinstance(present, np.ndarray):
        is_text = present.dtype.kind == "S"  # as long as the longest
        if type(value) is not Column or (value.dtype != present.dtype and not is_text):
            raise StateError(
                f"this state's {key} is missing or laid out otherwise: it is of another version, or of none"
            )
        if value.shape[1:] != present.shape[1:]:
            raise StateError(f"this state's {key} is laid out otherwise: it is of another version, or of none")
        return value.array()
    if present is not None and value is not None and type(value) is not type(present) and type(value) is not Column:
        raise StateError(f"this state's {key} is a {type(value).__name__}, where a {type(present).__name__} stands")
    try:
        return value.array() if type(value) is Column else copied(value)
    except (TypeError, ComponentError) as error:
        raise StateError(f"this state's {key} cannot be used: {error}") from error


# What numbers in columns name rows of, so that a kernel would read beyond an end: column, its field, least, where the rows are.
_NAMES_ROWS: Final = (
    ("physics/colliders", "body", 0, "physics/bodies"),
    ("physics/bodies", "next_asleep", -1, "physics/bodies"),
    ("physics/joints", "body", -1, "physics/bodies"),
    ("physics/joints", "gear_row", -1, "physics/joints"),
    ("physics/pairs", "a", 0, "physics/colliders"),
    ("physics/pairs", "b", 0, "physics/colliders"),
    *(
        (f"world/hierarchy/{link}", "", 0, "world/allocator/ids")
        for link in ("parent", "first_child", "last_child", "previous_sibling", "next_sibling")
    ),
)
_EQUALLY_LONG: Final = (
    ("world/allocator/ids", "world/allocator/_next_ids", "world/hierarchy/parent", "world/hierarchy/child_count"),
    ("world/hierarchy/parent", "world/hierarchy/first_child", "world/hierarchy/last_child", "world/hierarchy/enabled"),
    ("physics/bodies", "physics/poses", "physics/mass", "physics/inertia", "physics/given_inertia", "physics/forces"),
    ("physics/colliders", "physics/shapes", "physics/proxies"),
    ("physics/pairs", "physics/manifolds"),
)


def _check_numbers(values: Mapping[str, Any]) -> None:
    """Refuses what would have kernels read where nothing is."""
    for several in _EQUALLY_LONG:
        lengths = {_length(values, key) for key in several}
        if len(lengths) > 1:
            raise StateError(f"this state contradicts itself: {', '.join(several)} are not equally long")
    for key, field, least, rows in _NAMES_ROWS:
        column = values[key].array()
        if field == "next_asleep":
            column = column[column["asleep"] != 0]  # who is awake is in no ring: what stands there is of another time
        elif field == "gear_row":
            column = column[column["kind"] == GEAR]
        _check_range(column[field] if field else column, least, _length(values, rows), key)
    for key in values:
        if not (key.startswith("world/_tables/") and key.endswith("/row_of")):
            continue
        table = key[: -len("row_of")]
        count = values[f"{table}count"]
        _check_range(values[key].array(), -1, count, key)
        columns = [name for name in values if name.startswith(f"{table}_columns/")]
        if any(
            _length(values, name) < count for name in (f"{table}_entities", *columns) if type(values[name]) is Column
        ):
            raise StateError(f"this state contradicts itself: {table[:-1]} has fewer rows than it counts")


def _length(values: Mapping[str, Any], key: str) -> int:
    column = values.get(key)
    if type(column) is not Column or not column.shape:
        raise StateError(f"this state lacks {key}: it is of another version")
    return column.shape[0]


def _check_range(numbers: Any, least: int, end: int, key: str) -> None:
    if numbers.size and not (least <= int(numbers.min()) and int(numbers.max()) < end):
        raise StateError(f"this state contradicts itself: {key} names rows that are not there")
