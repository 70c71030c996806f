"""Numbers over time, for plots: columns with one axis of time, in rooms that are as large from the beginning as they ever get."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

CAPACITY: Final = 36_000  # rows: ten minutes of 60 ticks a second
GAP: Final = 0.5  # [s] of simulated time without a row that are not bridged by a line
DRAWN_POINTS: Final = 2000  # of a curve; more are not to be told apart
AXES: Final = 3
_LATE_ROWS: Final = 256  # how far back the row of a tick is looked for

Array = NDArray[np.float64]


@dataclass(slots=True)
class Series:
    """One curve."""

    path: str  # what it is of
    unit: str
    axis: int  # 0 to AXES - 1
    is_shown: bool = True


class SeriesTable:
    """The newest rows: a tick, its time, a number for each series. Where there is none, NaN stands."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._end = 0
        self._start = 0
        # Twice the room, so that the newest rows always stand in one piece.
        self._ticks = np.full(2 * capacity, -1, np.int64)
        self._times = np.full(2 * capacity, np.nan)
        self._columns: list[Array] = []
        self.series: list[Series] = []

    def __len__(self) -> int:
        return self._end - self._start

    def add(self, path: str, unit: str) -> Series:
        """Another series, on the axis of its unit, a free one or else the last; one that is there already stays as it is."""
        for series in self.series:
            if series.path == path:
                return series
        series = Series(path, unit, self._axis_for(unit))
        self.series.append(series)
        self._columns.append(np.full(2 * self._capacity, np.nan))
        return series

    def remove(self, series: Series) -> None:
        """Forgets a series and its numbers; with the last one the times as well."""
        place = self.series.index(series)
        del self.series[place], self._columns[place]
        if not self.series:
            self.clear()

    def clear(self) -> None:
        """Forgets all rows."""
        self._start = self._end = 0
        for column in self._columns:
            column[:] = np.nan

    def append(self, tick: int, time: float, values: Sequence[float]) -> None:
        """Adds a row with a number for each series. The same tick again replaces its row; a leap in time leaves a gap."""
        if self._end > self._start:
            last = self._times[self._end - 1]
            if self._ticks[self._end - 1] == tick:
                self._write(self._end - 1, tick, time, values)
                return
            if time < last or time > last + GAP:
                self._push(tick, time, [np.nan] * len(values))
        self._push(tick, time, values)

    def set_late(self, tick: int, series: Series, value: float) -> bool:
        """Writes a number that came after its row; whether the row is there still."""
        first = max(self._start, self._end - _LATE_ROWS)
        found = np.flatnonzero(self._ticks[first : self._end] == tick)
        if not len(found):
            return False
        self._columns[self.series.index(series)][first + found[-1]] = value
        return True

    def set_from(self, tick: int, series: Series, value: float) -> None:
        """Writes what has been so since a tick into the rows of that tick and of those after it, as far as they came before."""
        first = max(self._start, self._end - _LATE_ROWS)
        column = self._columns[self.series.index(series)][first : self._end]
        column[self._ticks[first : self._end] >= tick] = value

    @property
    def ticks(self) -> NDArray[np.int64]:
        """(N,)"""
        return self._ticks[self._start : self._end]

    @property
    def times(self) -> Array:
        """(N,) [s]"""
        return self._times[self._start : self._end]

    def values(self, series: Series) -> Array:
        """(N,)"""
        return self._columns[self.series.index(series)][self._start : self._end]

    def write_csv(self, path: str | Path) -> None:
        """One row a tick, empty where there is no number; gaps are left out. OSError where it cannot be written."""
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            units = [f" [{series.unit}]" if series.unit else "" for series in self.series]
            writer.writerow(["tick", "time [s]", *(s.path + unit for s, unit in zip(self.series, units, strict=True))])
            columns = [self.values(series).tolist() for series in self.series]
            for tick, time, *values in zip(self.ticks.tolist(), self.times.tolist(), *columns, strict=True):
                if any(value == value for value in values):
                    writer.writerow([tick, repr(time), *(repr(v) if v == v else "" for v in values)])

    def _axis_for(self, unit: str) -> int:
        used = {series.axis: series.unit for series in reversed(self.series)}
        for axis, held in sorted(used.items()):
            if held == unit:
                return axis
        return next((axis for axis in range(AXES) if axis not in used), AXES - 1)

    def _push(self, tick: int, time: float, values: Sequence[float]) -> None:
        if self._end == 2 * self._capacity:
            kept = slice(self._end - self._capacity, self._end)
            for column in (self._ticks, self._times, *self._columns):
                column[: self._capacity] = column[kept]
            self._end = self._capacity
        self._write(self._end, tick, time, values)
        self._end += 1
        self._start = max(self._end - self._capacity, 0)

    def _write(self, place: int, tick: int, time: float, values: Sequence[float]) -> None:
        self._ticks[place], self._times[place] = tick, time
        for column, value in zip(self._columns, values, strict=True):
            column[place] = value


def thinned(times: Array, values: Array, limit: int = DRAWN_POINTS) -> tuple[Array, Array]:
    """At most about `limit` points that look the same: of each stretch its lowest, its highest and its first gap, in order."""
    count = len(times)
    if count <= limit:
        return times, values
    stretch = -(-3 * count // limit)
    padded = np.full(-(-count // stretch) * stretch, np.nan)
    padded[:count] = values
    rows = padded.reshape(-1, stretch)
    missing = np.isnan(rows)
    lowest = np.where(missing, np.inf, rows).argmin(axis=1)
    highest = np.where(missing, -np.inf, rows).argmax(axis=1)
    gap = np.where(missing.any(axis=1), missing.argmax(axis=1), lowest)
    chosen = np.sort(np.stack([lowest, highest, gap], axis=1), axis=1) + np.arange(len(rows))[:, None] * stretch
    places = np.unique(chosen.ravel())
    places = places[places < count]
    return times[places], values[places]
