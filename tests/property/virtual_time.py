"""An event loop whose clock goes on only when everybody waits, and then at once: hours pass in seconds, to the nanosecond."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Coroutine
from typing import Any, Final

_STEP: Final = 1e-9  # [s]


class _PatientSelector(selectors.DefaultSelector):  # type: ignore[misc,valid-type]
    """Does not wait where time would pass, but lets it have passed."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0  # [s]

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:  # nothing is planned: another thread has to say something
            return super().select(None)
        ready = super().select(0.0)
        self.now += (
            _STEP  # a round of the loop takes some time: who waits for less than can be told does not wait forever
        )
        if not ready:
            self.now += max(timeout, 0.0)
        return ready


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """The loop itself; `time` begins at 0."""

    def __init__(self) -> None:
        self._patience = _PatientSelector()
        super().__init__(self._patience)

    def time(self) -> float:
        return self._patience.now


def run_in_virtual_time(work: Coroutine[Any, Any, None]) -> None:
    """`asyncio.run` on such a loop."""
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        runner.run(work)
