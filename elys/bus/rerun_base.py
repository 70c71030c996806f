"""From where what comes next can be run again: the last exact state, and the commands since.

A file that begins in the middle of a session begins with both, so that it can be verified and forked without the files before it;
the host is asked for nothing, and its tick does not wait.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import msgspec

from elys.bus import topics
from elys.bus.messages.exact_state import ExactHead, unpack_head
from elys.common.errors import MessageError


class _Told(msgspec.Struct):
    """What of a command's record says whether an exact state has it."""

    epoch: int = 0
    beat: int = -1
    fork: int = 0


class Remembered(NamedTuple):
    """A message as it was recorded."""

    channel: str
    body: bytes
    log_time: int  # [ns]


_records: Final = msgspec.json.Decoder(_Told)


class RerunBase:
    """Of one recording. Show it all that is recorded, in the order in which it comes."""

    def __init__(self) -> None:
        self._head: ExactHead | None = None
        self._state: Remembered | None = None
        self._commands: list[tuple[_Told, Remembered]] = []

    def recorded(self, channel: str, body: bytes, log_time: int) -> None:
        """Takes a message."""
        if channel == topics.EXACT.name:
            self._take_state(Remembered(channel, bytes(body), log_time))
        elif channel == topics.COMMANDS.name:
            try:
                told = _records.decode(body)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                return  # it is said where the recording is read
            self._commands.append((told, Remembered(channel, bytes(body), log_time)))

    @property
    def messages(self) -> list[Remembered]:
        """What another file begins with; nothing before there is an exact state."""
        if self._state is None:
            return []
        return [self._state, *(message for _, message in self._commands)]

    def _take_state(self, state: Remembered) -> None:
        """Keeps it, and of the commands those that it does not contain: it may have come later than some that do not."""
        try:
            head = unpack_head(state.body)
        except MessageError:
            return
        known = self._head
        if known is not None and known.epoch == head.epoch and (known.fork, known.instant) > (head.fork, head.instant):
            return
        self._head, self._state = head, state
        self._commands = [(told, message) for told, message in self._commands if _is_after(told, head)]


def _is_after(told: _Told, head: ExactHead) -> bool:
    if told.epoch != head.epoch or told.fork != head.fork:
        return told.epoch == head.epoch and told.fork > head.fork
    return told.beat > head.instant
