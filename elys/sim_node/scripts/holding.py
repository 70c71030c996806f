"""Time that stands for all but one: a script holds it, for a menu or a question, and lets it go on.

Steps go on as ever, with commands, edits and input, and a recording holds each; but in a held one nothing moves, no other script
is called, and what they count does not rise. So whoever runs them again comes out the same, and nobody gains by waiting.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

from elys.bus.messages.session import Event
from elys.sim_node.tick_time import TickTime

CALLED: Final = frozenset(("fixed_update", "update"))  # hooks of the one who holds it: nothing else of it runs either
MOST_MISSED: Final = 10_000  # events told in one hold, for those who hear of them afterwards


@dataclass(slots=True)
class Hold:
    """Who holds time, and how much of it was held.

    Attributes:
        by: the entity whose script asked for it; 0: none. It begins with the step after.
        ticks: steps so far in which time stood. held: the time of those, over changes of the tick rate.
        missed: what was told in them: all hear it when time goes on.
        stands: whether this step, or the last one between two, is such a step.
    """

    by: int = 0
    ticks: int = 0
    missed: list[Event] = field(default_factory=list)
    stands: bool = False
    held: TickTime = field(default_factory=TickTime)

    def take_missed(self) -> list[Event]:
        """What nobody has heard yet."""
        missed, self.missed = self.missed, []
        return missed

    def end(self) -> None:
        """All is another scene's: nobody holds time, and nobody missed anything."""
        self.by, self.stands = 0, False
        self.missed.clear()

    def saved(self) -> tuple[Any, ...]:
        """For a state."""
        return self.by, self.ticks, tuple(self.missed), self.held.tick, self.held.time

    @classmethod
    def of(cls, saved: tuple[Any, ...] | None) -> Hold:
        """What `saved` gave; a state of before there were holds, or of before their length was kept, has none."""
        by, ticks, missed, since, seconds = (*(saved or (0, 0, ())), 0, 0.0)[:5]
        return cls(by, ticks, list(missed), held=TickTime(since, seconds))
