"""Independent runs, side by side: in processes of this machine, or on a cluster of machines.

A function and its argument travel to whoever runs it, so both have to be importable and plain data. A run that raises, raises
here; a run whose process or machine was lost is run again.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Final, TypeVar

from elys.common.errors import ElysError

RETRIES: Final = 3  # of a run whose process or machine was lost

J = TypeVar("J")
R = TypeVar("R")


class ClusterError(ElysError):
    """The cluster cannot be reached or used."""


@contextlib.contextmanager
def workers(*, processes: int = 0, cluster: str = "") -> Iterator[Executor]:
    """Who runs jobs: processes of this machine, as many as there are processors unless said otherwise, or a cluster.

    Args:
        cluster: endpoint of a Dask scheduler, tcp://HOST:PORT.

    Raises:
        ClusterError: it does not answer, or Dask is not installed.
    """
    if cluster:
        with _cluster(cluster) as executor:
            yield executor
        return
    count = processes or usable_processors()
    # Spawned, not forked: numba's and zenoh's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(count, mp_context=context)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def completed(
    function: Callable[[J], R], jobs: Sequence[J], *, processes: int = 0, cluster: str = ""
) -> Iterator[tuple[int, R]]:
    """Runs `function` for each job and gives its place and its result, in the order in which they end.

    Raises:
        ClusterError: the cluster cannot be used, or processes were lost again and again.
    """
    waiting = dict(enumerate(jobs))
    for _ in range(RETRIES + 1):
        with contextlib.suppress(BrokenProcessPool), workers(processes=processes, cluster=cluster) as executor:
            started: dict[Future[R], int] = {executor.submit(function, job): n for n, job in waiting.items()}
            for future in as_completed(started):
                result = future.result()
                del waiting[started[future]]
                yield started[future], result
        if not waiting:
            return
    raise ClusterError(
        f"processes that should have run {len(waiting)} of {len(jobs)} jobs were ended from outside {RETRIES + 1} times: "
        "is there enough memory? fewer at once need less (--jobs)"
    )


def usable_processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ImportError as error:
        raise ClusterError("a cluster needs Dask: pip install 'elys[cluster]'") from error
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler answers at {address}: start one with `dask scheduler`") from error
    with client, client.get_executor(pure=False, retries=RETRIES) as executor:
        yield executor
