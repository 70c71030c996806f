"""Structural changes asked for while systems run over the columns, done when that is safe.

A system that adds or removes components while it iterates would move the rows under its own feet. So it records what it
wants; the schedule applies the buffer when the system has returned, in the order of the recording.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from elys.common.components import Component
from elys.common.ids import NO_ENTITY, Entity

if TYPE_CHECKING:
    from elys.sim_node.ecs.world import World


class CommandBuffer:
    """Records changes of one world. Those to an entity that an earlier one of the buffer ended are void."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._recorded: list[tuple[Entity, Callable[..., Any], tuple[Any, ...], dict[str, Any]]] = []

    def __len__(self) -> int:
        return len(self._recorded)

    def spawn(self, components: Iterable[Component] = (), *, name: str = "", parent: Entity = NO_ENTITY) -> None:
        """As `World.spawn`; void if `parent` ends before."""
        self._record(parent, self._world.spawn, tuple(components), name=name, parent=parent)

    def despawn(self, entity: Entity) -> None:
        """As `World.despawn`."""
        self._record(entity, self._world.despawn, entity)

    def add(self, entity: Entity, component: Component) -> None:
        """As `World.add`."""
        self._record(entity, self._world.add, entity, component)

    def remove(self, entity: Entity, component: type[Component]) -> None:
        """As `World.remove`."""
        self._record(entity, self._world.remove, entity, component)

    def set_parent(self, entity: Entity, parent: Entity, *, keep_world_pose: bool = True) -> None:
        """As `World.set_parent`."""
        self._record(entity, self._world.set_parent, entity, parent, keep_world_pose=keep_world_pose)

    def set_enabled(self, entity: Entity, enabled: bool) -> None:
        """As `World.set_enabled`."""
        self._record(entity, self._world.set_enabled, entity, enabled)

    def apply(self) -> None:
        """Does all that was recorded, in order. What one command raises leaves the rest undone and forgotten."""
        recorded, self._recorded = self._recorded, []
        for subject, change, arguments, options in recorded:
            if subject == NO_ENTITY or self._world.is_alive(subject):
                change(*arguments, **options)

    def _record(self, subject: Entity, change: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        self._recorded.append((subject, change, arguments, options))
