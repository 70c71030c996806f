"""Simulated time by ticks. They count steps, and go on counting where another tick rate begins: neither they nor time go back."""

from __future__ import annotations


class TickTime:
    """Where the tick rate that holds now began: at a tick, and at a time.

    Attributes:
        tick: at which it began. time: at which it began [s].
    """

    def __init__(self, tick: int = 0, time: float = 0.0) -> None:
        self.tick, self.time = tick, time

    def at(self, tick: int, tick_rate: float) -> float:
        """The time of a tick [s]: ticks over their rate, never a sum of steps."""
        return self.time + (tick - self.tick) / tick_rate

    def without(self, other: TickTime) -> TickTime:
        """The same of all ticks but those that another counts, which turned when this one did."""
        return TickTime(self.tick - other.tick, self.time - other.time)

    def turn(self, tick: int, tick_rate: float) -> None:
        """From a tick on another rate holds than `tick_rate` [Hz], which did until there."""
        self.tick, self.time = tick, self.at(tick, tick_rate)
