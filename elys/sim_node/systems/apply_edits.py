"""Edits as transactions: several at one tick's boundary, all or none, and what takes them back exactly.

For each edit the edits that undo it are worked out from the world just before it, to the bit: a pose comes back as the columns
had it, an entity under its old id. They serve twice: handed out, they are what undo sends; and where one edit of several is
refused, they take back those that were accepted before it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from elys.bus.edit_parts import Part, edits_of
from elys.bus.messages.commands import (
    AddComponent,
    Command,
    Despawn,
    Edit,
    Grab,
    Input,
    LoadScene,
    Release,
    RemoveComponent,
    Rename,
    Reparent,
    SetComponent,
    SetEnabled,
    SetSettings,
    Spawn,
    Tell,
)
from elys.common.components import declaration_of, values_of
from elys.common.errors import RequestError
from elys.common.ids import NO_ENTITY, Entity
from elys.sim_node.scene.loading import load_records, records_of
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command
from elys.sim_node.systems.edit_runs import TRANSFORM, WRITTEN_WHOLE, Outcome, apply_run, run_at, tops_of

MAX_EDITS = 100_000  # in one command


class Applied(NamedTuple):
    """What edits have done: the entities that came to be, and the edits that take it back."""

    entities: tuple[int, ...]
    inverse: tuple[Edit, ...]


class EditableSimulation:
    """A simulation as `EditHistory` edits it."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def apply(self, edits: tuple[Edit, ...]) -> Applied:
        """See `apply_edits`."""
        return apply_edits(self._simulation, edits)

    def named(self, entity: int) -> str:
        """By its name where it lives and has one."""
        hierarchy = self._simulation.world.hierarchy
        name = hierarchy.name_of(Entity(entity)) if self._simulation.world.is_alive(entity) else ""
        return name or self._simulation.named(entity)

    def below(self, entity: int) -> Iterable[int]:
        """An entity and all below it."""
        world = self._simulation.world
        if not world.is_alive(entity):
            return ()
        is_leaf = not world.hierarchy.child_count_of(Entity(entity))  # most are, when thousands are ended
        return (entity,) if is_leaf else world.hierarchy.subtree_of(Entity(entity)).tolist()

    def edited(self, part: Part) -> Any:
        """The fields that steps write, as they were edited."""
        return self._simulation.edited.of(*part)

    def recall(self, part: Part, memory: Any) -> None:
        """Remembers them again."""
        self._simulation.edited.recall(*part, memory)


def apply_edits(simulation: Simulation, edits: tuple[Edit, ...]) -> Applied:
    """Makes edits, in this order: all, or none.

    Raises:
        EntityError, HierarchyError, ComponentError, SceneError: what is wrong with one of them. The world is as it was then.
        RequestError: they are too many.
    """
    if len(edits) > MAX_EDITS:
        raise RequestError(f"one command may have {MAX_EDITS} edits, not {len(edits)}: send several")
    if len(edits) > 1:
        simulation.settle()  # bodies have followed what was edited before: what is refused is taken back alone
    resting, hold = simulation.world.allocator.resting(), simulation.scripts.hold
    tick_time, held = copy(simulation.tick_time), copy(hold.held)
    done: list[Outcome] = []
    try:
        _apply_all(simulation, edits, done)
    except Exception:
        _take_back(simulation, done)
        simulation.tick_time, hold.held = tick_time, held  # to the bit: who runs it again does not come by here
        if done:
            _keep_physics(simulation)
        came_back = {entity for edit in edits if isinstance(edit, Spawn) for entity in edit.entities}
        spawned = [entity for outcome in done for entity in outcome.entities if entity not in came_back]
        simulation.world.allocator.take_back(resting, np.array(spawned, np.uint32))
        raise
    entities = tuple(entity for outcome in done for entity in outcome.entities)
    _note_edited(simulation, edits, entities)
    return Applied(entities, tuple(edit for outcome in reversed(done) for edit in outcome.back))


def _apply_all(simulation: Simulation, edits: Sequence[Edit], done: list[Outcome]) -> None:
    """Makes edits in this order and adds what came of them to `done`; what raises has left what it tells."""
    start = 0
    while start < len(edits):
        count, outcome = run_at(edits, start), None
        while count > 1 and outcome is None:
            outcome = apply_run(simulation.world, edits[start : start + count])
            count = count if outcome is not None else count // 2
        done.append(outcome if outcome is not None else _apply_one(simulation, edits[start]))
        start += count


def _apply_one(simulation: Simulation, edit: Edit) -> Outcome:
    back = _inverse_of(simulation, edit)
    made = apply_command(simulation, edit)
    if isinstance(edit, Spawn):
        # Last sibling first: redone in reverse, each comes back at the place it had among those before it.
        back = tuple(Despawn(entity=entity) for entity in reversed(tops_of(edit, made)))
    return Outcome([Entity(entity) for entity in made], back)


