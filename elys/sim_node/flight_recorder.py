"""The flight recorder of a simulation: any instant of the last minute, exactly.

    keyframe          keyframe          keyframe           now
       │ beat beat ... │ beat beat ...    │ beat beat ... ──┤
                            ◀── position: where the simulation is

A keyframe is a whole state; a beat is what happened between two instants: commands, and after them a step, or while paused none.
An instant is had by going back to the keyframe before it and doing the beats since again, which gives the same bits. Instants are
counted in beats from the beginning of the run, so that edits made while time stood still have instants of their own.
"""

from __future__ import annotations

import logging
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final, NamedTuple

import msgspec

from elys.bus.messages.commands import Command
from elys.common.errors import ElysError, RequestError
from elys.sim_node.scene.edited_values import EditedMemory
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State, size_of
from elys.sim_node.systems.apply_edits import apply_again

SECONDS: Final = 60.0  # [s] of simulation kept
ROOM: Final = 256 << 20  # [bytes] of keyframes and commands
SHORTEST: Final = 1.0  # [s] of simulation between two keyframes
LONGEST: Final = 20.0  # [s] of simulation between two, before they are thinned
SHARE: Final = 0.015  # of the time that ticks take may go into keyframes
MOST_WORK: Final = 4.0  # [s] that it may take to do again what is between two: then they may take more
NEAR: Final = 30  # beats between keyframes that are added where somebody goes back and forth: there time stands still
_log = logging.getLogger(__name__)


