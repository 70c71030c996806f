"""A render node whose driver loses the context after its first picture, unless the file MARK is there, which it then makes.

python losing_render.py ENDPOINT MARK
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from elys.render_node.gpu import Context
from elys.verbs import nodes


class LosingDriver:
    """moderngl's context, but for what it says of errors."""

    def __init__(self, gl: Any, mark: Path) -> None:
        self._gl, self._mark, self._is_lost = gl, mark, False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._gl, name)

    @property
    def error(self) -> str:
        """As a driver says it that has lost everything: now and ever after."""
        said = "GL_UNKNOWN_ERROR" if self._is_lost else self._gl.error
        return str(said)

    def lose(self) -> None:
        """Loses the context, once in the life of the mark."""
        if not self._mark.exists():
            self._mark.touch()
            self._is_lost = True


endpoint, mark = sys.argv[1], Path(sys.argv[2])
prepare, collect = Context.__init__, Context.collect


def wrapped(self: Context, gl: Any) -> None:
    prepare(self, LosingDriver(gl, mark))


def losing(self: Context) -> None:
    """Called after each picture, before errors are looked for: the second one fails."""
    collect(self)
    self.pictures = getattr(self, "pictures", 0) + 1  # type: ignore[attr-defined]
    if self.pictures == 2:  # type: ignore[attr-defined]
        self.gl.lose()


Context.__init__ = wrapped  # type: ignore[method-assign]
Context.collect = losing  # type: ignore[method-assign]
nodes.render(endpoint)
