"""Any instant of a recorded session as a simulation that can go on from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from elys.bus.course import Course, build_of, read_course
from elys.bus.messages.state_frame import INSTANTS
from elys.bus.recording import Recording
from elys.common.errors import RecordingError
from elys.sim_node.build_facts import build_facts, differences
from elys.sim_node.reexecution import Reexecution, simulation_for
from elys.sim_node.simulation import Simulation

Progress = Callable[[float, float], None]  # seconds of simulation done, and in all


@dataclass(frozen=True, slots=True)
class ForkPoint:
    """A simulation at an instant of a recording, and what happened after it there."""

    simulation: Simulation
    course: Course
    instant: int
    last_instant: int  # of the recording


def fork_point(
    recording: Recording, seconds: float, *, threads: int = 1, progress: Progress | None = None
) -> ForkPoint:
    """The simulation as it was at the tick nearest to a time [s], with all that was edited there.

    Raises:
        RecordingError, StateError: the recording does not go there, or cannot be run again.
    """
    course = read_course(recording)
    tick_time = require_within(recording, course, seconds)
    last = recording.frame(len(recording) - 1).instant
    again = Reexecution(recording, course, simulation_for(recording, threads=threads))
    kept = course.state_before(seconds + 0.5 * tick_time)
    again.begin(kept)
    last_instant = again.instant + (last - again.instant) % INSTANTS
    while again.instant < last_instant and not _is_there(again, seconds):
        again.advance()
        if progress is not None and again.instant % 30 == 0:
            progress(again.simulation.time - kept.head.time, seconds - kept.head.time)
    if again.problem:
        raise RecordingError(f"{recording.path} cannot be run again up to there: {again.problem}")
    _require_same(recording, again, seconds)
    again.simulation.name = recording.mirror_at(recording.position_at(seconds)).scene
    return ForkPoint(again.simulation, course, again.instant, last_instant)


def _require_same(recording: Recording, again: Reexecution, seconds: float) -> None:
    """Raises RecordingError where a simulation has not become what is recorded of its instant."""
    frame = recording.frame(recording.position_at(seconds))
    if (frame.instant - again.instant) % INSTANTS or again.simulation.state_hash() == frame.state_hash:
        return
    other = differences(build_of(recording), build_facts())
    raise RecordingError(
        f"{recording.path} comes out as something else by {seconds:g} s when it is run again, so nothing can go on from there: "
        + (f"here is another build or kind of machine ({', '.join(other)})" if other else "`elys verify` tells where")
    )


def _is_there(again: Reexecution, seconds: float) -> bool:
    """Whether the next beat would lead beyond a time."""
    beat, simulation = again.next_beat, again.simulation
    half = 0.5 / simulation.settings.tick_rate
    return (beat is None or beat.steps) and simulation.time + 2.0 * half > seconds + half


def require_within(recording: Recording, course: Course, seconds: float) -> float:
    """Raises RecordingError unless a recording can be gone on with from a time [s]; returns the length of its ticks [s]."""
    start, end = course.first.head.time, float(recording.time[-1])
    tick_time = 1.0 / recording.mirror_at(0).settings.tick_rate
    if not start - 0.5 * tick_time <= seconds <= end + 0.5 * tick_time:
        raise RecordingError(
            f"{recording.path} can be gone on with from {start:.3f} s to {end:.3f} s, not from {seconds:g} s"
        )
    return tick_time
