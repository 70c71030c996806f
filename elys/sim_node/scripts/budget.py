"""How long scripts take of a tick, and who takes most when that is too much."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from elys.sim_node.compilation import kernels_made
from elys.sim_node.scripts.running import Running

BUDGET: Final = 0.5  # of a tick's length, for all scripts together
# In how many ticks who took too long is waited for once more: each time that it was in vain, twice as many. To measure costs as
# much as a thousand scripts do otherwise, and scripts that all start in one tick take long only then.
FIRST_WAIT: Final = 30
LONGEST_WAIT: Final = 300
_SAID_EVERY: Final = 5.0  # [s]
_log = logging.getLogger(__name__)


class Budget:
    """Looks at what a tick has cost.

    Attributes:
        measures: whether each script's time is to be taken: after a tick that took too long, until another does. That may not be
            the next one: who is slow in every other tick would never be found.
    """

    def __init__(self) -> None:
        self.measures = False
        self._wait = FIRST_WAIT
        self._ticks_left = 0
        self._said = -_SAID_EVERY
        self._made = kernels_made()

    def look(self, spent: float, running: Iterable[Running], *, dt: float, named: Callable[[Running], str]) -> None:
        """Names the script that takes most when all together take too much [s]."""
        made = kernels_made()
        is_over = spent > BUDGET * dt and made == self._made  # what it took to load or compile kernels is nobody's
        self._made = made
        if not self.measures:
            self.measures = is_over and time.monotonic() - self._said > _SAID_EVERY
            self._ticks_left = self._wait
            return
        every = list(running)
        if every and is_over:
            self._said = time.monotonic()
            _log.warning("scripts took %.1f of a tick's %.1f ms, %s", 1e3 * spent, 1e3 * dt, _most(every, spent, named))
        for one in every:
            one.spent = 0.0
        self._ticks_left -= 1
        self.measures = not is_over and self._ticks_left > 0
        if not self.measures:
            self._wait = FIRST_WAIT if is_over else min(2 * self._wait, LONGEST_WAIT)


def _most(every: Sequence[Running], spent: float, named: Callable[[Running], str]) -> str:
    """Who took most: one script of an entity, or one that many entities carry; or that it was none of them."""
    groups: dict[str, list[Running]] = {}
    for one in every:
        groups.setdefault(one.source, []).append(one)
    group = max(groups.values(), key=_sum)
    worst = max(group, key=lambda one: one.spent)
    if _sum(every) < spent / 2:
        return "most of it for what they asked for: entities that come and go, or the events that they tell"
    if worst.spent >= _sum(group) / 2:
        return f"{named(worst)} alone {1e3 * worst.spent:.1f} ms"
    return f"{named(worst)} and {len(group) - 1} more with the same script {1e3 * _sum(group):.1f} ms"


def _sum(group: Iterable[Running]) -> float:
    return sum(one.spent for one in group)
