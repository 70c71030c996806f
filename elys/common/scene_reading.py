"""From a scene file's text to a SceneDocument, or to one sentence that says which line or place is wrong."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final, NoReturn

import msgspec

from elys.common.components import Kind, check_value, declaration_of, declarations
from elys.common.components.decimals import FLOAT32_MAX
from elys.common.errors import ComponentError, SceneError
from elys.common.scene_document import (
    SCENE_VERSION,
    ComponentChanges,
    EntityNode,
    SceneDocument,
    SceneSettings,
)
from elys.common.scene_files import PREFAB_SUFFIX

SCENE_SUFFIX: Final = ".scene.json"
MAX_FILE_SIZE: Final = 1 << 28  # [B]
MAX_DEPTH: Final = 128  # entities inside entities in one file

_DOCUMENT_KEYS: Final = ("elys_scene", "name", "settings", "entities")
_SETTINGS_KEYS: Final = SceneSettings.__struct_fields__
_ENTITY_KEYS: Final = ("name", "enabled", "prefab", "components", "overrides", "children")


def read_scene(path: str | Path) -> SceneDocument:
    """The document in a `.scene.json` or `.prefab.json` file.

    Raises:
        SceneError: the file is missing, unreadable or not a scene; the sentence names file, place and what was expected.
    """
    path = Path(path)
    text = _read_text(path)
    try:
        return parse_scene(text, is_prefab=path.name.endswith(PREFAB_SUFFIX))
    except _SyntaxError as error:
        raise SceneError(f"{path}:{error}") from None
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def parse_scene(text: str, *, is_prefab: bool = False) -> SceneDocument:
    """The document in the text of a scene file; raises SceneError without naming a file."""
    tree = _parse_json(text)
    document = _table(tree, "")
    version = document.get("elys_scene")
    if version is None:
        _fail("", f'not a scene of ELYS: it has no "elys_scene": {SCENE_VERSION} at its top')
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        _fail("elys_scene", f"must be {SCENE_VERSION}, not {_shown(version)}")
    if version > SCENE_VERSION:
        _fail("elys_scene", f"scene version {version} is newer than this ELYS reads ({SCENE_VERSION}); update ELYS")
    _known_keys(document, _DOCUMENT_KEYS, "", "a scene")
    entities = _list(document.get("entities", []), "entities")
    if is_prefab and len(entities) != 1:
        _fail("entities", f"a prefab has exactly one root entity, this one {len(entities)}")
    return SceneDocument(
        name=_text(document.get("name", ""), "name"),
        settings=_settings(document.get("settings", {})),
        entities=[_entity(entity, f"entities[{index}]", 1) for index, entity in enumerate(entities)],
    )


class _SyntaxError(SceneError):
    """Text that is not JSON; starts with line:column."""


def _read_text(path: Path) -> str:
    try:
        if path.is_dir():
            raise SceneError(f"{path} is a directory, not a scene file{_scenes_near(path)}")
        size = path.stat().st_size
        if size > MAX_FILE_SIZE:
            raise SceneError(f"{path} has {size / 2**20:.0f} MiB; a scene file has at most {MAX_FILE_SIZE >> 20} MiB")
        data = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"there is no scene file {path}{_scenes_near(path)}") from None
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:  # a NUL byte in the path
        raise SceneError(f"{str(path)!r} is not a path: {error}") from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SceneError(
            f"{path} is not a scene file: scene files are JSON in UTF-8, byte {error.start} in line {line} is not"
        ) from None


def _scenes_near(path: Path) -> str:
    """A remedy for a missing file: the closest of the scene files beside it."""
    directory = path if path.is_dir() else path.parent
    try:
        names = sorted(p.name for p in directory.iterdir() if p.name.endswith((SCENE_SUFFIX, ".gltf", ".glb")))
    except OSError:
        return ""
    if not names:
        return ""
    close = difflib.get_close_matches(path.name, names, n=3, cutoff=0.5) or names[:3]
    return f"; did you mean {' or '.join(close)}?" if path != directory else f"; there is {', '.join(close)} in it"


def _parse_json(text: str) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        reason = "the file is empty" if not text.strip() else error.msg[:1].lower() + error.msg[1:]
        raise _SyntaxError(f"{error.lineno}:{error.colno}: not JSON: {reason}") from None
    except RecursionError:
        raise SceneError(f"brackets are nested too deeply; entities go at most {MAX_DEPTH} deep") from None
    except ValueError as error:  # from the hooks, or a number of thousands of digits
        raise SceneError(f"not JSON: {error}") from None


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) != len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {_shown(key)} stands twice in one object")
            seen.add(key)
    return table


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number that JSON knows")


def _settings(value: Any) -> SceneSettings:
    table = _table(value, "settings")
    _known_keys(table, _SETTINGS_KEYS, "settings", "the settings of a scene")
    try:
        return msgspec.convert(table, SceneSettings)
    except msgspec.ValidationError as error:
        reason, _, where = str(error).partition(" - at `$.")
        _fail(f"settings.{where.rstrip('`')}", reason[:1].lower() + reason[1:])
    except OverflowError:
        _fail("settings", "a number is too large")


def _entity(value: Any, where: str, depth: int) -> EntityNode:
    if depth > MAX_DEPTH:
        raise SceneError(f"entities are nested more than {MAX_DEPTH} deep")
    table = _table(value, where)
    _known_keys(table, _ENTITY_KEYS, where, "an entity")
    prefab = _text(table.get("prefab", ""), f"{where}.prefab")
    if "prefab" in table and not prefab:
        _fail(f"{where}.prefab", "must name a file, not be empty")
    if table.get("overrides") and not prefab:
        _fail(f"{where}.overrides", "only an entity with a prefab has overrides")
    enabled = table.get("enabled", True)
    if not isinstance(enabled, bool):
        _fail(f"{where}.enabled", f"must be true or false, not {_shown(enabled)}")
    overrides = _table(table.get("overrides", {}), f"{where}.overrides")
    children = _list(table.get("children", []), f"{where}.children")
    return EntityNode(
        name=_text(table.get("name", ""), f"{where}.name"),
        enabled=enabled,
        prefab=prefab,
        components=_components(table.get("components", {}), f"{where}.components", removable=bool(prefab)),
        overrides={
            _text(path, f"{where}.overrides"): _components(
                changes, f"{where}.overrides[{_shown(path)}]", removable=True
            )
            for path, changes in overrides.items()
        },
        children=[_entity(child, f"{where}.children[{index}]", depth + 1) for index, child in enumerate(children)],
    )


def _components(value: Any, where: str, *, removable: bool) -> ComponentChanges:
    table = _table(value, where)
    for name, fields in table.items():
        if name not in declarations():
            _fail(f"{where}.{name}", f"there is no such component{_near_miss(name, declarations())}")
        if fields is None and removable:
            continue
        check_fields(name, _table(fields, f"{where}.{name}"), f"{where}.{name}")
    return table


def check_fields(component: str, values: Mapping[str, Any], where: str) -> None:
    """Raises SceneError, naming the place `where` the values stand, unless all are what the component's fields take."""
    declaration = declaration_of(component)
    known = {field.name: field for field in declaration.fields}
    for name, value in values.items():
        field = known.get(name)
        if field is None:
            _fail(f"{where}.{name}", f"{component} has no such field{_near_miss(name, known)}")
        if field.kind is Kind.ENTITY:
            _entity_name(value, f"{where}.{name}")
            continue
        if field.kind is Kind.VALUES and isinstance(value, dict):  # null takes away what a prefab says
            value = {key: item for key, item in value.items() if item is not None}
        try:
            checked = check_value(declaration, field, value)
        except ComponentError as error:
            reason = str(error).removeprefix(f"{component}.{name} ")
            _fail(f"{where}.{name}", reason if len(reason) <= 200 else f"{reason[:197]}...")
        except ValueError:  # a whole number too long to be shown
            _fail(f"{where}.{name}", "the number is too large")
        numbers = checked if isinstance(checked, tuple) else (checked,)
        for number in numbers if field.kind is not Kind.CURVE else ():  # which are checked already
            if field.dtype == "f4" and abs(number) > FLOAT32_MAX:
                _fail(f"{where}.{name}", f"must fit 32 bits (3.4e38), not {number:g}")
        _plain_text(value, f"{where}.{name}")


