"""The layer that hears of files which are dragged here from another program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from elys.editor_node.events import Event, FilesDropped


class FileDropLayer:
    """Hands them on to who imports them."""

    def __init__(self, take: Callable[[Sequence[Path]], None]) -> None:
        self._take = take

    def on_event(self, event: Event) -> bool:
        """Consumes what is dropped."""
        match event:
            case FilesDropped(paths):
                self._take([Path(path) for path in paths])
                return True
        return False

    def update(self, elapsed: float) -> None:
        """Nothing of it is drawn."""
