"""What a person does to a curve, and what of it is seen; without widgets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from elys.common.components.curve import MAX_KEYS, Curve, CurveKey, value_at

GAP: Final = 1e-3  # [s] that keys keep between one another
DIGITS: Final = 4  # behind the point, of what is dragged
SHORTEST: Final = 1.0  # [s] that is seen
_SAMPLES: Final = 48


class CurveView(NamedTuple):
    """The part of time and values that is seen."""

    start: float  # [s]
    end: float
    low: float
    high: float


def view_of(curve: Curve) -> CurveView:
    """What shows all of a curve, with some room around it."""
    end = max(1.3 * curve[-1][0], SHORTEST) if curve else SHORTEST
    values = [0.0, *(key[1] for key in curve), *(value_at(curve, end * n / _SAMPLES) for n in range(_SAMPLES + 1))]
    low, high = min(values), max(values)
    room = 0.12 * (high - low) if high > low else 1.0
    return CurveView(0.0, end, low - room if low < 0.0 else low, high + room)


def samples(curve: Curve, view: CurveView, count: int) -> list[tuple[float, float]]:
    """Times and values along the curve, at `count` even steps and at the keys."""
    steps = (view.start + (view.end - view.start) * n / (count - 1) for n in range(count))
    times = sorted({*steps, *(key[0] for key in curve if view.start <= key[0] <= view.end)})
    return [(time, value_at(curve, time)) for time in times]


def moved(curve: Curve, place: int, time: float, value: float) -> Curve:
    """A key elsewhere, between its neighbours; it keeps its slopes."""
    least = curve[place - 1][0] + GAP if place else 0.0
    most = curve[place + 1][0] - GAP if place + 1 < len(curve) else float("inf")
    time = round(max(min(time, most), least), DIGITS)
    _, _, before, after = curve[place]
    return _with(curve, place, (time, round(value, DIGITS), before, after))


def added(curve: Curve, time: float, value: float) -> tuple[Curve, int]:
    """A new key, smooth, and its place; without one (-1) where there are too many, or one is there already."""
    time, value = round(max(time, 0.0), DIGITS), round(value, DIGITS)
    if len(curve) >= MAX_KEYS or any(abs(key[0] - time) < GAP for key in curve):
        return curve, -1
    place = sum(key[0] < time for key in curve)
    longer = (*curve[:place], (time, value, 0.0, 0.0), *curve[place:])
    return smoothed(longer, place), place


def removed(curve: Curve, place: int) -> Curve:
    """Without a key."""
    return (*curve[:place], *curve[place + 1 :])


def smoothed(curve: Curve, place: int) -> Curve:
    """A key through which the curve goes as the line between its neighbours does (Catmull and Rom); level at an end."""
    if not 0 < place < len(curve) - 1:
        return sloped(curve, place, 0.0, 0.0)
    slope = _slope(curve[place - 1], curve[place + 1])
    return sloped(curve, place, slope, slope)


def straightened(curve: Curve, place: int) -> Curve:
    """A key at which the curve comes from the one before and goes to the next one straight away, as far as it can."""
    before = _slope(curve[place - 1], curve[place]) if place else 0.0
    after = _slope(curve[place], curve[place + 1]) if place + 1 < len(curve) else 0.0
    return sloped(curve, place, before, after)


def sloped(curve: Curve, place: int, before: float, after: float) -> Curve:
    """A key with other slopes [1/s]."""
    time, value, _, _ = curve[place]
    return _with(curve, place, (time, value, round(before, DIGITS), round(after, DIGITS)))


def _slope(first: CurveKey, second: CurveKey) -> float:
    return (second[1] - first[1]) / (second[0] - first[0])


def _with(curve: Sequence[CurveKey], place: int, key: CurveKey) -> Curve:
    return (*curve[:place], key, *curve[place + 1 :])
