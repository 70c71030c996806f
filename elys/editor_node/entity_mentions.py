"""Which entity a line of the console speaks of: by its id, by its name in quotes, or by its name alone."""

from __future__ import annotations

import re
from typing import Final

from elys.editor_node.scene_mirror import EditorScene

LONGEST_NAME: Final = 8  # words of a name that is looked for without quotes
_IDS: Final = re.compile(r"\bentity\s+(\d+)\b|#(\d+)\b", re.IGNORECASE)
_QUOTED: Final = re.compile(r"'([^'\n]+)'|\"([^\"\n]+)\"|“([^”\n]+)”|«\s*([^»\n]+?)\s*»")
_WORDS: Final = re.compile(r"[^\s,;:()\[\]'\"]+")


class EntityMentions:
    """Finds entities in texts; the index of names is made anew only when the tree changed and somebody asks."""

    def __init__(self, scene: EditorScene) -> None:
        self._scene = scene
        self._version: tuple[int, int] = (-1, -1)
        self._by_name: dict[str, int] = {}

    def find(self, text: str) -> int:
        """The entity that a text names, 0 for none: ids first, then names in quotes, then the longest name in it."""
        for match in _IDS.finditer(text):
            entity = int(match[1] or match[2])
            if self._scene.exists(entity):
                return entity
        names = self._names()
        for match in _QUOTED.finditer(text):
            name = next(group for group in match.groups() if group)
            if name in names:
                return names[name]
        return self._bare(text, names)

    def _bare(self, text: str, names: dict[str, int]) -> int:
        words = list(_WORDS.finditer(text))
        for length in range(min(LONGEST_NAME, len(words)), 0, -1):
            for first in range(len(words) - length + 1):
                phrase = text[words[first].start() : words[first + length - 1].end()].rstrip(".!?")
                if phrase in names:
                    return names[phrase]
        return 0

    def _names(self) -> dict[str, int]:
        version = (self._scene.structure_version, self._scene.mirror.epoch)
        if version != self._version:
            self._version = version
            # Backwards, so that of several of one name the first stays.
            self._by_name = {e.name: e.id for e in reversed(self._scene.mirror.entities.values()) if e.name}
        return self._by_name
