"""Running again what a recording tells of: from an exact state beat by beat, with the bits that there were."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from elys.bus.course import Beat, Course, KeptState, exact_state
from elys.bus.edit_parts import edits_of
from elys.bus.recording import Recording
from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError, RecordingError
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from elys.sim_node.systems.apply_edits import apply_again


class Reexecution:
    """A simulation that does again what a course tells of.

    Attributes:
        instant: at which it is. problem: why a command could not be done again, empty if all could.
    """

    def __init__(self, recording: Recording, course: Course, simulation: Simulation) -> None:
        self.simulation = simulation
        self.course = course
        self.instant = -1
        self.problem = ""
        self._recording = recording
        self._physics: dict[int, dict[str, NDArray[Any]]] = {}  # that is put back later, by instant

    def begin(self, kept: KeptState) -> None:
        """Becomes what an exact state tells.

        Raises:
            StateError: it is damaged, or of another version. RecordingError: it cannot be read. ScriptError: it has scripts that
                may not run here.
        """
        self.simulation.restore(State.from_bytes(exact_state(self._recording.reader, kept.place)))
        self.simulation.scripts.require_trust()
        self.instant = kept.head.instant
        self._physics.clear()
        self._keep_physics()
        self._forget_changes()

    @property
    def next_beat(self) -> Beat | None:
        """What is told of the beat that comes next; None where it is a step and nothing else."""
        return self.course.beats.get(self.instant + 1)

    def advance(self) -> bool:
        """Does the next beat; returns whether it went on from a recorded state instead, to which commands and steps do not lead.

        Raises:
            RecordingError: what happened in it is told by an exact state that is not in the file.
        """
        beat = self.next_beat
        there = self.course.states.get(self.instant + 1)
        if there is not None and there.head.is_unexplained and not self._can_do(beat):
            self.begin(there)
            return True
        if beat is not None and not self._can_do(beat):
            raise RecordingError(
                f"what happened after tick {self.simulation.tick} is told by an exact state that is not in the recording"
            )
        if beat is None:
            self._step()
        else:
            self._do(beat)
        self.instant += 1
        self._keep_physics()
        self._forget_changes()
        return False

    def _can_do(self, beat: Beat | None) -> bool:
        if beat is None:
            return False
        return not beat.is_broken and (beat.physics_of < 0 or beat.physics_of in self._physics)

    def _do(self, beat: Beat) -> None:
        for record in beat.records:
            if record.number < 0:
                if len(edits_of(record.command)) > 1 and not record.accepted:
                    self.simulation.settle()  # as who refuses several edits does
                continue
            try:
                apply_again(self.simulation, record.command)
            except ElysError as error:
                self.problem = self.problem or (
                    f"command {record.number} ({type(record.command).__name__}), which was accepted at tick {record.tick}, "
                    f"is refused now: {error}"
                )
        if beat.steps:
            self._step()
        else:
            self.simulation.settle()
        if beat.physics_of >= 0:
            self.simulation.take_physics_back(self._physics[beat.physics_of])

    def _step(self) -> None:
        self._physics.clear()
        self.simulation.step()

    def _keep_physics(self) -> None:
        if self.instant in self.course.kept_physics:
            self._physics[self.instant] = self.simulation.physics.snapshot()

    def _forget_changes(self) -> None:
        self.simulation.take_changes()
        self.simulation.take_events()
        self.simulation.take_stop()


def simulation_for(recording: Recording, *, threads: int = 1) -> Simulation:
    """A simulation with a recording's assets, that can become what an exact state tells."""
    assets = AssetStore()
    for reference in recording.asset_references():
        assets.put(recording.asset(reference), kind="mesh")
    return Simulation(assets=assets, threads=threads)
