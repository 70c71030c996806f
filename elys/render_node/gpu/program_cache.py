"""Programs by their files and definitions, compiled when first asked for, and anew when a file changes.

What does not compile is said once, and stood in for: what it should have drawn is magenta, in its place where that can be.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Final

from elys.common.errors import ShaderError
from elys.render_node.gpu.context import Context
from elys.render_node.gpu.program import SHADERS, Program, files_of

RELOAD_VARIABLE: Final = (
    "ELYS_RELOAD_SHADERS"  # set to anything: changed shader files are compiled anew between two pictures
)
Key = tuple[str, str, tuple[str, ...], tuple[str, ...]]
_STAND_IN: Final = "stand_in.frag"
# Vertex shaders whose place another can take, which draws meshes as they are at rest: with which definitions.
_PLACED: Final[Mapping[str, tuple[str, ...]]] = {"shaded.vert": (), "depth.vert": ("TO_TARGET",)}
# Fragment shaders that give light, which is exposed later, unless they put colours of the screen into the picture themselves.
_LIGHT: Final = frozenset({"shaded.frag", "ghost.frag", "sky.frag", "grid.frag", "mark_lines.frag"})
_log = logging.getLogger(__name__)


class ProgramCache:
    """All programs of a context. Ask again for each picture: who keeps a program keeps the one before a change.

    Attributes:
        gives_stand_ins: whether what does not compile is stood in for. Where numbers are wanted magenta would be a lie.
    """

    def __init__(self, context: Context, *, reload: bool | None = None) -> None:
        """`reload` says whether files are watched; None leaves that to the environment variable RELOAD_VARIABLE."""
        self._context = context
        self._reloads = bool(os.environ.get(RELOAD_VARIABLE)) if reload is None else reload
        self._programs: dict[Key, Program] = {}
        self._refused: dict[Key, ShaderError] = {}  # those that do not compile; some have a stand-in among the programs
        self._times: dict[str, int] = {}
        self._said: set[str] = set()  # of many variants of a shader the same is wrong
        self.gives_stand_ins = True

    def program(
        self, vertex: str, fragment: str, defines: tuple[str, ...] = (), *, captured: tuple[str, ...] = ()
    ) -> Program:
        """The program of two shader files, or of one that captures, compiled when first used; or what stands in for it.

        Raises:
            ShaderError: it does not compile, and nothing may stand in for it or can.
        """
        key = (vertex, fragment, defines, captured)
        program = self._programs.get(key)
        if program is None and key not in self._refused:
            self._first(key)
            program = self._programs.get(key)
        refusal = self._refused.get(key)
        if refusal is not None:
            if self.gives_stand_ins:
                self._say(f"what a shader should draw is magenta: {refusal}")
            if program is None or not self.gives_stand_ins:
                raise refusal
        assert program is not None
        return program

    def __contains__(self, program: Program) -> bool:
        """Whether a program is what would be given for its files and definitions now."""
        return any(known is program for known in self._programs.values())

    @contextlib.contextmanager
    def exact(self) -> Iterator[None]:
        """Lets nothing stand in for what does not compile meanwhile."""
        before, self.gives_stand_ins = self.gives_stand_ins, False
        try:
            yield
        finally:
            self.gives_stand_ins = before

    def reload_changed(self) -> list[str]:
        """Compiles anew what was made of files that have changed since; returns those files.

        What does not compile stays as it was, and the log says file, line and source line.
        """
        if not self._reloads:
            return []
        changed = [file for file, time in self._times.items() if _changed_at(file) != time]
        if not changed:
            return []
        for file in changed:
            self._times[file] = _changed_at(file)
        self._said.clear()
        for key in [key for key in {**self._programs, **self._refused} if not self._files(key).isdisjoint(changed)]:
            try:
                program = self._compiled(key)
            except ShaderError as error:
                if key in self._refused:
                    self._refuse(key, error)
                else:
                    self._say(f"kept the program before: {error}")
            else:
                self._programs[key] = program
                self._refused.pop(key, None)
            self._watch(key)
        return changed

    def _first(self, key: Key) -> None:
        try:
            self._programs[key] = self._compiled(key)
        except ShaderError as error:
            self._refuse(key, error)
        self._watch(key)

    def _refuse(self, key: Key, error: ShaderError) -> None:
        """Notes that it does not compile, and takes what stands in for it, if anything can."""
        self._refused[key] = error
        stand_in = self._stand_in(key)
        if stand_in is not None:
            self._programs[key] = stand_in

    def _compiled(self, key: Key) -> Program:
        vertex, fragment, defines, captured = key
        return Program(self._context, vertex, fragment, defines=defines, captured=captured)

    def _stand_in(self, key: Key) -> Program | None:
        vertex, fragment, defines, captured = key
        if captured:
            return None
        exposed = ("EXPOSED",) if fragment in _LIGHT and "TO_SCREEN" not in defines else ()
        candidates = [(vertex, (*defines, *exposed))]
        if vertex in _PLACED:
            candidates.append(("stand_in.vert", (*_PLACED[vertex], *exposed)))
        for candidate, with_defines in candidates:
            with contextlib.suppress(ShaderError):  # said already, by the shader that it stands in for
                return Program(self._context, candidate, _STAND_IN, defines=with_defines)
        return None

    def _say(self, sentence: str) -> None:
        if sentence not in self._said:
            self._said.add(sentence)
            _log.error("%s", sentence)

    def _files(self, key: Key) -> frozenset[str]:
        return files_of(*key[:2]) if key in self._refused else self._programs[key].files

    def _watch(self, key: Key) -> None:
        if self._reloads:
            for file in self._files(key):
                self._times.setdefault(file, _changed_at(file))


def _changed_at(file: str) -> int:
    try:
        return Path(str(resources.files(SHADERS).joinpath(file))).stat().st_mtime_ns
    except OSError:
        return 0  # an editor that is just writing it, or an installation in an archive
