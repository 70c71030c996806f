"""Semantic segmentation: which class of things each entity is of.

What is part of a prefab or of a model is of the class of that file, the innermost, by its name: all instances of a thing are
one class. All else is of the class of its name without the number behind it: "Box 1" and "Box 2" are boxes.
"""

from __future__ import annotations

import re
import zlib
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.scene import ComponentRemoved, ComponentSet, SceneChange, SettingsSet
from elys.bus.mirror import MirrorEntity, MirrorUpdate, SceneMirror
from elys.common.components import MeshRenderer
from elys.render_node.data_colors import Pixels, entity_colors

_FILE_KINDS: Final = re.compile(r"\.(prefab\.json|scene\.json|[^.]*)\Z")
_NUMBER: Final = re.compile(r"[\s_.#-]*\d+\Z")


class SceneClass(NamedTuple):
    """A class as a legend has it."""

    id: int  # what a pixel holds
    name: str
    color: tuple[int, int, int]  # sRGB, as pictures show it


class SceneClasses:
    """Numbers the classes of all that a mirror's scene can draw: by their names from 1 on, 0 for nothing.

    A number stays with its name as long as this lives; names that come later get later numbers.
    """

    def __init__(self, mirror: SceneMirror) -> None:
        self._mirror = mirror
        self._numbers: dict[str, int] = {}
        self._is_stale = True
        mirror.listen(self._note)
        self._entities = np.zeros(0, np.uint32)  # sorted
        self._classes = np.zeros(0, np.uint32)  # of each

    def seen(self, entity: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """The class of each entity of an array; 0 for none."""
        self._read()
        if not len(self._entities):
            return np.zeros_like(entity)
        row = np.minimum(np.searchsorted(self._entities, entity), len(self._entities) - 1)
        return np.where(self._entities[row] == entity, self._classes[row], np.uint32(0))

    def pixels(self, classes: NDArray[np.uint32]) -> Pixels:
        """Colours (H, W, 3) of classes (H, W): each name has its own, in all scenes; black for none."""
        table = np.zeros((len(self._numbers) + 1, 3), np.uint8)
        for one in self.legend():
            table[one.id] = one.color
        return table[classes]

    def legend(self) -> tuple[SceneClass, ...]:
        """All classes by their numbers: those of the scene as it is, and those that it had."""
        self._read()
        return tuple(SceneClass(number, name, _color(name)) for name, number in self._numbers.items())

    def _note(self, update: MirrorUpdate) -> None:
        if update.reset or not all(map(_keeps_classes, update.changes)):
            self._is_stale = True

    def _read(self) -> None:
        if not self._is_stale:
            return
        self._is_stale = False
        names = self._names()
        for name in sorted(set(names.values()) - self._numbers.keys()):
            self._numbers[name] = len(self._numbers) + 1
        self._entities = np.array(sorted(names), np.uint32)
        self._classes = np.array([self._numbers[names[entity]] for entity in self._entities.tolist()], np.uint32)

    def _names(self) -> dict[int, str]:
        """The name of the class of each entity that can be drawn."""
        names: dict[int, str] = {}
        files: dict[int, str] = {0: ""}  # the innermost that each is part of
        for entity in self._mirror.in_order():
            files[entity.id] = file = _file_name(entity.prefab) or files[entity.parent]
            if "MeshRenderer" in entity.components:
                names[entity.id] = file or _plain_name(entity)
        return names


def _keeps_classes(change: SceneChange) -> bool:
    """Whether everything is drawn under the name that it had: what blinks or moves does not make names anew."""
    match change:
        case SettingsSet():
            return True
        case ComponentSet(component=component) | ComponentRemoved(component=component):
            return component != MeshRenderer.__name__
        case _:
            return False


def _file_name(path: str) -> str:
    """Without folders and without what kind of file it is; "" for none."""
    return _FILE_KINDS.sub("", re.split(r"[/\\:]", path)[-1])


def _plain_name(entity: MirrorEntity) -> str:
    """What it is called, without the number that tells it from others; who has no name is what it looks like."""
    renderer = entity.components["MeshRenderer"]
    assert isinstance(renderer, MeshRenderer)
    return _NUMBER.sub("", entity.name).strip() or entity.name or renderer.mesh


def _color(name: str) -> tuple[int, int, int]:
    mixed = zlib.crc32(name.encode()) | 1  # never that of nothing
    red, green, blue = entity_colors(np.array([mixed], np.uint32))[0].tolist()
    return red, green, blue
