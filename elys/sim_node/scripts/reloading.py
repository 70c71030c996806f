"""Follows script files on the disk: what is saved anew runs on in the new version, as an edit of the scene like any other.

The edit is a command of the session, so a recording holds it, and who repeats the session reloads at the same tick. A version
that cannot be loaded changes nothing but the console: what ran goes on.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from elys.bus.messages.commands import Batch, Command, SetComponent
from elys.common.assets.scripts import decode_script
from elys.common.assets.store import is_reference
from elys.common.components import Script
from elys.common.errors import AssetError, ScriptError
from elys.common.ids import Entity
from elys.common.scene import read_script_file
from elys.common.scene_files import path_of
from elys.sim_node.simulation import Simulation

INTERVAL: Final = 0.25  # [s] between two looks at the files
ABSENCE: Final = 2.0  # [s] after which a file is gone: an editor that saves by renaming has it back sooner
SCRIPT_FILES: Final = "script files"  # who asks for such an edit
_log = logging.getLogger(__name__)


class ScriptFiles:
    """The files of the scripts that run."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._seen: dict[Path, tuple[int, int]] = {}
        self._missed: dict[Path, float] = {}  # when files that were there are said to be gone, by `time.monotonic`
        self._refused: set[str] = set()  # contents that could not be loaded

    async def follow(self, put: Callable[[Command], object]) -> None:
        """Puts a command for every script that was saved anew, until cancelled."""
        while True:
            await asyncio.sleep(INTERVAL)
            for source, entities in self._users().items():
                path, files = self._files_of(source)
                if path is None or not await asyncio.to_thread(self._have_changed, files):
                    continue
                command = self.reloaded(source, entities)
                if command is not None:
                    put(command)

    def reloaded(self, source: str, entities: list[int]) -> Command | None:
        """The command that puts the file as it is now in the place of a script; None if it is the same or cannot be loaded."""
        assets = self._simulation.assets
        place, _, behaviour = assets.source(source).partition("#")
        try:
            new = read_script_file(Path(place), behaviour, assets)
        except AssetError as error:
            _log.warning("%s", error)
            return None
        if new == source or new in self._refused:
            return None
        try:
            self._simulation.scripts.loaded(new)
        except ScriptError as error:
            self._refused.add(new)
            _log.error("%s was saved, and the version before goes on: %s", Path(place).name, error)
            return None
        _log.info("%s was saved: %d scripts go on in the new version", Path(place).name, len(entities))
        edits = tuple(SetComponent(entity=entity, component="Script", values={"source": new}) for entity in entities)
        return edits[0] if len(edits) == 1 else Batch(edits=edits)

    def _users(self) -> dict[str, list[int]]:
        world = self._simulation.world
        users: dict[str, list[int]] = {}
        for entity in world.query(Script).entities.tolist():
            users.setdefault(world.get(Entity(entity), Script).source, []).append(entity)
        return users

    def _files_of(self, source: str) -> tuple[Path | None, list[Path]]:
        assets = self._simulation.assets
        place = assets.source(source).partition("#")[0] if is_reference(source) else ""
        if not place:
            return None, []
        try:
            bundle = decode_script(assets.get(source))
        except AssetError:
            return None, []
        folder = Path(place).parent
        return Path(place), [path_of(name, folder) for name in (*bundle.files, *bundle.prefabs)]

    def _have_changed(self, files: list[Path]) -> bool:
        has_changed = False
        for path in files:
            try:
                facts = path.stat()
            except OSError:
                self._miss(path)
                continue
            self._missed.pop(path, None)
            stamp = (facts.st_mtime_ns, facts.st_size)
            has_changed |= self._seen.setdefault(path, stamp) != stamp
            self._seen[path] = stamp
        return has_changed

    def _miss(self, path: Path) -> None:
        """Says once that a file is gone, where it was there before: scripts out of a recording never had one."""
        if path in self._seen and time.monotonic() >= self._missed.setdefault(path, time.monotonic() + ABSENCE):
            self._missed[path] = math.inf
            _log.warning(
                "%s is gone: its scripts go on as they were loaded. Put it back, or the scene cannot be opened again",
                path,
            )
