"""The rest of a recorded session as cues for another: the same commands in the same beats, as far as they still can be done.

    fork at an instant ─ cue ─▶ tick of the new session ─ cue ─▶ ...       with nothing else added: the same bits

Commands are asked for again and not forced: where the fork has become another, some may be refused, which its recording tells.
"""

from __future__ import annotations

import logging
from typing import NamedTuple

from elys.bus.course import Course
from elys.bus.edit_parts import edits_of
from elys.bus.messages.commands import CommandRecord, CommandRequest, Grab, Release

ORIGIN = "fork"  # of what was added to the recorded session
_log = logging.getLogger(__name__)


class Cue(NamedTuple):
    """What the next tick does."""

    requests: tuple[CommandRequest, ...] = ()
    steps: bool = True
    keeps_physics: bool = False  # as it is before the tick
    puts_physics_back: bool = False  # to what was kept, after the commands


class Repetition:
    """Cues from an instant of a course on.

    Attributes:
        is_done: all cues were given.
    """

    def __init__(
        self,
        course: Course,
        instant: int,
        *,
        last_instant: int,
        first: tuple[CommandRequest, ...] = (),
        step_limit: int = 0,
        repeats: bool = True,
    ) -> None:
        """`first` is asked for before all else. It ends at `last_instant`, or with a `step_limit` after so many steps.

        Unless it `repeats`, there are steps alone.
        """
        self._course = course
        self._instant = instant
        self._last_instant = last_instant
        self._first = first
        self._steps_left = step_limit
        self._is_limited = step_limit > 0
        self._repeats = repeats

    @property
    def is_done(self) -> bool:
        """Whether all cues were given."""
        return self._steps_left <= 0 if self._is_limited else self._instant >= self._last_instant

    def cue(self) -> Cue | None:
        """What the next tick does; None at the end."""
        if self.is_done:
            return None
        first, self._first = self._first, ()
        beat = self._course.beats.get(self._instant + 1)
        if beat is None or not self._repeats:
            there = self._course.states.get(self._instant + 1)
            if self._repeats and there is not None and there.head.is_unexplained:
                _log.warning("what happened at tick %d is not in commands and steps: the fork departs", there.head.tick)
            told = Cue(requests=first, steps=beat is None or beat.steps)
        else:
            told = Cue(
                requests=(*first, *(_again(record) for record in beat.records if _matters(record))),
                steps=beat.steps,
                keeps_physics=self._instant in self._course.kept_physics,
                puts_physics_back=beat.physics_of >= 0,
            )
        self._instant += 1
        self._steps_left -= told.steps
        return told


def _matters(record: CommandRecord) -> bool:
    """Whether a command changed anything: several edits that are refused let bodies follow those before them."""
    return record.number > 0 or (not record.accepted and len(edits_of(record.command)) > 1)


def _again(record: CommandRecord) -> CommandRequest:
    command = record.command
    holder = command.holder if isinstance(command, Grab | Release) else ""
    return CommandRequest(origin=holder or record.origin, command=command)
