"""How a recording stays below a rate: what tells how a run went is thinned first, then states; all that happened is kept.

Every second it is looked at how fast the file grew. Too fast: of profiles and diagnostics fewer are kept, then of states every
second, every fourth and so on, evenly; where there is room again, more. What counts is the file's size, so what packs well is
thinned less.
"""

from __future__ import annotations

import math
from typing import Final

from elys.bus import topics
from elys.bus.messages.state_frame import FORKED, HEADER, TOLD_AGAIN

THINNED: Final = "elys.thinned"  # metadata of a recording in which something was left out for its rate
_WINDOW: Final = 1.0  # [s]
_PAYBACK: Final = 8.0  # [s] in which what was too much is saved again
_ROOMY: Final = 0.45  # of the rate: twice as much would still fit
_MOST: Final = 8  # levels: of states every 128th
_FIGURES: Final = (topics.PROFILE.name, topics.DIAGNOSTICS.name)
_TURNS: Final = 1 | TOLD_AGAIN | FORKED  # flags of a state


class RateBudget:
    """Of one recording that may grow by `rate` [bytes/s] of wall clock, on average from its first state on."""

    def __init__(self, rate: float) -> None:
        self.level = 0  # 0: all is kept
        self._rate = rate
        self._begun: tuple[int, int] | None = None  # when [ns], and how large the recording was [bytes]
        self._window = (0, 0)  # likewise
        self._counts = dict.fromkeys((topics.STATE.name, *_FIGURES), 0)
        self._last = (-1, -1, 0)  # epoch, tick and flags of a state

    def takes(self, channel: str, body: bytes | memoryview, time_ns: int, size: int) -> bool:
        """Whether a message is recorded that comes when the recording has this size [bytes]."""
        if channel not in self._counts:
            return True
        if self._begun is None:
            self._begun = self._window = (time_ns, size)
        elif time_ns - self._window[0] >= _WINDOW * 1e9:
            self._look(time_ns, size)
        if channel == topics.STATE.name:
            stride = 1 << max(self.level - 1, 0)
            if self._is_turn(body):
                self._counts[channel] = 0  # without it who reads would take another history for this one
        else:
            stride = 1 << min(2 * self.level, _MOST)
        self._counts[channel] += 1
        return (self._counts[channel] - 1) % stride == 0

    def _look(self, time_ns: int, size: int) -> None:
        assert self._begun is not None
        rate = (size - self._window[1]) / ((time_ns - self._window[0]) * 1e-9)
        debt = size - self._begun[1] - self._rate * (time_ns - self._begun[0]) * 1e-9
        allowed = self._rate - min(max(debt, 0.0) / _PAYBACK, 0.5 * self._rate)
        if rate > allowed:
            self.level = min(self.level + math.ceil(math.log2(rate / allowed)), _MOST)
        elif rate < _ROOMY * allowed:
            self.level = max(self.level - 1, 0)
        self._window = (time_ns, size)

    def _is_turn(self, body: bytes | memoryview) -> bool:
        """Whether a state goes another way than the one before it: back, as of a fork, or from playing to standing still."""
        if len(body) < HEADER.size:
            return True
        epoch, tick, *_, flags = HEADER.unpack_from(body)
        before, self._last = self._last, (epoch, tick, flags & _TURNS)
        return bool(before[0] != epoch or tick <= before[1] or before[2] != flags & _TURNS)
