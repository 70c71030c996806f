"""How long scripts take of a tick, and who takes most when that is too much."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from typing import Final

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

    def look(self, spent: float, running: Iterable[Running], *, dt: float, named: Callable[[Running], str]) -> None:
        """Names the script that takes most when all together take too much [s]."""
        is_over = spent > BUDGET * dt
        if not self.measures:
            self.measures = is_over and time.monotonic() - self._said > _SAID_EVERY
            self._ticks_left = self._wait
            return
        every = list(running)
        worst = max(every, key=lambda one: one.spent, default=None)
        if worst is not None and is_over:
            self._said = time.monotonic()
            _log.warning(
                "scripts took %.1f of a tick's %.1f ms, %s alone %.1f ms",
                1e3 * spent,
                1e3 * dt,
                named(worst),
                1e3 * worst.spent,
            )
        for one in every:
            one.spent = 0.0
        self._ticks_left -= 1
        self.measures = not is_over and self._ticks_left > 0
        if not self.measures:
            self._wait = FIRST_WAIT if is_over else min(2 * self._wait, LONGEST_WAIT)
