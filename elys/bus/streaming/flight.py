"""The frames that a sender has on their way: what each told, by which connection, and what is known of its fate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from elys.bus.streaming.held import Told
from elys.bus.streaming.wire import WINDOW, Ack


@dataclass(slots=True)
class Sent:
    """One frame. It `is_lost` most likely where one sent later by the same connection has come; it may come yet."""

    told: Told
    lane: int
    size: int  # [B]
    at: float  # [s]
    is_lost: bool = False


class Flight:
    """Frames that were not acknowledged, from the oldest that can still be to the newest."""

    def __init__(self) -> None:
        self._frames: dict[int, Sent] = {}

    def add(self, sent: Sent) -> None:
        """Notes one more."""
        self._frames[sent.told.number] = sent

    def all(self) -> list[Sent]:
        """Every one that may come, oldest first, lost or not."""
        return list(self._frames.values())

    def pending(self) -> list[Sent]:
        """Those that are expected, oldest first."""
        return [sent for sent in self._frames.values() if not sent.is_lost]

    def arrived(self, ack: Ack) -> tuple[list[Sent], int]:
        """Takes out those that an ack names, oldest first; and how many others must be lost then."""
        numbers = {ack.newest} | {ack.newest - 1 - bit for bit in range(WINDOW) if ack.bits >> bit & 1}
        found = [self._frames.pop(number) for number in sorted(numbers & self._frames.keys())]
        latest = {sent.lane: sent.told.number for sent in found}
        lost = self._lose(lambda sent: sent.told.number < latest.get(sent.lane, 0))
        for number in [number for number in self._frames if ack.newest - number >= WINDOW]:
            lost += not self._frames.pop(number).is_lost
        return found, lost

    def give_up(self, lanes: int) -> int:
        """What went by connections other than these (bits) is lost; how many that is."""
        return self._lose(lambda sent: not lanes >> sent.lane & 1)

    def give_up_before(self, time: float) -> int:
        """What was sent before is lost; how many that is."""
        return self._lose(lambda sent: sent.at < time)

    def others(self, number: int) -> int:
        """Bit i: frame `number` - 1 - i is expected."""
        bits = 0
        for sent in self._frames.values():
            back = number - 1 - sent.told.number
            if not sent.is_lost and 0 <= back < WINDOW:
                bits |= 1 << back
        return bits

    def _lose(self, is_gone: Callable[[Sent], bool]) -> int:
        gone = [sent for sent in self._frames.values() if not sent.is_lost and is_gone(sent)]
        for sent in gone:
            sent.is_lost = True
        return len(gone)
