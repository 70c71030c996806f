"""Compiling kernels in several processes, the work dealt out by what each kernel is expected to take.

Each worker keeps what it compiles in the cache, from where this process loads it in the end: so this one stays as small as on
any later start, and hears signals at once. Numba compiles under a lock, so threads would gain nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence

from elys.sim_node.kernel_list import Kernel, all_kernels, compiling_cost, make_callable

# More would wait for the longest kernel, and each process compiles anew what several kernels call.
MOST_PROCESSES = 4


class KernelShares:
    """Which process compiles what: equal shares by expected cost; who has finished takes from who has most left.

    A share begins with what is quick, so that a progress bar moves early. Several threads draw.
    """

    def __init__(self, kernels: Sequence[Kernel], processes: int) -> None:
        self._lock = threading.Lock()
        self._waiting: list[list[Kernel]] = [[] for _ in range(processes)]
        for kernel in sorted(kernels, key=compiling_cost, reverse=True):
            min(self._waiting, key=_total_cost).append(kernel)

    def drawn_by(self, process: int) -> Iterator[Kernel]:
        """One kernel after the other for a process, until none waits anywhere."""
        while (kernel := self._draw(process)) is not None:
            yield kernel

    def _draw(self, process: int) -> Kernel | None:
        with self._lock:
            if self._waiting[process]:
                return self._waiting[process].pop()
            fullest = max(self._waiting, key=_total_cost)
            return fullest.pop(0) if fullest else None


def _total_cost(kernels: Sequence[Kernel]) -> int:
    return sum(compiling_cost(kernel) for kernel in kernels)


def process_count() -> int:
    """How many processes compile: one for each processor this process may use, within reason."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(usable, MOST_PROCESSES)


def compile_in_processes(kernels: Sequence[Kernel], ready: Callable[[str], None], *, processes: int) -> None:
    """Has kernels compiled by other processes, and makes all of them callable in this one.

    `ready` hears of each kernel once, from several threads. A worker that dies costs time alone: what it left is compiled here,
    and what cannot be compiled raises its error here.
    """
    shares = KernelShares(kernels, processes)
    heard: set[str] = set()

    def done(name: str) -> None:
        heard.add(name)
        ready(name)

    with contextlib.ExitStack() as stack:
        workers = [stack.enter_context(_started_worker()) for _ in range(processes)]
        listeners: list[threading.Thread] = []
        try:
            for process, worker in enumerate(workers):
                listeners.append(
                    threading.Thread(target=_feed, args=(worker, shares.drawn_by(process), done), daemon=True)
                )
                listeners[-1].start()
            for listener in listeners:
                listener.join()
        except BaseException:  # a signal
            for worker in workers:
                worker.kill()
            for listener in listeners:
                if listener.ident is not None:  # started
                    listener.join()
            raise
    for kernel in kernels:
        make_callable(kernel)
        if kernel.name not in heard:
            ready(kernel.name)


def _started_worker() -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "elys.sim_node.kernel_workers"]
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    return subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, stderr=nothing, text=True, bufsize=1)


def _feed(worker: subprocess.Popen[str], kernels: Iterator[Kernel], done: Callable[[str], None]) -> None:
    """Gives a worker one kernel after the other until none waits, or the worker is no more."""
    assert worker.stdin is not None and worker.stdout is not None
    with contextlib.suppress(BrokenPipeError), worker.stdin:
        for kernel in kernels:
            print(kernel.name, file=worker.stdin)
            if worker.stdout.readline().strip() != kernel.name:
                return
            done(kernel.name)


def _work() -> None:
    if sys.platform == "linux":
        # PR_SET_PDEATHSIG, prctl(2): nobody waits for this process once the first one was killed.
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    # The compiler makes much and drops little: to look for what can be freed would take a seventh of the time. For the same
    # reason this process ends without tidying up.
    gc.disable()
    by_name = {kernel.name: kernel for kernel in all_kernels()}
    for line in sys.stdin:
        make_callable(by_name[line.strip()])
        print(line.strip(), flush=True)
    os._exit(0)


if __name__ == "__main__":
    _work()
