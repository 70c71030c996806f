"""When a recording takes another exact state of the simulation, so that it can be run again from near any instant.

    the host ── `ExactSource` ── RecordingTap       beside it: parts of the host's memory, written by the tap's thread
             └─ the query EXACT ── a recorder       from outside

The first stands at the beginning. More come rarely: where what was recorded since is several times as long as a state,
some time has passed, and anything has moved; and at once where commands and steps do not tell what happened.
"""

from __future__ import annotations

from typing import Final, Protocol

from elys.bus.messages.exact_state import ExactHead

SECONDS: Final = 30.0  # [s] of simulation between two, at least
TIMES: Final = 4  # what was recorded since the last is at least so many times as long
BUILD_FACTS: Final = "elys.build"  # metadata: what the simulation is that was recorded


class ExactState(Protocol):
    """A state that its host keeps, to be written elsewhere."""

    @property
    def head(self) -> ExactHead:
        """Of which instant it is."""

    @property
    def size(self) -> int:
        """About how many bytes it takes."""

    def parts(self) -> list[bytes | memoryview]:
        """Head and state as bytes; may be called on any thread."""


class ExactListener(Protocol):
    """Somebody who keeps exact states."""

    def wants(self, head: ExactHead, size: int) -> bool:
        """Whether a state of this size would be taken."""

    def take(self, state: ExactState) -> None:
        """Takes one."""


class ExactSource(Protocol):
    """A host that has exact states."""

    @property
    def listeners(self) -> list[ExactListener]:
        """Who gets them."""

    def exact_now(self) -> ExactState | None:
        """As it is, between two ticks; None where it cannot be had now, but is given to listeners later."""

    def build_facts(self) -> dict[str, str]:
        """What program, on what machine, it is."""


class ExactNeed:
    """Of one recording. `is_urgent`: something was lost, and a state would tell how it goes on."""

    def __init__(self) -> None:
        self.is_urgent = True
        self.oldest = -1  # instant from which it can be run again; -1: from none yet
        self._said = 0  # [bytes] since the last
        self._last: ExactHead | None = None

    def said(self, size: int) -> None:
        """So many bytes were recorded."""
        self._said += size

    def is_due(self, head: ExactHead, size: int) -> bool:
        """Whether the state of this head, of about `size` bytes, is worth its place."""
        last = self._last
        if self.is_urgent or last is None or head.is_unexplained or head.epoch != last.epoch:
            return True
        if head.fork != last.fork and head.instant < self.oldest:
            return True  # the fork begins before all that is known
        if not self.is_pressing(head.time, size) or head.instant <= last.instant:
            return False
        return head.state_hash != last.state_hash

    def is_pressing(self, time: float, size: int) -> bool:
        """Whether at a time [s] enough has gone by since the last state."""
        last = self._last
        return last is None or (time - last.time >= SECONDS and self._said > TIMES * size)

    def taken(self, head: ExactHead) -> None:
        """A state was written."""
        if self._last is None or head.epoch != self._last.epoch or head.instant < self.oldest:
            self.oldest = head.instant
        self._last = head
        self._said = 0
        self.is_urgent = False