def _entity_name(value: Any, where: str) -> None:
    """In a file nobody has an id: entities are called by name."""
    if isinstance(value, str) or (value == 0 and not isinstance(value, bool)):
        _plain_text(value, where)
        return
    _fail(where, f'must be the name of an entity, as "Door" or "House/Door", or "" for none, not {_shown(value)}')


def _known_keys(table: Mapping[str, Any], known: Iterable[str], where: str, owner: str) -> None:
    for key in table:
        if key not in known:
            place = f"{where}.{key}" if where else key
            _fail(place, f"{owner} has no such field{_near_miss(key, known)}")


def _near_miss(name: str, known: Iterable[str]) -> str:
    names = list(known)
    by_lower = {candidate.lower(): candidate for candidate in names}
    close = difflib.get_close_matches(name.lower(), list(by_lower), n=1, cutoff=0.6)
    return f"; did you mean '{by_lower[close[0]]}'?" if close else f"; known are {', '.join(names)}"


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        _fail(where, f"must be an object {{...}}, not {_shown(value)}")
    return value


def _list(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        _fail(where, f"must be a list [...], not {_shown(value)}")
    return value


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str):
        _fail(where, f"must be a text, not {_shown(value)}")
    _plain_text(value, where)
    return value


def _plain_text(value: Any, where: str) -> None:
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            _fail(where, "holds half of a surrogate pair, which is no character")


def _shown(value: Any) -> str:
    """A value as JSON, cut to what fits in a sentence."""
    match value:
        case dict():
            return "an object {...}"
        case list():
            return "a list [...]"
        case int() | float() if not isinstance(value, bool) and abs(value) > 1e15:
            return "a huge number"
        case _:
            text = json.dumps(value)
            return text if len(text) <= 60 else f"{text[:57]}..."


def _fail(where: str, problem: str) -> NoReturn:
    raise SceneError(f"{where}: {problem}" if where else problem)
