"""What the selected entities have in common and where they differ, found some hundred entities a frame.

Five thousand entities of ten components are not compared sixty times a second: every frame looks at the next ones and keeps
what it found. What was found to differ in the first pass over a selection shows at once; later passes replace it when done.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec

from elys.common.components import Component, FieldDeclaration, declaration_of, declarations
from elys.editor_node.scene_mirror import EditorScene

BUDGET: Final = 300  # of a frame: entities at rest cost 1
LIVE_COST: Final = 16  # of one whose pose comes with every state frame


class _Findings:
    """Of each field which elements differ between entities, and whether any is not its default."""

    def __init__(self, common: Sequence[str]) -> None:
        self.mixed = {name: [[False] * f.elements for f in declaration_of(name).fields] for name in common}
        self.changed = {name: [False] * len(declaration_of(name).fields) for name in common}


class Comparison:
    """Follows a selection; call `update` each frame, then read."""

    def __init__(self, scene: EditorScene) -> None:
        self._scene = scene
        self.primary: dict[str, Component] = {}  # the components of the entity selected last, as they are now
        self.common: tuple[str, ...] = ()  # the names of those that all have, in the order of their declaration
        self._selection_version = -1
        self._common_of: tuple[int, ...] = ()
        self._findings = _Findings(())
        self._pending = _Findings(())
        self._next = 0
        self._pass_version = -1  # the scene's, when the pass that is under way or done began
        self._defaults: dict[str, Component] = {}
        self._places: dict[str, dict[str, int]] = {}  # of fields in their components

    def update(self, entities: Sequence[int], selection_version: int) -> None:
        """Looks at the next of `entities`, which are not empty; the primary one is the last."""
        scene = self._scene
        self.primary = scene.components_of(entities[-1])
        self._find_common(entities, selection_version)
        if self._next >= len(entities):
            if self._pass_version == scene.version:
                return
            self._begin_pass()
        budget = BUDGET
        while budget > 0 and self._next < len(entities):
            entity = entities[-1 - self._next]  # the primary one first
            self._next += 1
            budget -= self._compare(entity)
        if self._next >= len(entities):
            self._findings = self._pending

    def mixed(self, component: str, field: FieldDeclaration) -> tuple[bool, ...]:
        """For each element of a field whether entities differ in it."""
        return tuple(self._findings.mixed[component][self._places[component][field.name]])

    def is_default(self, component: str, field: FieldDeclaration) -> bool:
        """Whether all have the field's default, as far as they were looked at."""
        place = self._places[component][field.name]
        return not self._findings.changed[component][place] and not self._pending.changed[component][place]

    def _find_common(self, entities: Sequence[int], selection_version: int) -> None:
        scene = self._scene
        # State frames change no components' presence; what else is heard of a scene at rest is rare.
        key = (selection_version, scene.structure_version, scene.mirror.epoch, scene.mirror.sequence)
        if key != self._common_of:
            self._common_of = key
            owned = scene.mirror.entities
            # Of thousands most have the same components as others: what differs are few.
            common = set(self.primary).intersection(*{tuple(owned[entity].components) for entity in entities})
            ordered = tuple(name for name in declarations() if name in common)
            if ordered != self.common or selection_version != self._selection_version:
                self.common = ordered
                self._selection_version = selection_version
                self._begin_pass()
                self._findings = self._pending  # what is found first shows at once

    def _begin_pass(self) -> None:
        self._pending = _Findings(self.common)
        self._next = 0
        self._pass_version = self._scene.version
        self._defaults = {name: declaration_of(name).struct() for name in self.common}
        self._places = {
            name: {field.name: place for place, field in enumerate(declaration_of(name).fields)} for name in self.common
        }

    def _compare(self, entity: int) -> int:
        """Adds what an entity says; its cost."""
        mirror = self._scene.mirror
        is_live = mirror.frame_row(entity) >= 0
        components = self._scene.components_of(entity) if is_live else mirror.entities[entity].components
        for name in self.common:
            value, shown, default = components.get(name), self.primary[name], self._defaults[name]
            if value is None:
                continue
            if value != default:
                _note_changes(self._pending.changed[name], value, default)
            if value != shown:
                _note_differences(self._pending.mixed[name], value, shown)
        return LIVE_COST if is_live else 1


def _note_changes(changed: list[bool], value: Component, default: Component) -> None:
    for place, (now, was) in enumerate(zip(msgspec.structs.astuple(value), msgspec.structs.astuple(default))):  # noqa: B905  alike
        if now != was:
            changed[place] = True


def _note_differences(mixed: list[list[bool]], value: Component, shown: Component) -> None:
    for axes, one, other in zip(mixed, msgspec.structs.astuple(value), msgspec.structs.astuple(shown)):  # noqa: B905  alike
        if one == other:
            continue
        if len(axes) == 1:
            axes[0] = True
            continue
        for axis in range(len(axes)):
            if one[axis] != other[axis]:
                axes[axis] = True
