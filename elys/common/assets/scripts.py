"""Script files as assets: a file's text with those of the files it imports, so that a recording holds what ran.

A scene names a behaviour as `door.py#Door`, or `door.py` where the file has one. Reading runs nothing: a file that cannot be
understood is an asset like any other, and whoever wants to run it says what is wrong.
"""

from __future__ import annotations

import ast
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import msgspec

from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError, ElysError
from elys.common.scene_document import EntityRecord
from elys.common.scene_files import is_prefab_name, path_of

SCRIPT_SUFFIX: Final = ".py"
MOST_FILES: Final = 200
MOST_BYTES: Final = 4_000_000  # of all files together
SELF: Final = "self"  # the source of a script in a prefab that this script itself carries
ReadPrefab = Callable[[Path], list[EntityRecord]]
_log = logging.getLogger(__name__)


class ScriptBundle(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A behaviour and all files that its own one imports from beside it.

    Attributes:
        behaviour: the name of the class; "" for the only one in the file.
        main: the file it stands in.
        files: texts by name, "door.py", "parts/hinge.py".
        prefabs: those that texts in the files name, as they name them.
    """

    behaviour: str
    main: str
    files: dict[str, str]
    prefabs: dict[str, list[EntityRecord]] = {}


def read_script(path: Path, behaviour: str, assets: AssetStore, *, read_prefab: ReadPrefab | None = None) -> str:
    """Puts a script file, with what it imports, into the store and returns its reference.

    With `read_prefab` it also brings the prefabs that its texts name, relative to the script ("crate.prefab.json"). What is
    not there or wrong is said and left out.

    Raises:
        AssetError: the file is missing, is no UTF-8 text, or draws in too much.
    """
    files = {path.name: _read(path)}
    waiting = [path.name]
    while waiting:
        name = waiting.pop()
        for wanted in _imports(name, files[name]):
            found = path.parent / wanted
            if wanted not in files and found.is_file():
                files[wanted] = _read(found)
                waiting.append(wanted)
        if len(files) > MOST_FILES or sum(map(len, files.values())) > MOST_BYTES:
            raise AssetError(
                f"{path} imports more than {MOST_FILES} files or {MOST_BYTES / 1e6:g} MB from beside it: keep large data "
                "in files that are no scripts"
            )
    prefabs = _prefabs_in(files, path.parent, read_prefab) if read_prefab is not None else {}
    bundle = ScriptBundle(behaviour=behaviour, main=path.name, files=dict(sorted(files.items())), prefabs=prefabs)
    source = f"{path}#{behaviour}" if behaviour else str(path)
    return assets.put(msgspec.json.encode(bundle), kind="script", source=source)


def decode_script(data: bytes) -> ScriptBundle:
    """A bundle from its bytes; AssetError for what is none."""
    try:
        bundle = msgspec.json.decode(data, type=ScriptBundle)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise AssetError(f"this is no script ({error})") from error
    if bundle.main not in bundle.files:
        raise AssetError(f"this is no script: its file {bundle.main!r} is not in it")
    return bundle


def only_class(text: str) -> str:
    """The class that a script's text declares, where it declares one alone; else ""."""
    try:
        classes = [node.name for node in ast.parse(text).body if isinstance(node, ast.ClassDef)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ""
    return classes[0] if len(classes) == 1 else ""


def _read(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise AssetError(f"the script {path} cannot be read: {error.strerror}") from error
    if len(data) > MOST_BYTES:
        raise AssetError(f"the script {path} has {len(data) / 1e6:.1f} MB; a script may have {MOST_BYTES / 1e6:g} MB")
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise AssetError(f"the script {path} is no UTF-8 text (byte {error.start}): save it as UTF-8") from error


def _prefabs_in(files: dict[str, str], folder: Path, read_prefab: ReadPrefab) -> dict[str, list[EntityRecord]]:
    found = {}
    for name in sorted({text for file in files.values() for text in _texts(file) if is_prefab_name(text)}):
        path = path_of(name, folder)
        try:
            found[name] = read_prefab(path)
        except ElysError as error:
            _log.warning("the scripts in %s name the prefab %s, which cannot be had: %s", folder, name, error)
    return found


def _texts(text: str) -> Iterator[str]:
    """All texts that stand in a script by themselves."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def _imports(name: str, text: str) -> list[str]:
    """The files beside a script that its imports may mean; none where it cannot be understood."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    modules: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            package = list(Path(name).parent.parts)
            above = package[: max(0, len(package) - node.level + 1)] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            modules += [part for part in (base, *(f"{base}.{alias.name}".strip(".") for alias in node.names)) if part]
    return [candidate for module in dict.fromkeys(modules) for candidate in _files_of(module)]


def _files_of(module: str) -> list[str]:
    """The names that a module's file, and those of the packages around it, may have."""
    parts = module.split(".")
    packages = ["/".join([*parts[: number + 1], "__init__.py"]) for number in range(len(parts))]
    return ["/".join(parts) + SCRIPT_SUFFIX, *packages]