def _take_back(simulation: Simulation, done: Sequence[Outcome]) -> None:
    _apply_all(simulation, [edit for outcome in reversed(done) for edit in outcome.back], [])


def load_scene(simulation: Simulation, command: LoadScene) -> tuple[int, ...]:
    """Puts another scene in the place of what is there; the new entities.

    Raises:
        SceneError, ComponentError, AssetError: a record is wrong. The world is as it was then.
    """
    world = simulation.world
    old = [entity for entity in world.entities().tolist() if world.hierarchy.parent_of(entity) == NO_ENTITY]
    new = load_records(world, command.records)
    for root in old:
        world.despawn(Entity(root))
    simulation.change_settings(command.settings)
    simulation.name = command.name
    simulation.path = command.path
    simulation.edited.forget()
    simulation.scripts.hold.end()
    simulation.scripts.pushes.waiting.clear()
    return tuple(new)


def apply_again(simulation: Simulation, command: Command) -> None:
    """Does what a command did that was accepted before in a simulation like this; raises as `apply_edits`, `load_scene`."""
    if isinstance(command, LoadScene):
        load_scene(simulation, command)
    elif isinstance(command, Grab | Release | Input | Tell):
        apply_command(simulation, command)
    else:
        apply_edits(simulation, edits_of(command))


def _keep_physics(simulation: Simulation) -> None:
    """Lets bodies follow what was edited and taken back, and stay what they are: made anew they would come out rounder."""
    kept = simulation.physics.snapshot()
    simulation.settle()
    simulation.take_physics_back(kept)


def _inverse_of(simulation: Simulation, edit: Edit) -> tuple[Edit, ...]:
    """What takes back what an edit is about to do; () for a Spawn, whose entities have no ids yet."""
    world = simulation.world
    match edit:
        case SetComponent(entity=entity, component=name, values=values):
            before = values_of(world.get(Entity(entity), declaration_of(name).struct))
            kept = before if name == WRITTEN_WHOLE else {field: before[field] for field in values if field in before}
            return (SetComponent(entity=entity, component=name, values=kept),)
        case AddComponent(entity=entity, component=name):
            return (RemoveComponent(entity=entity, component=name),)
        case RemoveComponent(entity=entity, component=name):
            before = values_of(world.get(Entity(entity), declaration_of(name).struct))
            return (AddComponent(entity=entity, component=name, values=before),)
        case Despawn(entity=entity):
            hierarchy = world.hierarchy
            ids = tuple(hierarchy.subtree_of(Entity(entity)).tolist())
            return (
                Spawn(
                    records=tuple(records_of(world, Entity(entity))),
                    parent=hierarchy.parent_of(Entity(entity)),
                    index=hierarchy.sibling_index(Entity(entity)),
                    entities=ids,
                ),
            )
        case Rename(entity=entity):
            return (Rename(entity=entity, name=world.hierarchy.name_of(Entity(entity))),)
        case Reparent(entity=entity):
            return _inverse_of_reparent(simulation, edit)
        case SetEnabled(entity=entity):
            return (SetEnabled(entity=entity, enabled=world.hierarchy.is_enabled(Entity(entity))),)
        case SetSettings():
            return (SetSettings(settings=simulation.settings),)
        case Spawn():
            return ()


def _inverse_of_reparent(simulation: Simulation, edit: Reparent) -> tuple[Edit, ...]:
    world, entity = simulation.world, Entity(edit.entity)
    back = Reparent(
        entity=entity,
        parent=world.hierarchy.parent_of(entity),
        index=world.hierarchy.sibling_index(entity),
        keep_world_pose=False,
    )
    transform = world.try_get(entity, TRANSFORM) if edit.keep_world_pose else None
    if transform is None:
        return (back,)
    # The very values it had: through the world and back they would come out rounded.
    return (back, SetComponent(entity=entity, component=TRANSFORM, values=values_of(transform)))


def _note_edited(simulation: Simulation, edits: tuple[Edit, ...], entities: tuple[int, ...]) -> None:
    edited = simulation.edited
    if not edited.is_captured:
        return
    for edit in edits:
        fields: tuple[str, ...] | None = None
        match edit:
            case SetComponent(entity=entity, component=name, values=values):
                fields = tuple(values)
            case AddComponent(entity=entity, component=name):
                pass
            case Reparent(entity=entity, keep_world_pose=True):
                name = TRANSFORM  # told in another frame now: where it is is where it was put
            case _:
                continue
        edited.note(entity, name, fields=fields)
    edited.note_spawned(entities)
