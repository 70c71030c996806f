"""Names that no sibling has, for thousands of new entities as for one."""

from __future__ import annotations

import re
from collections.abc import Iterable

from elys.editor_node.scene_mirror import EditorScene


class FreeNames:
    """What new children of entities are called; who was given a name has it."""

    def __init__(self, scene: EditorScene) -> None:
        self._scene = scene
        self._taken: dict[int, set[str]] = {}  # by parent
        self._next: dict[tuple[int, str], int] = {}  # the least number that may be free behind a name

    def take(self, parent: int, name: str) -> str:
        """`name`, or with the first number behind it that no child of `parent` has, nor another new one."""
        scene = self._scene
        taken = self._taken.get(parent)
        if taken is None:
            taken = self._taken[parent] = {scene.name_of(child) for child in scene.children_of(parent)}
        found = name
        if name in taken:
            stem = re.sub(r" \d+$", "", name)
            number = self._next.get((parent, stem), 2)
            while (found := f"{stem} {number}") in taken:
                number += 1
            self._next[parent, stem] = number + 1
        taken.add(found)
        return found


def free_names(scene: EditorScene, parent: int, names: Iterable[str]) -> list[str]:
    """Of several new children of one parent, see `FreeNames.take`."""
    free = FreeNames(scene)
    return [free.take(parent, name) for name in names]
