"""Files of edits: a JSON list of commands as they go over the bus, in which entities may be called by their names."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import msgspec

from elys.bus.messages.commands import Batch, Edit, Grab, LoadScene, Release, Tell
from elys.common.errors import ElysError, SceneError
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_edits import apply_again

Change = Edit | Batch | LoadScene | Grab | Release | Tell  # what changes how a session goes on
_NAMED: Final = ("entity", "parent")
_MOST: Final = 16 << 20  # [bytes]


def read_edits(path: Path, simulation: Simulation) -> tuple[Change, ...]:
    """The edits of a file, for a simulation: tried there, in order, and it is left as it was.

    Raises:
        SceneError: the file cannot be read, or one of them is wrong: which, and why.
    """
    try:
        if path.stat().st_size > _MOST:
            raise SceneError(f"{path} is larger than {_MOST >> 20} MB: it holds no edits")
        items = msgspec.json.decode(path.read_bytes())
    except OSError as error:
        raise SceneError(f"the edits {path} cannot be read: {error.strerror}") from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SceneError(f"{path} is no JSON: {error}") from error
    if not isinstance(items, list):
        raise SceneError(
            f"{path} must be a list of commands, as {{'type': 'rename', 'entity': 'Ball', 'name': 'Bullet'}}"
        )
    state = simulation.capture()
    edits = []
    try:
        for number, item in enumerate(items, 1):
            try:
                edits.append(msgspec.convert(_with_ids(item, simulation), Change))
                apply_again(simulation, edits[-1])
                simulation.settle()
            except (ElysError, msgspec.ValidationError) as error:
                raise SceneError(f"edit {number} of {path}: {error}") from error
    finally:
        simulation.restore(state)
    return tuple(edits)


def edits_schema() -> dict[str, Any]:
    """The JSON Schema of such a file."""
    (schema,), definitions = msgspec.json.schema_components((list[Change],), ref_template="#/$defs/{name}")
    for definition in definitions.values():
        for name in _NAMED:
            if definition.get("properties", {}).get(name, {}).get("type") == "integer":
                definition["properties"][name] = {"anyOf": [definition["properties"][name], {"type": "string"}]}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "$defs": definitions}


def _with_ids(item: Any, simulation: Simulation) -> Any:
    """A command in which names of entities are their ids."""
    if not isinstance(item, dict):
        return item
    named: dict[str, Any] = {
        name: _id_of(value, simulation) for name, value in item.items() if name in _NAMED and isinstance(value, str)
    }
    if item.get("type") == "batch" and isinstance(item.get("edits"), list):
        named["edits"] = [_with_ids(edit, simulation) for edit in item["edits"]]
    return {**item, **named}


def _id_of(name: str, simulation: Simulation) -> int:
    hierarchy = simulation.world.hierarchy
    found = [entity for entity in simulation.world.entities().tolist() if hierarchy.name_of(entity) == name]
    if len(found) == 1:
        return int(found[0])
    if not found:
        raise SceneError(f"there is no entity called '{name}' at that time")
    raise SceneError(
        f"{len(found)} entities are called '{name}': say which by its id, one of {', '.join(map(str, found[:8]))}"
    )
