"""How long scripts take of a tick, and who takes most when that is too much."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from typing import Final

from elys.sim_node.scripts.running import Running

BUDGET: Final = 0.5  # of a tick's length, for all scripts together
_SAID_EVERY: Final = 5.0  # [s]
_log = logging.getLogger(__name__)


class Budget:
    """Looks at what a tick has cost.

    Attributes:
        measures: whether each script's time is to be taken: in the tick after one that took too long.
    """

    def __init__(self) -> None:
        self.measures = False
        self._said = -_SAID_EVERY

    def look(self, spent: float, running: Iterable[Running], *, dt: float, named: Callable[[Running], str]) -> None:
        """Names the script that takes most when all together take too much [s]: the next tick measures each."""
        allowed = BUDGET * dt
        if self.measures:
            every = list(running)
            worst = max(every, key=lambda one: one.spent, default=None)
            if worst is not None and spent > allowed:
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
        self.measures = spent > allowed and time.monotonic() - self._said > _SAID_EVERY
