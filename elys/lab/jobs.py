"""Independent runs, side by side: in processes of this machine, or on a cluster of machines.

A function and its argument travel to whoever runs it, so both have to be importable and plain data. A run that raises, raises
here; a run whose process or machine was lost is run again.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Final

from elys.common.errors import ElysError

RETRIES: Final = 3  # of a run whose machine was lost


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
