"""How a recording is to be played, from one command line to the next."""

from __future__ import annotations

from typing import NamedTuple

from elys.bus.messages.commands import SetRange
from elys.verbs.moments import parse_moment


class Playback(NamedTuple):
    """How a recording is played: `start` and `end` are simulation times as people write them, empty for the recording's own."""

    paused: bool = False
    rate: float = 1.0
    loop: bool = False
    start: str = ""
    end: str = ""
    ghosts: tuple[str, ...] = ()  # recordings of other runs that are shown beside it

    def options(self) -> list[str]:
        """The same for a player's command line."""
        told = ["--rate", str(self.rate)] + ["--paused"] * self.paused + ["--loop"] * self.loop
        for name, seconds in (("--from", self.start), ("--to", self.end)):
            told += [name, seconds] if seconds else []
        for ghost in self.ghosts:
            told += ["--ghost", ghost]
        return told

    def part(self) -> SetRange:
        """What is played. Raises ElysError for times that are none."""
        start, end = (parse_moment(text) if text else None for text in (self.start, self.end))
        return SetRange(start=start, end=end)
