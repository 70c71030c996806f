"""What happened in a recorded run, so that it can be run again: its beats that held commands, and where exact states stand.

The order of commands and states is told by their numbers and not by where they stand in the file: a recorder from outside gets
them on different ways. What forks made void is left out. Of a beat that is not told here, a step is all there was.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from elys.bus import codec
from elys.bus.exact_keeping import BUILD_FACTS
from elys.bus.messages.commands import CommandRecord
from elys.bus.messages.exact_state import EXACT_HEADER, ExactHead, unpack_head
from elys.bus.recording import Recording
from elys.bus.topics import COMMANDS, STATUS, Encoding
from elys.bus.transports.mcap import EXACT_CHANNEL
from elys.bus.transports.mcap_reading import McapReader, Place
from elys.common.errors import MessageError, RecordingError

_MOST_MISSING: Final = 100  # in a row that are listed, and the last
_log = logging.getLogger(__name__)


class Beat(NamedTuple):
    """Commands at an instant, and what followed."""

    instant: int  # to which it leads
    records: tuple[CommandRecord, ...]  # of what changed the simulation, and of refused commands between
    steps: bool
    physics_of: int  # instant whose physics was put back; -1: none was
    is_broken: bool


class KeptState(NamedTuple):
    """An exact state, and where it stands in the file."""

    head: ExactHead
    place: Place


class Missing(NamedTuple):
    """A change that the simulation counted and that is not in the file."""

    number: int
    beat: int  # to which it belonged; -1: not known


class _Status(msgspec.Struct):
    epoch: int = 0
    changes: int = 0


_statuses: Final = msgspec.json.Decoder(_Status)


@dataclass(frozen=True, slots=True)
class Course:
    """Of one epoch.

    Attributes:
        beats: those with commands, by the instant to which they lead.
        states: exact states, by instant. kept_physics: the instants whose physics is put back later.
        missing: changes that are not in the file, by number.
        last_changes: how many changes there were in the end.
    """

    epoch: int
    beats: dict[int, Beat]
    states: dict[int, KeptState]
    kept_physics: frozenset[int]
    missing: tuple[Missing, ...]
    last_changes: int

    def state_before(self, time: float) -> KeptState:
        """The last exact state that is not after a time [s], the first if all are."""
        return max(
            (state for state in self.states.values() if state.head.time <= time),
            key=lambda state: state.head.instant,
            default=self.first,
        )

    @property
    def first(self) -> KeptState:
        """The exact state from which all that can be is run again."""
        return self.states[min(self.states)]

    def state_after(self, instant: int) -> KeptState | None:
        """The first exact state after an instant."""
        later = [number for number in self.states if number > instant]
        return self.states[min(later)] if later else None


def read_course(recording: Recording) -> Course:
    """What happened in a recording's run.

    Raises:
        RecordingError: it holds no exact state of it.
    """
    reader, epoch = recording.reader, recording.epoch
    states = list(_states(reader, epoch))
    if not states:
        raise RecordingError(
            f"{recording.path} holds no exact state of the simulation, so it cannot be run again: it was recorded by "
            "an earlier ELYS, of a replay, or was cut before the first was written"
            + (f", or it is in what is damaged ({recording.lost[0].part.sentence})" if recording.lost else "")
        )
    records = [record for record in _records(reader, recording.path) if record.epoch == epoch and record.beat >= 0]
    limits = _limits(records, states)
    valid = [state for state in states if state.head.instant <= limits.get(state.head.fork, state.head.instant)]
    beats = _beats([record for record in records if record.beat <= limits.get(record.fork, record.beat)])
    told = max([*_told_changes(reader, epoch)][:-1], default=0)  # on its way the last may have overtaken a command
    first = min(state.head.changes for state in states)
    last = max(told, *(state.head.changes for state in states), *(record.number for record in records), 0)
    return Course(
        epoch=epoch,
        beats=beats,
        states={state.head.instant: state for state in sorted(valid, key=lambda state: state.head.fork)},
        kept_physics=frozenset(beat.physics_of for beat in beats.values() if beat.physics_of >= 0),
        missing=_missing(records, first, last),
        last_changes=last,
    )


def exact_state(reader: McapReader, place: Place) -> bytes:
    """The state that stands at a place, without its head."""
    return reader.message_at(place).body[EXACT_HEADER.size :]


def build_of(recording: Recording) -> dict[str, str]:
    """What program, on what machine, made a recording; {} where it does not say."""
    facts = recording.reader.metadata.get(BUILD_FACTS, {})
    return dict(facts) if facts.get("epoch") == str(recording.epoch) else {}


def _states(reader: McapReader, epoch: int) -> Iterable[KeptState]:
    for message in reader.messages((EXACT_CHANNEL,)):
        try:
            head = unpack_head(message.body)
        except MessageError as error:
            _log.warning("an exact state in %s is left out: %s", reader.path, error)
            continue
        if head.epoch == epoch:
            yield KeptState(head, message.place)


def _records(reader: McapReader, path: Path) -> Iterable[CommandRecord]:
    for message in reader.messages((COMMANDS.name,)):
        try:
            yield codec.decode_body(message.body, CommandRecord, Encoding.JSON)
        except MessageError as error:
            _log.warning("a command in %s cannot be read, as if it were not there: %s", path, error)


def _told_changes(reader: McapReader, epoch: int) -> Iterable[int]:
    """What the last statuses say of how many changes there were."""
    last = max(0, reader.chunk_count - 8)
    for message in reader.messages((STATUS.name,), start=Place(last, 0)):
        try:
            status = _statuses.decode(message.body)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            continue
        if status.epoch == epoch:
            yield status.changes


def _limits(records: Iterable[CommandRecord], states: Iterable[KeptState]) -> dict[int, int]:
    """By fork the last instant of it that later forks left valid."""
    begins: dict[int, int] = {}
    for state in states:  # a state tells only that its fork began before it
        begins[state.head.fork] = min(begins.get(state.head.fork, state.head.instant), state.head.instant - 1)
    begins |= {record.fork: record.forked_from for record in records if record.forked_from >= 0}
    known = {*begins, *(record.fork for record in records)}
    return {
        fork: min(begins[later] for later in begins if later > fork)
        for fork in known
        if any(later > fork for later in begins)
    }


def _beats(records: Iterable[CommandRecord]) -> dict[int, Beat]:
    collected: dict[int, list[CommandRecord]] = {}
    for record in records:
        collected.setdefault(record.beat, []).append(record)
    beats = {}
    for instant, held in collected.items():
        telling = [record for record in held if record.number > 0 or record.is_broken]
        if telling:  # the rest was refused, asked of the clock, or said while the past was shown
            beats[instant] = Beat(
                instant=instant,
                records=tuple(held),
                steps=telling[0].steps,
                physics_of=telling[0].physics_of,
                is_broken=any(record.is_broken for record in telling),
            )
    return beats


def _missing(records: Iterable[CommandRecord], first: int, last: int) -> tuple[Missing, ...]:
    by_number = {record.number: record for record in records if record.number > first}
    missing: list[Missing] = []
    before = first
    for number in (*sorted(by_number), last + 1):
        gap = range(before + 1, number)
        before = number
        missing += [
            Missing(one, by_number[one + 1].previous if one + 1 in by_number else -1)
            for one in (*gap[:_MOST_MISSING], *gap[_MOST_MISSING:][-1:])
        ]
    return tuple(missing)
