"""How a recording is to be played, from one command line to the next."""

from __future__ import annotations

from typing import NamedTuple


class Playback(NamedTuple):
    """How a recording is played: `start` and `end` [s] of simulation time, None for the recording's own."""

    paused: bool = False
    rate: float = 1.0
    loop: bool = False
    start: float | None = None
    end: float | None = None

    def options(self) -> list[str]:
        """The same for a player's command line."""
        told = ["--rate", str(self.rate)] + ["--paused"] * self.paused + ["--loop"] * self.loop
        for name, seconds in (("--from", self.start), ("--to", self.end)):
            told += [name, str(seconds)] if seconds is not None else []
        return told
