"""Programs by their files and definitions, compiled when first asked for, and anew when a file changes."""

from __future__ import annotations

import logging
import os
from importlib import resources
from pathlib import Path
from typing import Final

from elys.common.errors import DisplayError
from elys.render_node.gpu.context import Context
from elys.render_node.gpu.program import SHADERS, Program

RELOAD_VARIABLE: Final = (
    "ELYS_RELOAD_SHADERS"  # set to anything: changed shader files are compiled anew between two pictures
)
Key = tuple[str, str, tuple[str, ...], tuple[str, ...]]
_log = logging.getLogger(__name__)


class ProgramCache:
    """All programs of a context. Ask again for each picture: who keeps a program keeps the one before a change."""

    def __init__(self, context: Context, *, reload: bool | None = None) -> None:
        """`reload` says whether files are watched; None leaves that to the environment variable RELOAD_VARIABLE."""
        self._context = context
        self._reloads = bool(os.environ.get(RELOAD_VARIABLE)) if reload is None else reload
        self._programs: dict[Key, Program] = {}
        self._times: dict[str, int] = {}

    def program(
        self, vertex: str, fragment: str, defines: tuple[str, ...] = (), *, captured: tuple[str, ...] = ()
    ) -> Program:
        """The program of two shader files, or of one that captures, compiled when first used. Raises DisplayError."""
        key = (vertex, fragment, defines, captured)
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = self._compiled(key)
            if self._reloads:
                for file in program.files:
                    self._times.setdefault(file, _changed_at(file))
        return program

    def __contains__(self, program: Program) -> bool:
        """Whether a program is what would be given for its files and definitions now."""
        return any(known is program for known in self._programs.values())

    def reload_changed(self) -> list[str]:
        """Compiles anew what was made of files that have changed since; returns those files.

        What does not compile stays as it was, and the log says file, line and source line.
        """
        if not self._reloads:
            return []
        changed = [file for file, time in self._times.items() if _changed_at(file) != time]
        for file in changed:
            self._times[file] = _changed_at(file)
        for key, program in list(self._programs.items()):
            if not program.files.isdisjoint(changed):
                try:
                    self._programs[key] = self._compiled(key)
                except DisplayError as error:
                    _log.error("kept the program before: %s", error)
        return changed

    def _compiled(self, key: Key) -> Program:
        vertex, fragment, defines, captured = key
        return Program(self._context, vertex, fragment, defines=defines, captured=captured)


def _changed_at(file: str) -> int:
    try:
        return Path(str(resources.files(SHADERS).joinpath(file))).stat().st_mtime_ns
    except OSError:
        return 0  # an editor that is just writing it, or an installation in an archive
