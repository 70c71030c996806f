"""The scene as its readers know it: numbered deltas for who stays, a snapshot for who joins or was led to another time."""

from __future__ import annotations

from elys.bus import topics
from elys.bus.messages.scene import SceneDelta, Snapshot
from elys.bus.session import Session
from elys.common.clock import FixedStepClock
from elys.sim_node.edit_history import EditHistory
from elys.sim_node.scene.snapshot import take_snapshot
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.publish_state import scene_delta


class SceneTelling:
    """Publishes what changes in the scene of a simulation; keeps the clock at the tick rate that its settings say.

    Attributes:
        sequence: of the last delta.
        is_another_scene: another was loaded, which the next delta says.
        is_elsewhere: the scene is that of another time than its readers know, which the next delta says.
    """

    def __init__(self, simulation: Simulation, session: Session, history: EditHistory, clock: FixedStepClock) -> None:
        self.sequence = 0
        self.is_another_scene = False
        self.is_elsewhere = False
        self._simulation = simulation
        self._session = session
        self._history = history
        self._clock = clock
        self._settings_told = simulation.settings
        self._revision_told = 0

    def snapshot(self, *, as_edited: bool = False) -> Snapshot:
        """The whole scene as it is between two ticks, or as it would be if time had never moved anything."""
        simulation = self._simulation
        return take_snapshot(
            simulation.world,
            epoch=self._session.epoch,
            tick=simulation.tick,
            simulation_time=simulation.time,
            sequence=self.sequence,
            scene=simulation.name,
            settings=simulation.settings,
            revision=self._history.revision,
            content=self._history.content,
            **({"columns_of": simulation.edited.columns} if as_edited else {}),
        )

    def publish(self) -> bool:
        """Tells what has changed since the last time; returns whether anything has."""
        simulation, history = self._simulation, self._history
        changes = simulation.take_changes()
        if self.is_elsewhere:
            self._publish_elsewhere()
            return True
        settings_changed = simulation.settings is not self._settings_told
        revision_changed = history.revision != self._revision_told
        if not changes and not settings_changed and not revision_changed:
            return False
        self._revision_told = history.revision
        if settings_changed:
            self._follow_settings()
        self.sequence += 1
        delta = scene_delta(
            simulation,
            changes,
            epoch=self._session.epoch,
            sequence=self.sequence,
            settings_changed=settings_changed,
            revision=history.revision,
            content=history.content,
            resync=self.is_another_scene,
        )
        self.is_another_scene = False
        self._session.publish(topics.DELTA, delta)
        return True

    def _publish_elsewhere(self) -> None:
        """All of the scene may be other than before: its readers are told to look at it anew."""
        self.is_elsewhere = False
        self._follow_settings()
        self.sequence += 1
        delta = SceneDelta(epoch=self._session.epoch, sequence=self.sequence, tick=self._simulation.tick, resync=True)
        self._session.publish(topics.DELTA, delta)

    def _follow_settings(self) -> None:
        self._settings_told = self._simulation.settings
        if self._clock.tick_rate != self._settings_told.tick_rate:
            self._clock.set_tick_rate(self._settings_told.tick_rate)
