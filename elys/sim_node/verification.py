"""Verifying a recording: it is run again, and every tick has to come out as it was recorded, to the bit.

Where it does not, one of three things is so: another build or another kind of machine runs it now; it does not even come out
twice the same here; or the file was altered, or the machine that recorded it erred.

Ticks that are not in the file are run through like all others and cannot be compared: they are counted. What comes out equal
after them has come out of them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal

import msgspec

from elys.bus.course import Course, KeptState, Missing, build_of, read_course
from elys.bus.messages.state_frame import INSTANTS, StateFrame
from elys.bus.recording import Recording
from elys.bus.recording_damage import LostPart
from elys.common.errors import ElysError, RecordingError
from elys.sim_node.build_facts import build_facts, differences
from elys.sim_node.frame_comparison import Difference, compared, of_hash
from elys.sim_node.reexecution import Reexecution, simulation_for

# "incomplete": equal as far as it could be compared, which is not everything from the first tick to the last.
Cause = Literal["equal", "incomplete", "altered", "other build", "not deterministic"]
Progress = Callable[[float, float], None]  # seconds of simulation done, and in all
_REPORT: Final = 30  # frames between two tellings of progress
GAPS_TOLD: Final = 20


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """What came of it."""

    recording: str
    cause: Cause
    ticks: int  # that were compared and are equal
    first_time: float  # [s] of the first of them
    last_time: float  # [s] of the last
    wall_time: float  # [s]
    realtime_factor: float
    missing_ticks: int = 0  # between those, that are not in the file or could not be compared
    lead_ticks: int = (
        0  # before the first that was compared: the state from which it was run again is older than all states to see
    )
    gaps: list[
        tuple[int, int]
    ] = []  # the first and the last tick of each place where some are missing; the first GAPS_TOLD
    damage: list[str] = []  # which parts of the file cannot be read
    jumps: list[int] = []  # ticks at which it went on from a state in the file that nothing in the file leads to
    difference: Difference | None = None
    other: list[str] = []  # what of build and machine differs
    notes: list[str] = []


def verify(
    path: Path,
    *,
    first: float = -math.inf,
    last: float = math.inf,
    threads: int = 1,
    progress: Progress | None = None,
) -> Verdict:
    """Runs a recording again from the exact state at or before the time `first` [s] up to `last`.

    Raises:
        RecordingError, StateError: it cannot be run again.
    """
    began = time.perf_counter()
    with Recording(path, checked=True) as recording:
        course = read_course(recording)
        other = differences(build_of(recording), build_facts())
        run = _Run(recording, course, first, last, threads)
        if recording.reader.mended:
            run.notes.append("the recording was never finished: it is verified as far as it goes")
        run.through(progress)
        cause: Cause = "equal"
        if run.difference is not None:
            cause = _cause_of(run, recording, course, other, threads)
        elif run.is_cut or run.gaps or not run.ticks or any(_is_within(lost, first, last) for lost in recording.lost):
            cause = "incomplete"
    wall = time.perf_counter() - began
    seconds = run.last_time - run.begun_time
    return Verdict(
        recording=str(path),
        cause=cause,
        ticks=run.ticks,
        first_time=run.first_time,
        last_time=run.last_time,
        wall_time=wall,
        realtime_factor=max(0.0, seconds) / wall,
        missing_ticks=_count(run.gaps),
        lead_ticks=run.lead_ticks,
        gaps=run.gaps[:GAPS_TOLD],
        damage=[lost.sentence for lost in recording.lost],
        jumps=run.jumps,
        difference=run.difference,
        other=other,
        notes=run.notes,
    )


class _Run:
    """One time through a recording, up to what differs."""

    def __init__(self, recording: Recording, course: Course, first: float, last: float, threads: int) -> None:
        self.ticks = 0
        self.notes: list[str] = []
        self.gaps: list[tuple[int, int]] = []  # first and last tick of what is missing
        self.jumps: list[int] = []
        self.difference: Difference | None = None
        self.is_cut = False  # it could not go on to the end
        self._tick = -1  # the last that was compared
        self._passed: list[tuple[int, int]] = []  # first and last of ticks that it went through since then
        self._recording, self._course = recording, course
        self._first, self._last = first, last
        self.again = Reexecution(recording, course, simulation_for(recording, threads=threads))
        self.trusted = course.state_before(first)  # the last that came out as it is in the file
        self._begin(self.trusted)
        changes = self.trusted.head.changes
        self._missing = {one.beat: one for one in reversed(course.missing) if one.number > changes}
        self.begun_time = self.first_time = self.last_time = max(first, self.trusted.head.time)
        self.lead_ticks = 0

    def through(self, progress: Progress | None) -> None:
        """Compares frame after frame."""
        for number in range(self._recording.run_count):
            run = self._recording.other_run(number)
            if run.epoch == self._course.epoch:
                self._through_run(run, progress)
            if self.difference is not None:
                return
        unplaced = self._missing.get(-1)
        if unplaced is not None:
            self.difference = self._lacks(unplaced)

    def _through_run(self, run: Recording, progress: Progress | None) -> None:
        start = self.begun_time
        end = min(self._last, float(run.time[-1]))
        self._tick = -1
        for position in range(len(run)):
            when = float(run.time[position])
            if when > self._last:
                return
            if when < self._begun.head.time:
                self._pass(int(run.tick[position]), when)
                continue
            frame = run.frame(position)
            if self.again.instant == self._begun.head.instant and self._ahead(frame) < 0:
                self._pass(frame.tick, when)
                continue  # from before the state with which it begins
            if not self._follow(frame):
                return
            if self._ahead(frame) < 0:
                self._pass(frame.tick, when)  # it went on from a later state
            elif when >= self._first:
                self._note(frame.tick, when)
            if progress is not None and position % _REPORT == 0:
                progress(when - start, end - start)

    def _note(self, tick: int, when: float) -> None:
        """A frame came out as it is in the file."""
        passed, self._passed = self._passed, []
        if passed and passed[-1][1] == tick:
            passed[-1] = (passed[-1][0], tick - 1)
        passed = [(first, last) for first, last in passed if first <= last]
        if self.ticks:
            self.gaps += passed
        else:  # a state may be older than the first frame, as in one of several files
            self.first_time, self.lead_ticks = when, _count(passed)
        self.ticks += tick != self._tick
        self._tick, self.last_time = tick, when

    def _pass(self, tick: int, when: float) -> None:
        """It is at a tick, or has left it out."""
        passed = self._passed
        if when < self._first or (passed and passed[-1][1] == tick):
            return
        if passed and passed[-1][1] == tick - 1:
            passed[-1] = (passed[-1][0], tick)
        else:
            passed.append((tick, tick))

    def _follow(self, frame: StateFrame) -> bool:
        """Goes on to the instant that a frame shows; returns whether it is as recorded, and the frames after it can be."""
        if frame.instant < 0 or self._ahead(frame) < 0:
            self._differs(_lacking(frame))
        while self.difference is None and self._ahead(frame) > 0:
            if self.again.simulation.time > frame.simulation_time + 1.0:
                self._differs(_lacking(frame))
            elif not self._advance():
                return False
        if self.difference is None and self._ahead(frame) == 0:
            self._compare(frame)
        return self.difference is None

    def _ahead(self, frame: StateFrame) -> int:
        """How many beats lead to a frame; negative if it is of the past."""
        ahead = (frame.instant - self.again.instant) % INSTANTS
        return ahead if ahead < INSTANTS // 2 else ahead - INSTANTS

    def _compare(self, frame: StateFrame) -> None:
        simulation = self.again.simulation
        if (simulation.tick, simulation.time) != (frame.tick, frame.simulation_time):
            self._differs(_lacking(frame))
        elif (found := compared(frame, simulation, self._recording.bounds)) is not None:
            self._differs(found)
        elif simulation.state_hash() != frame.state_hash:
            self._differs(of_hash(frame, simulation))

    def _advance(self) -> bool:
        """Does the next beat, or where it cannot be done again goes to where the recording tells how it goes on."""
        again = self.again
        missing = self._missing.get(again.instant + 1)
        if missing is not None:
            self.difference = self._lacks(missing)
            return False
        before = again.simulation.time
        try:
            if again.advance():
                self.jumps.append(again.simulation.tick)
        except RecordingError as error:
            self.notes.append(str(error))
            later = self._course.state_after(again.instant)
            if later is None:
                self.is_cut, self._last = True, -math.inf
                return False
            self._begin(later)
            self.jumps.append(later.head.tick)
            return True
        if again.simulation.time > before:
            self._pass(again.simulation.tick, again.simulation.time)
        if again.problem:
            self.notes.append(again.problem)
            again.problem = ""
        self._check_state()
        return True

    def _begin(self, kept: KeptState) -> None:
        self.again.begin(kept)
        self._begun = kept
        self._check_state()

    def _check_state(self) -> None:
        """Where an exact state stands, this has to be it."""
        kept = self._course.states.get(self.again.instant)
        if kept is None:
            return
        head, simulation = kept.head, self.again.simulation
        computed = simulation.state_hash()
        if (head.tick, head.state_hash) == (simulation.tick, computed):
            self.trusted = kept
            return
        self.difference = Difference(
            tick=head.tick,
            time=head.time,
            text=(
                f"tick {head.tick} ({head.time:.3f} s): the exact state in the recording has the hash {head.state_hash:016x}, "
                f"and when run again it is {computed:016x} at tick {simulation.tick}"
            ),
            recorded=f"{head.state_hash:016x}",
            computed=f"{computed:016x}",
        )

    def _differs(self, difference: Difference) -> None:
        unplaced = self._missing.get(-1)
        if unplaced is not None:
            text = f"{difference.text}; change {unplaced.number} is not in the recording"
            difference = msgspec.structs.replace(difference, text=text, missing_command=unplaced.number)
        self.difference = difference

    def _lacks(self, missing: Missing) -> Difference:
        simulation = self.again.simulation
        where = "that was made there" if missing.beat >= 0 else "that was made before the end"
        why = "its command was taken out, or lost by a recorder that could not keep up"
        if self._recording.lost:
            why = "its command stood in a part of the file that is damaged, or was taken out"
        return Difference(
            tick=simulation.tick,
            time=simulation.time,
            text=(
                f"tick {simulation.tick} ({simulation.time:.3f} s): change {missing.number} {where} is not in the "
                f"recording: {why}"
            ),
            missing_command=missing.number,
        )


def _count(ranges: list[tuple[int, int]]) -> int:
    return sum(last - first + 1 for first, last in ranges)


def _is_within(lost: LostPart, first: float, last: float) -> bool:
    """Whether a damaged part is, or may be, of a time."""
    return lost.times is None or (lost.times[1] >= first and lost.times[0] <= last)


def _lacking(frame: StateFrame) -> Difference:
    text = (
        f"tick {frame.tick} ({frame.simulation_time:.3f} s) is in the recording, and does not come when it is run again"
    )
    return Difference(tick=frame.tick, time=frame.simulation_time, text=text)


def _cause_of(run: _Run, recording: Recording, course: Course, other: list[str], threads: int) -> Cause:
    """Why a run differs from its recording."""
    assert run.difference is not None
    if run.difference.missing_command:
        return "incomplete" if recording.lost else "altered"
    if other:
        return "other build"
    again = Reexecution(recording, course, simulation_for(recording, threads=threads))
    try:
        again.begin(run.trusted)
        while again.instant < run.again.instant:
            again.advance()
    except ElysError as error:
        run.notes.append(f"run once more, it ended earlier: {error}")
        return "not deterministic"
    if again.simulation.state_hash() != run.again.simulation.state_hash():
        return "not deterministic"
    # What leads there may have stood in a part that is damaged.
    is_damaged = any(lost.times is None or lost.times[0] <= run.difference.time for lost in recording.lost)
    return "incomplete" if is_damaged else "altered"
