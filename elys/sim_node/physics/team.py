"""Threads that take part in a step."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

import numpy as np
from numba import config

from elys.sim_node.physics.kernels.team import give_up, new_team

Array = np.ndarray[Any, Any]


class Team:
    """The calling thread and `threads` - 1 others, which wait without work between its calls.

    More threads than processors would wait for each other's turn in every colour of contacts: there are never more.
    """

    def __init__(self, threads: int) -> None:
        self.asked = threads
        usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.threads = 1 if config.DISABLE_JIT else min(threads, usable)
        self._table = new_team()
        self._others = ThreadPoolExecutor(max(self.threads - 1, 1), "elys-physics")  # starts none before it is called
        self._called: list[Future[None]] = []

    def run(self, work: Callable[[Array, int, int], None]) -> None:
        """Calls work(team, thread, threads) in every thread, which all meet at its end: so all is done when this returns.

        The others may still be on their way back: they are waited for when they are called again.
        """
        wait(self._called)
        self._called = [
            self._others.submit(work, self._table, thread, self.threads) for thread in range(1, self.threads)
        ]
        try:
            work(self._table, 0, self.threads)
        except BaseException:  # a signal, before or after the kernel ran
            give_up(self._table)
            self._table = new_team()
            raise
