"""All script files that a simulation has loaded, each version once."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from elys.common.assets.prefabs import decode_prefab
from elys.common.assets.scripts import SELF, decode_script, only_class
from elys.common.assets.store import AssetStore, is_reference
from elys.common.components.declaration import FieldDeclaration
from elys.common.errors import AssetError, ScriptError
from elys.common.scene_document import EntityRecord
from elys.common.scene_files import PIECES_FOLDER
from elys.common.trust import is_trusted
from elys.sim_node.scripts.behaviour import HOOKS, Behaviour, fields_of
from elys.sim_node.scripts.checking import require_hooks
from elys.sim_node.scripts.doubts import Doubt, doubts_of
from elys.sim_node.scripts.modules import ScriptModules
from elys.sim_node.scripts.program import Program
from elys.sim_node.scripts.script_text import ScriptText
from elys.sim_node.scripts.typed_events import classes_heard_by, module_names

_PRELUDE: Final = Path(__file__).with_name("prelude.py")
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedScript:
    """A behaviour's class, as one version of its files has it.

    Attributes:
        source: what the component says: a reference to content.
        name: how sentences call it, "door.py:Door".
        hooks: those that it writes itself.
        prefabs: those that it brings, as its texts name them.
        events: the classes of those that `on_event` takes; () for all.
    """

    source: str
    name: str
    behaviour: type[Behaviour]
    fields: dict[str, FieldDeclaration]
    modules: ScriptModules
    hooks: frozenset[str]
    prefabs: dict[str, list[EntityRecord]]
    events: tuple[type[Any], ...] = ()


class ScriptLibrary:
    """Loads behaviours from an asset store. What could not be loaded is not tried again: other content has another name."""

    def __init__(self, assets: AssetStore) -> None:
        self._assets = assets
        self._loaded: dict[str, LoadedScript | ScriptError] = {}
        self._called: dict[str, tuple[str, str]] = {}  # file and class by source
        self._prelude = ScriptModules.of_file(_PRELUDE)
        self._doubts: set[Doubt] = set()  # that have been said

    def load(self, source: str) -> LoadedScript:
        """The behaviour that a Script component names.

        Raises:
            ScriptError: there is no such file or class, or it cannot be run: file, line, what to do.
        """
        if source not in self._loaded:
            try:
                self._loaded[source] = self._read(source)
            except ScriptError as error:
                self._loaded[source] = error
        found = self._loaded[source]
        if isinstance(found, ScriptError):
            raise ScriptError(str(found))
        return found

    def require_trusted(self, source: str) -> None:
        """Raises ScriptError for a script that nobody has said may run."""
        path = self._path_of(source)
        if not path.name and self._is_ours(source):
            return
        if path.name and not is_trusted(str(path)):
            raise ScriptError(
                f"scripts in {path.parent} are not trusted, so nothing of them is run: if you know who wrote them, add --trust, "
                f"or say `elys trust {path.parent}` once"
            )
        if not path.name and not is_trusted(""):
            raise ScriptError(
                "the scripts that came with it are not trusted, so nothing of them is run: if you know who wrote them, "
                "add --trust"
            )

    def prelude(self, name: str) -> Program:
        """An async function of prelude.py."""
        return next(program for (called, _), program in self._prelude.programs.items() if called.endswith(f":{name}"))

    def program(self, name: str, digest: str) -> Program:
        """An async function of any version that is loaded; ScriptError if there is none."""
        for modules in (self._prelude, *(script.modules for script in self._scripts())):
            if (name, digest) in modules.programs:
                return modules.programs[name, digest]
        raise ScriptError(f"{name.replace(':', ', ')} was changed or taken away since it began")

    def record(self, name: str, source: str) -> type[Any] | None:
        """A class that the files of a script declare."""
        found = self._loaded.get(source)
        return found.modules.record(name) if isinstance(found, LoadedScript) else None

    def name_of_record(self, kind: type[Any]) -> tuple[str, str] | None:
        """The source and the name of a class that a loaded script declares."""
        for script in self._scripts():
            if (name := script.modules.name_of(kind)) is not None:
                return script.source, name
        return None

    def names_beside(self, kind: type[Any]) -> Mapping[str, Any]:
        """What the module knows that declares a class."""
        for script in self._scripts():
            if script.modules.name_of(kind) is not None:
                return script.modules.names_of(kind)
        return module_names(kind)

    def prefab(self, name: str, source: str) -> list[EntityRecord]:
        """The records of a prefab that a script names; ScriptError if there is none here."""
        if is_reference(name):
            try:
                return _with_source(decode_prefab(self._assets.get(name)), source)
            except AssetError as error:
                raise ScriptError(str(error)) from error
        found = self._loaded.get(source)
        carried = found.prefabs if isinstance(found, LoadedScript) else {}
        if name in carried:
            return _with_source(carried[name], source)
        raise ScriptError(
            f"there is no prefab {name!r} with the script, which brings {', '.join(carried) or 'none'}: a file of that name "
            "must lie beside it, and the name must stand in the script as one text, or be a field's value in the scene"
        )

    def is_called(self, source: str, file: str, behaviour: str) -> bool:
        """Whether a script is that of a file, and of a class in it if one is named: by its content, the same in each run."""
        if source not in self._called:
            try:
                bundle = decode_script(self._assets.get(source))
                self._called[source] = bundle.main, bundle.behaviour or only_class(bundle.files[bundle.main])
            except AssetError:
                self._called[source] = "", ""
        main, own = self._called[source]
        return main == file and behaviour in ("", own)

    def place_of(self, source: str) -> str:
        """What tracebacks call the file of a script."""
        path = self._path_of(source)
        return str(path) if path.name else decode_script(self._assets.get(source)).main

    def _is_ours(self, source: str) -> bool:
        """Whether a script that came with a recording is, text for text, one that ELYS brings."""
        try:
            files = decode_script(self._assets.get(source)).files
        except AssetError:
            return False
        return any(_is_in(folder, files) for folder in (PIECES_FOLDER, *PIECES_FOLDER.iterdir()) if folder.is_dir())

    def _scripts(self) -> list[LoadedScript]:
        return [script for script in self._loaded.values() if isinstance(script, LoadedScript)]

    def _path_of(self, source: str) -> Path:
        """The file that a script came from; one without a name if it came from none here."""
        return Path(self._assets.source(source).partition("#")[0])

    def _say_doubts(self, behaviour: type[Behaviour], text: ScriptText) -> None:
        """Says what is hardly meant, once of each version of a file, however many scripts are made of it."""
        for doubt in doubts_of(behaviour, text):
            if doubt not in self._doubts:
                self._doubts.add(doubt)
                _log.warning("%s", doubt.sentence)

    def _read(self, source: str) -> LoadedScript:
        if not source:
            raise ScriptError("its component names no script: give file.py#Class")
        if not is_reference(source):
            raise ScriptError(
                f"there is no script {source} that could be read: it is looked for beside the scene's file as that is opened"
            )
        try:
            bundle = decode_script(self._assets.get(source))
        except AssetError as error:
            raise ScriptError(str(error)) from error
        self.require_trusted(source)
        path = self._path_of(source)
        places = {name: str(path.parent / name) for name in bundle.files} if path.name else {}
        modules = ScriptModules(bundle, places)
        behaviour = modules.behaviour()
        text = modules.text()
        fields = fields_of(behaviour, modules.names_of(behaviour), text.place_of)
        require_hooks(behaviour, text)
        self._say_doubts(behaviour, text)
        hooks = frozenset(name for name in HOOKS if getattr(behaviour, name) is not getattr(Behaviour, name))
        return LoadedScript(
            source=source,
            name=f"{bundle.main}:{behaviour.__name__}",
            behaviour=behaviour,
            fields={declared.name: declared for declared in fields},
            modules=modules,
            hooks=hooks,
            prefabs=bundle.prefabs,
            events=classes_heard_by(behaviour, modules.names_of(behaviour)),
        )


def _with_source(records: list[EntityRecord], source: str) -> list[EntityRecord]:
    """Where a carried prefab has the script itself that carries it."""
    return [
        msgspec.structs.replace(record, components={**record.components, "Script": {**script, "source": source}})
        if (script := record.components.get("Script", {})).get("source") == SELF
        else record
        for record in records
    ]


def _is_in(folder: Path, files: dict[str, str]) -> bool:
    """Whether a folder has all these files, text for text; their names may be a stranger's, and lead elsewhere."""
    try:
        paths = {Path(os.path.normpath(folder / name)): text for name, text in files.items()}
        return all(path.is_relative_to(folder) and path.read_text("utf-8") == text for path, text in paths.items())
    except (OSError, ValueError):
        return False
