"""What a simulation has done, beat by beat, told to who records it so that it can be run again.

    instant 0 ─ beat ─▶ 1 ─ beat ─▶ 2 ...      a beat: commands, and then a step or none

None follows while time stands still, and where an edit was made between two steps.

Instants are counted over the whole run of a host. Of beats that are steps and nothing else nothing is said: the numbers of the
others tell how many there were. What commands and steps do not explain, an exact state does.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import msgspec
import zstandard

from elys.bus.access.limits import MAX_MESSAGE_SIZE
from elys.bus.exact_keeping import BUILD_FACTS, LINEAGE, ExactListener
from elys.bus.messages.commands import Command, CommandRecord, Resume
from elys.bus.messages.exact_state import ExactHead, ExactReply, ExactRequest
from elys.common.errors import RequestError
from elys.sim_node.build_facts import build_facts
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State

_ROOM: Final = 4096  # [bytes] of a message beside the state
_LOOK: Final = 64  # instants between two looks whether a state is wanted, where no keyframes are taken anyway


@dataclass(frozen=True, slots=True)
class Exact:
    """An exact state that is written when somebody has time to."""

    head: ExactHead
    state: State

    @property
    def size(self) -> int:
        """What its arrays take [bytes]."""
        return self.state.size

    def parts(self) -> list[bytes | memoryview]:
        """Head and state."""
        return [self.head.pack(), *self.state.to_parts()]


class _Mark(NamedTuple):
    """What is known of an instant at which the flight recorder has a keyframe."""

    changes: int
    forks: int
    is_unexplained: bool


class Chronicle:
    """Of one simulation. `tell` gets each command once it is known to which beat it belongs.

    Attributes:
        is_broken: a command failed in the middle, in the beat that is under way.
        changes: how many commands have changed the simulation. forks: how often another future was begun.
        listeners: who keeps exact states. lineage: of which recording it is a fork, see `elys.bus.lineage`; {} of none.
    """

    def __init__(
        self,
        simulation: Simulation,
        flight: FlightRecorder | None,
        *,
        epoch: int,
        tell: Callable[[CommandRecord], None],
    ) -> None:
        self.changes = 0
        self.forks = 0
        self.lineage: dict[str, str] = {}
        self.listeners: list[ExactListener] = []
        self._simulation = simulation
        self._flight = flight
        self._epoch = epoch
        self._tell = tell
        self._first = 0  # the instant at which the flight recorder began
        self._count = 0  # instants, where there is no flight recorder
        self._waiting: list[CommandRecord] = []  # of the beat that is under way
        self._done: list[Command] = []  # what in it changed the simulation
        self._forked_from = -1  # the instant, of a fork that no command has told of yet
        self._is_fork_new = False
        self._void_until = -1  # the newest instant of all futures that were left
        self.is_broken = False
        self._marks = {0: _Mark(0, 0, False)}
        self._last_beat = -1  # that held a change
        self._size = 0  # of the last exact state [bytes]

    @property
    def instant(self) -> int:
        """The instant at which the simulation is."""
        return self._first + self._flight.position if self._flight is not None else self._count

    @property
    def has_changes(self) -> bool:
        """Whether commands have changed the simulation since the last instant."""
        return any(record.number > 0 for record in self._waiting)

    def had_another(self, instant: int) -> bool:
        """Whether an instant is of a future that was left, also: what was told of it is void."""
        return instant <= self._void_until

    def leads_to(self, *, steps: bool) -> int:
        """The instant to which the beat leads that is under way, and that ends with a step or not."""
        return self.instant + bool(steps or self._done or self.is_broken)

    # --- what happens ------------------------------------------------------------------------------------------------

    def forked(self) -> None:
        """What came after this instant is void; the flight recorder has it still."""
        self._leave_future()
        self._forked_from = self.instant
        self._is_fork_new = True
        self._marks = {instant: mark for instant, mark in self._marks.items() if instant <= self.instant}

    def breaks(self) -> None:
        """A command failed in the middle."""
        self.is_broken = True

    def add(self, record: CommandRecord, *, is_change: bool) -> None:
        """A command was applied or refused. The beat that it belongs to is under way."""
        is_resumed = isinstance(record.command, Resume)
        is_fork = self._forked_from >= 0 and (is_change or is_resumed)
        is_broken = self.is_broken and not (record.accepted or any(one.is_broken for one in self._waiting))
        self.changes += is_change
        self._waiting.append(
            msgspec.structs.replace(
                record,
                epoch=self._epoch,
                number=self.changes if is_change else -1,
                previous=self._last_beat if is_change else -1,
                beat=self.instant if is_resumed else self.instant + 1,
                fork=self.forks,
                forked_from=self._forked_from if is_fork else -1,
                is_broken=is_broken,
            )
        )
        if is_change:
            self._last_beat = self.instant + 1
        if is_fork:
            self._forked_from = -1

    def tell(self, *, steps: bool, physics_of: int = -1) -> None:
        """The beat is done but for what is published of it: its commands are told."""
        for record in self._waiting:
            self._tell(msgspec.structs.replace(record, steps=steps, physics_of=physics_of))
        self._done += [record.command for record in self._waiting if record.number > 0]
        self._waiting.clear()

    def note(self, *, steps: bool, is_told: bool, seconds: float, is_whole: bool = True) -> bool:
        """The beat has ended, see `FlightRecorder.note`. Returns whether the oldest instant may be another."""
        done, self._done = self._done, []
        flight, is_taken = self._flight, False
        if self.is_broken:
            self._begin_anew()
            is_whole = False
        elif flight is not None:
            is_taken = flight.note(done, steps=steps, is_told=is_told, seconds=seconds, is_whole=is_whole)
        elif done or steps:
            self._count += 1
        if is_taken or not is_whole:
            self._mark(is_unexplained=not is_whole)
        self._offer(is_keyframe=is_taken, is_unexplained=not is_whole)
        return is_taken

    # --- exact states ------------------------------------------------------------------------------------------------

    def exact_now(self, *, is_unexplained: bool = False) -> Exact | None:
        """The simulation as it is between two ticks; None while it shows the past, which may come to nothing."""
        if self._flight is not None and self._flight.is_rewound:
            return None
        simulation, flight = self._simulation, self._flight
        newest = flight.newest if flight is not None else None
        if newest is not None and flight is not None and newest.instant == flight.position:
            state = newest.state
        else:
            state = simulation.capture(newest.state if newest is not None else None)
        self._size = state.size
        return Exact(self._head(is_unexplained=is_unexplained), state)

    def facts(self) -> dict[str, dict[str, str]]:
        """Metadata for recordings: what program on what machine this is, and of which recording a fork."""
        threads = self._simulation.physics.settings.threads
        build = {**build_facts(), "threads": str(threads), "epoch": str(self._epoch)}
        return {BUILD_FACTS: build, **({LINEAGE: self.lineage} if self.lineage else {})}

    async def give_exact(self, request: ExactRequest, key: str) -> ExactReply:
        """Answers who records from outside; the bytes are made on another thread."""
        exact = self._kept(request) or self.exact_now()
        if exact is None:
            raise RequestError("the simulation shows its past: ask again when it has returned, or gone on from there")
        size, packed = await asyncio.to_thread(_packed, exact)
        if len(packed) > MAX_MESSAGE_SIZE - _ROOM:
            raise RequestError(f"the exact state has {len(packed) >> 20} MiB, more than one message may carry")
        return ExactReply(packed=packed, size=size, facts=self.facts())

    # --- inside ------------------------------------------------------------------------------------------------------

    def _leave_future(self) -> None:
        assert self._flight is not None
        self.forks += 1
        self._void_until = max(self._void_until, self._first + self._flight.end)

    def _begin_anew(self) -> None:
        """What led here cannot be done again: the instants before it are gone."""
        self.is_broken = False
        if self._flight is None:
            self._count += 1
            return
        if self._flight.is_rewound:
            self._leave_future()
        self._first = self.instant + 1
        self._flight.start_anew()
        self._marks.clear()

    def _mark(self, *, is_unexplained: bool) -> None:
        oldest = self._first + self._flight.oldest.instant if self._flight is not None else self.instant
        self._marks = {instant: mark for instant, mark in self._marks.items() if instant >= oldest}
        self._marks[self.instant] = _Mark(self.changes, self.forks, is_unexplained)

    def _offer(self, *, is_keyframe: bool, is_unexplained: bool) -> None:
        """Gives the state to who wants it, where it has to be or is there anyway."""
        is_time = is_keyframe or is_unexplained or self._is_fork_new
        if not self.listeners or not (is_time or (self._flight is None and self._count % _LOOK == 0)):
            return
        self._is_fork_new = False
        head = self._head(is_unexplained=is_unexplained)
        wanting = [listener for listener in self.listeners if listener.wants(head, self._size)]
        exact = self.exact_now(is_unexplained=is_unexplained) if wanting else None
        if exact is not None:
            for listener in wanting:
                listener.take(exact)

    def _kept(self, request: ExactRequest) -> Exact | None:
        """A keyframe that will do."""
        if self._flight is None or not (request.newest or request.instant >= 0):
            return None
        kept = [(self._first + keyframe.instant, keyframe) for keyframe in self._flight.keyframes]
        kept = [
            (instant, keyframe) for instant, keyframe in kept if instant >= request.instant and instant in self._marks
        ]
        if not kept:
            return None
        instant, keyframe = kept[-1 if request.newest else 0]
        changes, forks, is_unexplained = self._marks[instant]
        state = keyframe.state
        head = ExactHead(
            self._epoch, instant, changes, state.tick, state.time, keyframe.state_hash, forks, is_unexplained
        )
        return Exact(head, state)

    def _head(self, *, is_unexplained: bool) -> ExactHead:
        simulation = self._simulation
        return ExactHead(
            epoch=self._epoch,
            instant=self.instant,
            changes=self.changes,
            tick=simulation.tick,
            time=simulation.time,
            state_hash=simulation.state_hash(),
            fork=self.forks,
            is_unexplained=is_unexplained,
        )


def _packed(exact: Exact) -> tuple[int, bytes]:
    """The length of an exact state, and it compressed."""
    data = b"".join(exact.parts())
    return len(data), zstandard.ZstdCompressor(level=1).compress(data)