class Beat(NamedTuple):
    """What led from one instant to the next: commands, then a step or not."""

    tick: int  # of the instant that it led to
    time: float  # [s]
    commands: tuple[Command, ...]
    steps: bool
    is_told: bool  # whether the scene's readers were told of changes
    size: int  # about what the commands take [bytes]
    is_whole: bool  # whether commands and step are all that happened; else the keyframe after it tells


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A whole state at an instant."""

    instant: int
    state: State
    edited: EditedMemory  # of the scene as a person would save it
    state_hash: int


class FlightRecorder:
    """Keeps the past of a simulation that is changed by nothing but commands and steps, and goes back and forth in it.

    Attributes:
        position: the instant at which the simulation is. end: the newest that is kept.
    """

    def __init__(self, simulation: Simulation, *, seconds: float = SECONDS, room: int = ROOM) -> None:
        self._simulation = simulation
        self._seconds = seconds
        self._room = room
        self.capture_times: deque[float] = deque(maxlen=1000)  # [s] of the last keyframes
        self._is_corrected = False  # what was done again came out otherwise, and was put right
        self._worked = 0.0  # [s] that ticks took since the last keyframe
        self.start_anew()

    def start_anew(self) -> None:
        """Forgets everything; now is the first instant."""
        self.position = self.end = 0
        self._beats: deque[Beat] = deque()  # the first leads away from instant `_first`
        self._first = 0
        self._keyframes: list[Keyframe] = []
        self._command_size = 0
        self._simulation.capture()  # what is loaded at its first use does not count as the cost of a keyframe
        self._simulation.state_hash()
        self._take_keyframe()

    # --- what there is ---------------------------------------------------------------------------------------------

    @property
    def is_rewound(self) -> bool:
        """Whether the simulation is at an instant before the newest."""
        return self.position < self.end

    @property
    def start_time(self) -> float:
        """Simulation time of the oldest instant [s]."""
        return self._keyframes[0].state.time

    @property
    def end_time(self) -> float:
        """Simulation time of the newest instant [s]."""
        return self._beats[-1].time if self._beats else self.start_time

    @property
    def ticks(self) -> tuple[int, int]:
        """Tick of the oldest and of the newest instant."""
        oldest = self._keyframes[0].state.tick
        return oldest, self._beats[-1].tick if self._beats else oldest

    @property
    def size(self) -> int:
        """What keyframes and commands take [bytes]."""
        return size_of(keyframe.state for keyframe in self._keyframes) + self._command_size

    @property
    def keyframes(self) -> Sequence[Keyframe]:
        """The states that are kept, oldest first."""
        return self._keyframes

    @property
    def oldest(self) -> Keyframe:
        """The state with which begins what is kept."""
        return self._keyframes[0]

    @property
    def newest(self) -> Keyframe:
        """The last state that is kept."""
        return self._keyframes[-1]

    @property
    def keyframe_count(self) -> int:
        """How many keyframes there are."""
        return len(self._keyframes)

    # --- going on --------------------------------------------------------------------------------------------------

    def note(
        self, commands: Sequence[Command], *, steps: bool, is_told: bool, seconds: float, is_whole: bool = True
    ) -> bool:
        """Keeps what has just happened at the newest instant: commands, then a step or not; it took `seconds`.

        Where that is not whole, as something else changed the simulation too, the instant is kept itself.

        Returns whether a keyframe was taken: then the oldest instant may be another.
        """
        self._worked += seconds
        if not (commands or steps):
            return False
        now = self._simulation.time
        size = sum(len(msgspec.json.encode(command)) for command in commands) if commands else 0
        self._beats.append(Beat(self._simulation.tick, now, tuple(commands), steps, is_told, size, is_whole))
        self._command_size += size
        self.end += 1
        self.position = self.end
        if not is_whole:
            self._take_keyframe()
            return True
        passed = now - self._keyframes[-1].state.time
        if passed < SHORTEST:
            return False
        is_affordable = self.capture_times[-1] <= SHARE * self._worked or self._worked >= MOST_WORK
        if is_affordable or passed >= LONGEST:
            self._take_keyframe()
            return True
        return False

    def fork(self) -> int:
        """What came after this instant is forgotten: it is the newest now. Returns how many ticks are."""
        dropped = list(islice(self._beats, self.position - self._first, None))
        for beat in dropped:
            self._beats.pop()
            self._command_size -= beat.size
        self.end = self.position
        self._keyframes = [keyframe for keyframe in self._keyframes if keyframe.instant <= self.position]
        return sum(beat.steps for beat in dropped)

    # --- going back and forth --------------------------------------------------------------------------------------

    def instant_at(self, seconds: float) -> int:
        """The newest instant at a simulation time [s]: the nearest tick, of those kept."""
        target = seconds + 0.5 / self._simulation.settings.tick_rate
        instant = self._keyframes[0].instant
        for number, beat in enumerate(self._beats, self._first + 1):
            if beat.time <= target:
                instant = max(instant, number)
        return instant

    def instant_of_tick(self, tick: int) -> int:
        """The newest instant of a tick; RequestError if it is not kept."""
        oldest, newest = self.ticks
        for number, beat in zip(range(self.end, self._first, -1), reversed(self._beats), strict=False):
            if beat.tick == tick and number >= self._keyframes[0].instant:
                return number
        if tick == oldest:
            return self._keyframes[0].instant
        raise RequestError(f"tick {tick} is not kept: the flight recorder has ticks {oldest} to {newest}")

    def instant_back(self, count: int) -> int:
        """The instant `count` steps before this one, the oldest if there are fewer."""
        instant = self.position
        while count and instant > self._keyframes[0].instant:
            instant -= 1
            count -= self._beat(instant).steps
        return instant

    def go_to(self, instant: int) -> bool:
        """Brings the simulation to a kept instant. Returns whether scene and settings may be others than frames tell of."""
        before, self._is_corrected = self.position, False
        keyframe = next(k for k in reversed(self._keyframes) if k.instant <= instant)
        if not keyframe.instant <= self.position <= instant:
            self._restore(keyframe)
            self.position = keyframe.instant
        while self.position < instant:
            self._again()
            self._add_keyframe()
        self._simulation.take_events()
        self._simulation.take_changes()
        self._simulation.take_stop()
        first, last = min(before, instant), max(before, instant)
        return self._is_corrected or any(
            beat.is_told for beat in islice(self._beats, first - self._first, last - self._first)
        )

    def repeat(self) -> bool:
        """Goes on by one step that is kept, with the commands before it, and those made while time stood still after it.

        Returns whether the scene may be another than its changes tell.
        """
        stepped = self._is_corrected = False
        while self.is_rewound and not (stepped and self._beat(self.position).steps):
            stepped |= self._beat(self.position).steps
            self._again()
        return self._is_corrected

    # --- inside ----------------------------------------------------------------------------------------------------

    def _again(self) -> None:
        """Does the next beat once more."""
        simulation, beat = self._simulation, self._beat(self.position)
        for command in beat.commands:
            try:
                apply_again(simulation, command)
            except ElysError as error:
                _log.error("what was done at tick %d cannot be done again: %s", beat.tick, error)
        if beat.steps:
            simulation.step()
        else:
            simulation.settle()
        self.position += 1
        for keyframe in self._keyframes_at(self.position):
            if not beat.is_whole:
                self._restore(keyframe)
            elif simulation.state_hash() != keyframe.state_hash:
                _log.warning(
                    "tick %d did not come out as it did: something beside components and commands decides what happens, as "
                    "a system of your own that remembers; going on from what was kept",
                    beat.tick,
                )
                self._restore(keyframe)
                self._is_corrected = True

    def _restore(self, keyframe: Keyframe) -> None:
        self._simulation.restore(keyframe.state)
        self._simulation.edited.put_back(keyframe.edited)

    def _keyframes_at(self, instant: int) -> Iterator[Keyframe]:
        return (keyframe for keyframe in self._keyframes if keyframe.instant == instant)

    def _beat(self, instant: int) -> Beat:
        """What leads away from an instant."""
        return self._beats[instant - self._first]

    def _add_keyframe(self) -> None:
        """Keeps this instant too, where the nearest keyframes are far and there is room: who looks here will look again."""
        place = bisect_right(self._keyframes, self.position, key=lambda keyframe: keyframe.instant)
        before = self._keyframes[place - 1]
        after = self._keyframes[place].instant if place < len(self._keyframes) else self.end
        if self.position - before.instant < NEAR or after - self.position < NEAR // 2:
            return
        state = self._simulation.capture(before.state)
        if self.size + state.size <= self._room:
            self._keyframes.insert(
                place, Keyframe(self.position, state, self._simulation.edited.kept(), self._simulation.state_hash())
            )

    def _take_keyframe(self) -> None:
        began = time.perf_counter()
        previous = self._keyframes[-1].state if self._keyframes else None
        state = self._simulation.capture(previous)
        self._keyframes.append(
            Keyframe(self.position, state, self._simulation.edited.kept(), self._simulation.state_hash())
        )
        self.capture_times.append(time.perf_counter() - began)
        self._worked = 0.0
        self._make_room()

    def _make_room(self) -> None:
        """Lets go of what is too old, and thins what takes too much room: the older, the thinner."""
        keyframes = self._keyframes
        now = keyframes[-1].state.time
        while len(keyframes) > 1 and keyframes[1].state.time <= now - self._seconds:
            del keyframes[0]
        while len(keyframes) > 1 and self.size > self._room:
            if len(keyframes) == 2:
                del keyframes[0]
                continue
            times = [keyframe.state.time for keyframe in keyframes]
            gaps = [(times[k + 1] - times[k - 1]) / (now - times[k] + SHORTEST) for k in range(1, len(times) - 1)]
            del keyframes[1 + gaps.index(min(gaps))]
            if times[-1] - times[0] > 0.0 and len(keyframes) <= 1 + (times[-1] - times[0]) / LONGEST:
                del keyframes[0]  # thin enough: what is oldest goes
        while self._beats and self._first < keyframes[0].instant:
            beat = self._beats.popleft()
            self._command_size -= beat.size
            self._first += 1
