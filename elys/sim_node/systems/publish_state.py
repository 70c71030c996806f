"""publish_state only reads: what a tick has done becomes a state frame, a numbered scene delta and a profile."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from elys.bus import topics
from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    SceneChange,
    SceneDelta,
    SettingsSet,
    Spawned,
)
from elys.bus.messages.session import TickProfile
from elys.bus.messages.state_frame import StateFrame
from elys.bus.session import Session
from elys.common.components import declaration_of, values_of
from elys.common.ids import Entity
from elys.sim_node.ecs.changes import EntityDespawned, EntityReparented, EntitySpawned, WorldChanges
from elys.sim_node.ecs.world import World
from elys.sim_node.simulation import Simulation

RESYNC_THRESHOLD = 2000  # changes in one tick above which readers fetch the snapshot instead


def state_frame(simulation: Simulation, *, epoch: int, delta_sequence: int, playing: bool) -> StateFrame:
    """Where the moving bodies are now."""
    bodies = simulation.moving_bodies()
    return StateFrame(
        epoch=epoch,
        tick=simulation.tick,
        simulation_time=simulation.time,
        published_at=time.time_ns(),
        delta_sequence=delta_sequence,
        state_hash=simulation.physics.state_hash(),
        playing=playing,
        position=bodies.position,
        rotation=bodies.rotation,
        linear_velocity=bodies.linear_velocity,
        angular_velocity=bodies.angular_velocity,
        entity=bodies.entity,
    )


def scene_delta(
    simulation: Simulation,
    changes: Sequence[WorldChanges],
    *,
    epoch: int,
    sequence: int,
    settings_changed: bool,
) -> SceneDelta:
    """What changed in the scene, in an order in which it can be repeated: the tree as it happened, then values."""
    count = sum(len(c.structure) + len(c.added) + len(c.set) for c in changes)
    if count > RESYNC_THRESHOLD or any(c.overflowed for c in changes):
        return SceneDelta(epoch=epoch, sequence=sequence, tick=simulation.tick, resync=True)
    told = [told for c in changes for told in _structure(simulation.world, c)]
    told += [told for c in changes for told in _values(simulation.world, c)]
    if settings_changed:
        told.append(SettingsSet(settings=simulation.settings))
    return SceneDelta(epoch=epoch, sequence=sequence, tick=simulation.tick, changes=tuple(told))


def publish_profile(
    session: Session, simulation: Simulation, stages: dict[str, float], *, total: float, late: float
) -> None:
    """What the tick cost [ms]."""
    counts = {"bodies": simulation.physics.body_count, "contacts": simulation.physics.touching_count}
    session.publish(
        topics.PROFILE, TickProfile(tick=simulation.tick, total=total, stages=stages, counts=counts, late=late)
    )


def _structure(world: World, changes: WorldChanges) -> Iterator[SceneChange]:
    for change in changes.structure:
        match change:
            case EntitySpawned(entity=entity, parent=parent):
                yield _spawned(world, entity, parent)
            case EntityDespawned(entity=entity):
                yield Despawned(entity=entity)
            case EntityReparented(entity=entity, parent=parent, index=index):
                yield Reparented(entity=entity, parent=parent, index=index)


def _values(world: World, changes: WorldChanges) -> Iterator[SceneChange]:
    for entity, name in changes.removed:
        yield ComponentRemoved(entity=entity, component=name)
    for entity, name in (*changes.added, *changes.set):
        if world.is_alive(entity) and world.has(entity, name):
            value = world.get(entity, declaration_of(name).struct)
            yield ComponentSet(entity=entity, component=name, values=values_of(value))
    for entity in changes.renamed:
        if world.is_alive(entity):
            yield Renamed(entity=entity, name=world.hierarchy.name_of(entity))
    for entity in changes.switched:
        if world.is_alive(entity):
            yield EnabledSet(entity=entity, enabled=world.hierarchy.is_enabled(entity))


def _spawned(world: World, entity: Entity, parent: Entity) -> Spawned:
    if not world.is_alive(entity):  # gone within the same tick: told all the same, since others may have stood under it
        return Spawned(entity=entity, name="", parent=parent, enabled=True, components={})
    hierarchy = world.hierarchy
    return Spawned(
        entity=entity,
        name=hierarchy.name_of(entity),
        parent=parent,
        enabled=hierarchy.is_enabled(entity),
        components={type(component).__name__: values_of(component) for component in world.components_of(entity)},
        prefab=hierarchy.prefab_of(entity),
    )
