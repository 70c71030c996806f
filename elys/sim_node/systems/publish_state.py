"""publish_state only reads: what a tick has done becomes a state frame, a numbered scene delta, contacts and a profile."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from elys.bus import topics
from elys.bus.messages.physics import ContactBatch, DebugLines, Diagnostics, Meetings, Touches, Touching, Visits
from elys.bus.messages.plan import PhysicsPlan, StagePlan
from elys.bus.messages.scene import SceneDelta, SettingsSet
from elys.bus.messages.session import TickProfile
from elys.bus.messages.state_frame import StateFrame
from elys.bus.session import Session
from elys.bus.topics import Topic
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.physics.debug_geometry import LINES
from elys.sim_node.scene.delta import scene_changes
from elys.sim_node.simulation import Simulation

RESYNC_THRESHOLD = 2000  # changes in one tick above which readers fetch the snapshot instead


def is_heard(session: Session, topic: Topic[Any]) -> bool:
    """Whether anybody listens to a topic or records: what is published anew each tick is made for nobody else."""
    return bool(session.taps) or session.has_listener(topic)


def state_frame(
    simulation: Simulation,
    *,
    epoch: int,
    delta_sequence: int,
    playing: bool,
    is_told_again: bool = False,
    is_forked: bool = False,
    instant: int = -1,
) -> StateFrame:
    """Where the moving bodies are now, and what animations make of others."""
    bodies, animated = simulation.moving_bodies(), simulation.animated()
    return StateFrame(
        epoch=epoch,
        tick=simulation.tick,
        simulation_time=simulation.time,
        published_at=time.time_ns(),
        delta_sequence=delta_sequence,
        state_hash=simulation.state_hash(),
        playing=playing,
        is_told_again=is_told_again,
        is_forked=is_forked,
        instant=instant,
        position=bodies.position,
        rotation=bodies.rotation,
        linear_velocity=bodies.linear_velocity,
        angular_velocity=bodies.angular_velocity,
        entity=bodies.entity,
        **animated._asdict(),
    )


def scene_delta(
    simulation: Simulation,
    changes: Sequence[WorldChanges],
    *,
    epoch: int,
    sequence: int,
    settings_changed: bool,
    revision: int = 0,
    content: int = 0,
    resync: bool = False,
) -> SceneDelta:
    """What changed in the scene; too much to be listed becomes a resync."""
    count = sum(len(c.structure) + len(c.added) + len(c.set) for c in changes)
    if resync or count > RESYNC_THRESHOLD or any(c.overflowed for c in changes):
        return SceneDelta(
            epoch=epoch, sequence=sequence, tick=simulation.tick, resync=True, revision=revision, content=content
        )
    told = scene_changes(simulation.world, changes)
    if settings_changed:
        told = (*told, SettingsSet(settings=simulation.settings))
    return SceneDelta(
        epoch=epoch, sequence=sequence, tick=simulation.tick, changes=told, revision=revision, content=content
    )


def contact_batch(simulation: Simulation, *, epoch: int) -> ContactBatch | None:
    """The contacts and visits that the last tick began and ended; None when nothing did."""
    changes = simulation.physics.event_changes
    if not any(len(rows[0]) for rows in changes):
        return None
    return ContactBatch(
        epoch=epoch,
        tick=simulation.tick,
        begun=Touches(**_columns(changes.begun)),
        ended=Meetings(**_columns(changes.ended)),
        entered=Visits(**_columns(changes.entered)),
        exited=Visits(**_columns(changes.exited)),
    )


def touching(simulation: Simulation, *, epoch: int) -> Touching:
    """The contacts that go on after the last tick."""
    contacts = simulation.physics.events.contacts
    rows = {
        name: (*getattr(contacts.begun, name).tolist(), *getattr(contacts.persisting, name).tolist())
        for name in Meetings.__struct_fields__
    }
    return Touching(epoch=epoch, tick=simulation.tick, contacts=Meetings(**rows))


def _columns(rows: NamedTuple) -> dict[str, tuple[Any, ...]]:
    return {name: tuple(column.tolist()) for name, column in rows._asdict().items()}


def physics_plan(simulation: Simulation) -> PhysicsPlan:
    """Which stages the last step had, and why the others were off."""
    physics = simulation.physics
    return PhysicsPlan(
        tick=simulation.tick,
        bodies=physics.body_count,
        contacts=physics.touching_count,
        stages=tuple(StagePlan(**stage._asdict()) for stage in physics.plan()),
    )


def publish_debug_lines(session: Session, simulation: Simulation) -> None:
    """Every kind of debug lines that somebody listens to."""
    for kind in LINES:
        if not session.has_listener(topics.DEBUG_LINES, key=kind):
            continue
        session.publish(topics.DEBUG_LINES, debug_lines(simulation, kind, epoch=session.epoch), key=kind)


def debug_lines(simulation: Simulation, kind: str, *, epoch: int) -> DebugLines:
    """One kind of debug lines as the last tick left them."""
    lines = simulation.physics.debug_lines(kind)
    if kind == "forces":
        lines = lines.with_more(simulation.hands.force_lines(1.0 / simulation.settings.tick_rate))
    return DebugLines(
        epoch=epoch,
        tick=simulation.tick,
        positions=lines.positions.astype("<f4").tobytes(),
        colors=lines.colors.tobytes(),
        values=lines.values.astype("<f4").tobytes(),
        entities=lines.entities.astype("<u4").tobytes(),
    )


def publish_diagnostics(session: Session, simulation: Simulation) -> Diagnostics | None:
    """What the tick has left in the physics, where somebody listens or records; measured for nobody else."""
    if not is_heard(session, topics.DIAGNOSTICS):
        return None
    found = simulation.physics.watch()._asdict()
    message = Diagnostics(tick=simulation.tick, bodies=simulation.physics.body_count, **found)
    session.publish(topics.DIAGNOSTICS, message)
    return message


def publish_profile(
    session: Session, simulation: Simulation, stages: dict[str, float], *, total: float, late: float
) -> None:
    """What the tick cost [ms], where somebody listens or records."""
    if not is_heard(session, topics.PROFILE):
        return
    counts = {"bodies": simulation.physics.body_count, "contacts": simulation.physics.touching_count}
    session.publish(
        topics.PROFILE, TickProfile(tick=simulation.tick, total=total, stages=stages, counts=counts, late=late)
    )
