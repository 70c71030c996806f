"""Where in a clip somebody is: time that goes on, repeats, turns round or stops, and which instants it passes meanwhile.

Who starts at an instant passes it, who ends a tick there does not: the next tick starts there. So each pass tells it once,
however long ticks are. `fmod` gives the rest of a division exactly: what a tick ends with is the very number that the next one
starts from.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

REPEAT, PING_PONG, ONCE = range(3)  # as the column of Animation.loop has them
MOST_PASSES: Final = 1000  # of one instant in one tick that are told

Times = NDArray[np.float64]


class Way(NamedTuple):
    """How N went through their periods in a tick.

    Attributes:
        start, end: [N] s where they were and are, within the period: a clip's length, of a ping-pong there and back.
        laps: [N] int64 how often they came over the period's end into the next one, below 0 backwards.
        goes_on: [N] 1 where time ran forwards, -1 backwards, 0 where it stood.
        ended: [N] whether they came to stop at an end in this tick.
    """

    start: Times
    end: Times
    laps: NDArray[np.int64]
    goes_on: NDArray[np.int8]
    ended: NDArray[np.bool_]

    def of(self, rows: NDArray[np.intp]) -> Way:
        """Some of them."""
        return Way(self.start[rows], self.end[rows], self.laps[rows], self.goes_on[rows], self.ended[rows])


def periods(loop: NDArray[np.uint8], duration: Times) -> Times:
    """[N] s after which all begins again."""
    return np.asarray(np.where(loop == PING_PONG, 2.0 * duration, duration))


def wrapped(times: Times, loop: NDArray[np.uint8], duration: Times) -> Times:
    """[N] times that clips of such durations [N] can be at: within the clip, of a ping-pong within there and back."""
    period = periods(loop, duration)
    around = np.fmod(times, np.where(period > 0.0, period, 1.0))
    around = np.where(around < 0.0, around + period, around)
    around = np.minimum(around, np.nextafter(period, 0.0))  # what was added may round to the whole period
    return np.where(period > 0.0, np.where(loop == ONCE, np.clip(times, 0.0, duration), around), 0.0)


def go_on(times: Times, steps: Times, loop: NDArray[np.uint8], duration: Times) -> Way:
    """Lets [N] times go on by [N] steps [s], which may be longer than the clips, or backwards."""
    start = wrapped(times, loop, duration)
    goal = start + np.where(duration > 0.0, steps, 0.0)
    end = wrapped(goal, loop, duration)
    period = periods(loop, duration)
    laps = np.rint((goal - end) / np.where(period > 0.0, period, 1.0))
    laps = np.where((loop == ONCE) | (period <= 0.0), 0.0, np.clip(laps, -1e15, 1e15)).astype(np.int64)
    goes_on = np.where(period > 0.0, np.sign(steps), 0.0).astype(np.int8)
    limit = np.where(goes_on > 0, duration, 0.0)
    ended = (loop == ONCE) & (goes_on != 0) & (end == limit) & (start != limit)
    return Way(start, end, laps, goes_on, ended)


def clip_times(within: Times, loop: NDArray[np.uint8], duration: Times) -> Times:
    """[N] times in the clip itself: on the way back of a ping-pong they run backwards."""
    return np.where((loop == PING_PONG) & (within > duration), 2.0 * duration - within, within)


def ends_met(way: Way, loop: NDArray[np.uint8]) -> NDArray[np.int64]:
    """[N] how often an end was met: passes over the period's end, or the one at which it stops."""
    return np.asarray(np.abs(way.laps) + way.ended)


def instants_met(way: Way, row: int, loop: int, duration: float, instants: Sequence[float]) -> list[int]:
    """Which instants [s] of a clip a row of a way passes, in the order in which it does; the same one more than once if it does.

    Instants beyond the clip's end are never passed. After MOST_PASSES of one the rest is left out.
    """
    start, end, sign = float(way.start[row]), float(way.end[row]), int(way.goes_on[row])
    if not sign or duration <= 0.0:
        return []
    laps = min(abs(int(way.laps[row])), MOST_PASSES)
    met: list[tuple[int, float, int]] = []  # in which lap, how far on in it, which
    for number, instant in enumerate(instants):
        if instant > duration:
            continue
        for place in _places(instant, loop, duration):
            first = int(_is_before(place, start, sign))
            count = laps + _is_before(place, end, sign) - first
            met += [(first + lap, place * sign, number) for lap in range(count)]
            if loop == ONCE and way.ended[row] and place == end:
                met.append((0, place * sign, number))
    return [number for *_, number in sorted(met)]


def _is_before(place: float, bound: float, sign: int) -> bool:
    return place < bound if sign > 0 else place > bound


def _places(instant: float, loop: int, duration: float) -> tuple[float, ...]:
    """Where in a period an instant is: of a ping-pong also on the way back, except at the ends."""
    if loop != PING_PONG or instant in (0.0, duration):
        return (instant,)
    return (instant, 2.0 * duration - instant)
