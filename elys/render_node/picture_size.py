"""How large and how costly pictures from elsewhere may be, so that they come quickly over a way that carries now more, now less.

a picture came: bytes, time on the way ──> what the way carries ──> bit rate of H.264
                                     └──> longer than SLOW: a step smaller; QUICK for a while: a step larger
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

STEPS: Final = (1.0, 0.75, 0.5, 0.35)  # of a window's edges
SLOW: Final = 0.1  # [s] on the way, beyond what the smallest message takes, above which pictures become smaller
QUICK: Final = 0.03  # [s] below which they may become larger
SLOW_PICTURES: Final = 2  # in a row, that a step is taken for
FIRST_TRIAL: Final = 2.0  # [s] of quick pictures before a larger size is tried; after each that failed twice as long
LONGEST_TRIAL: Final = 60.0  # [s]
LEAST_SPAN: Final = 30.0  # [s] over which the shortest way is looked for where no round trip is known
NOISE: Final = 0.003  # [s] by which times differ whatever the way carries
CARRIED: Final = (
    8  # pictures of which the quickest tells what the way carries: whatever else was going on only ever adds
)
PLENTY: Final = 50e6  # [bit/s] above which an encoder takes what it needs
SHARE: Final = 0.6  # of what the way carries, for the pictures
LEAST_RATE: Final = 150e3  # [bit/s]
EDGE: Final = 16  # [pixels] of the smallest picture


class PictureSize:
    """Follows what the way carries. Times are given, so that it needs neither clock nor bus."""

    def __init__(self) -> None:
        self._step = 0
        self._ways: deque[tuple[float, float]] = deque()  # when [s], how long on the way [s]
        self._rates: deque[float] = deque(maxlen=CARRIED)  # [bit/s]
        self._slow = 0
        self._quick_since: float | None = None
        self._trial = FIRST_TRIAL  # [s]
        self._tried = False  # the size is larger than the one before, and nothing is known of it yet
        self.bit_rate = 0.0  # [bit/s] that H.264 may take; 0: any

    @property
    def scale(self) -> float:
        """Of a window's edges that pictures are to have."""
        return STEPS[self._step]

    @property
    def rate(self) -> float:
        """[bit/s] that the way carries, as the last pictures had it; 0 before that can be told."""
        return max(self._rates, default=0.0)

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Of pictures for a window [pixels]."""
        if self._step == 0:
            return width, height
        return max(round(width * self.scale), EDGE), max(round(height * self.scale), EDGE)

    def note(
        self, now: float, way: float, size: int, *, round_trip: float | None = None, is_meant: bool = True
    ) -> None:
        """A picture of `size` bytes came at `now` [s], `way` [s] of which passed neither here nor in the render node.

        `round_trip` [s] is what a message of no size needs; without it the quickest picture of the last LEAST_SPAN stands for it.

        With `is_meant` it was of the size that `size` tells; others only tell what the way carries.
        """
        self._ways.append((now, way))
        while now - self._ways[0][0] > LEAST_SPAN:
            self._ways.popleft()
        least = min(way for _, way in self._ways)
        waited = way - (least if round_trip is None else min(round_trip, least))
        self._rates.append(size * 8.0 / max(waited, NOISE))
        if len(self._rates) == CARRIED:
            self._follow_rate()
        if is_meant:
            self._follow_time(now, waited, size)

    def missed(self) -> None:
        """A picture did not come while it was waited for: the way carries so little that nothing can be measured, or is lost."""
        self._slow += 1
        self._quick_since = None
        if self._slow >= SLOW_PICTURES:
            self._rates.clear()
            self.bit_rate = LEAST_RATE
            self._take_smaller()

    def _take_smaller(self) -> None:
        if self._step == len(STEPS) - 1:
            return
        self._step, self._slow, self._quick_since = self._step + 1, 0, None
        if self._tried:
            self._trial = min(self._trial * 2.0, LONGEST_TRIAL)
        self._tried = False

    def _follow_rate(self) -> None:
        meant = max(self.rate * SHARE, LEAST_RATE)
        if meant > PLENTY:
            self.bit_rate = 0.0
        # In steps of a half, for each change begins the stream anew.
        elif self.bit_rate == 0.0 or not self.bit_rate / 1.6 < meant < self.bit_rate * 1.6:
            self.bit_rate = LEAST_RATE * 1.5 ** math.floor(math.log(meant / LEAST_RATE, 1.5) + 1e-9)

    def _follow_time(self, now: float, waited: float, size: int) -> None:
        # Where the last few came quickly it is something else that takes time, as a busy processor: smaller ones do not help.
        is_size = size * 8.0 > SLOW / 2.0 * self.rate
        self._slow = self._slow + 1 if waited > SLOW and is_size else 0
        if self._slow >= SLOW_PICTURES and self._step < len(STEPS) - 1:
            self._take_smaller()
            return
        if waited > QUICK:
            self._quick_since = None
            return
        self._quick_since = now if self._quick_since is None else self._quick_since
        if now - self._quick_since < self._trial:
            return
        if self._tried:  # the larger size has proved itself
            self._trial, self._tried = FIRST_TRIAL, False
        if self._step:
            self._step, self._quick_since, self._tried = self._step - 1, now, True
