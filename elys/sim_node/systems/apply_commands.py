"""apply_commands: each command is checked, changes the world at the tick's boundary, and is answered."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from elys.bus.messages.commands import (
    AddComponent,
    Command,
    Despawn,
    Grab,
    Input,
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
from elys.common.components import Kind, component_from, declaration_of
from elys.common.components.values import MAX_TEXT_LENGTH
from elys.common.errors import ComponentError, EntityError, RequestError
from elys.common.ids import Entity
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation

MAX_NAME_LENGTH = 200  # characters
MAX_SPAWNED = 100_000  # records of one command, which take about a second
MAX_NUMBER = 1e9  # in SI units, of either sign


def apply_command(simulation: Simulation, command: Command) -> tuple[int, ...]:
    """Changes the world as asked; the entities that came to be.

    Raises:
        EntityError, HierarchyError, ComponentError: what is wrong with the command. The world is as it was then.
        RequestError: the command is not one for a simulation.
    """
    world = simulation.world
    match command:
        case SetComponent(entity=entity, component=name, values=values):
            current = world.get(Entity(entity), declaration_of(name).struct)
            check_numbers(name, values)
            world.set(Entity(entity), component_from(name, values, base=current))
        case AddComponent(entity=entity, component=name, values=values):
            check_numbers(name, values)
            world.add(Entity(entity), component_from(name, values))
        case RemoveComponent(entity=entity, component=name):
            world.remove(Entity(entity), name)
        case Spawn():
            return _spawn(simulation, command)
        case Despawn(entity=entity):
            world.despawn(Entity(entity))
        case Rename(entity=entity, name=name):
            world.rename(Entity(entity), _checked_name(name))
        case Reparent(entity=entity, parent=parent, index=index, keep_world_pose=keep):
            world.set_parent(Entity(entity), Entity(parent), index=index, keep_world_pose=keep)
        case SetEnabled(entity=entity, enabled=enabled):
            world.set_enabled(Entity(entity), enabled)
        case SetSettings(settings=settings):
            simulation.change_settings(settings)
        case Grab(entity=entity):
            if not world.is_alive(entity):
                raise EntityError(f"there is no entity {entity} to be held by a hand")
            simulation.hands.take(command, simulation.named(entity))
        case Release(holder=holder):
            simulation.hands.release(holder)
        case Input():
            simulation.inputs.take(command)
        case Tell():
            simulation.scripts.events.tell(command)
        case _:
            raise RequestError(f"a running simulation cannot {type(command).__name__}: that is for replays")
    return ()


def _spawn(simulation: Simulation, command: Spawn) -> tuple[int, ...]:
    check_spawn(command)
    return tuple(
        load_records(
            simulation.world,
            command.records,
            parent=Entity(command.parent),
            index=command.index,
            revived=command.entities,
        )
    )


def check_spawn(command: Spawn) -> None:
    """Refuses what only a faulty program asks for; whether values are ones that fields take is found when they are stored."""
    if len(command.records) > MAX_SPAWNED:
        raise EntityError(f"one command may spawn {MAX_SPAWNED} entities, not {len(command.records)}: send several")
    for record in command.records:
        _checked_name(record.name)
        if len(record.prefab) > MAX_TEXT_LENGTH:
            raise EntityError(f"a prefab may have {MAX_TEXT_LENGTH} characters, not {len(record.prefab)}")
        for name, values in record.components.items():
            check_numbers(name, values)


def check_numbers(component: str, values: Mapping[str, Any]) -> None:
    """Refuses what nobody means and what physics would have to leave out; columns themselves take any finite number."""
    for field, value in values.items():
        for number in value if isinstance(value, (list, tuple)) else (value,):
            if isinstance(number, (int, float)) and abs(number) > MAX_NUMBER:
                if declaration_of(component).field(field).kind is Kind.ENTITY:
                    continue  # an id may be any
                raise ComponentError(f"{component}.{field} must lie within {MAX_NUMBER:g} of zero")


def _checked_name(name: str) -> str:
    if len(name) > MAX_NAME_LENGTH:
        raise EntityError(f"a name may have {MAX_NAME_LENGTH} characters, not {len(name)}")
    return name
