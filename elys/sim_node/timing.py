"""How long things take: the stages of a tick, and the process so far."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter


class StageTimes:
    """A stopwatch that is read at the end of each stage.

    Attributes:
        times: stage -> what it took [ms], in the order of the stages.
    """

    __slots__ = ("_last", "_start", "times")

    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self._start = self._last = perf_counter()

    def done(self, stage: str) -> None:
        """The stage that began when the last one was done ends now."""
        now = perf_counter()
        self.times[stage] = self.times.get(stage, 0.0) + (now - self._last) * 1000.0
        self._last = now

    def include(self, times: Mapping[str, float]) -> None:
        """Stages [ms] that were timed elsewhere since the last one was done; the next one begins now."""
        self.times.update(times)
        self._last = perf_counter()

    @property
    def total(self) -> float:
        """From the beginning to the end of the last stage [ms]."""
        return (self._last - self._start) * 1000.0


def process_age() -> float:
    """How long ago this process was started [s], its interpreter's own start included; to 10 ms."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return time.process_time()  # elsewhere than on Linux: what it worked is the nearest there is
    started = int(fields[19]) / os.sysconf("SC_CLK_TCK")  # field 22 of proc(5), in clock ticks since boot
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started
