"""Compiling the kernels where a person can see it: a progress bar, once."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from elys.common.scene import OpenedScene
from elys.sim_node.kernel_cache import kernels_are_warm, warm_kernels
from elys.sim_node.kernel_needs import needed_kernels

if TYPE_CHECKING:
    from rich.console import Console


def compile_with_progress(scene: OpenedScene, *, threads: int = 1) -> None:
    """Loads the kernels that a scene needs, or compiles them with a bar that names what is being compiled."""
    load_with_progress(needed_kernels(scene, threads=threads))


def load_with_progress(needs: tuple[str, ...]) -> None:
    """Loads or compiles the kernels of every world and those named, the latter with a bar."""
    if kernels_are_warm(needs):
        warm_kernels(needs=needs)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("Compiling kernels (once)"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=console,
    )
    with _ended_by_interrupt(console), bar:
        task = bar.add_task("", total=None)

        def show(name: str, index: int, total: int) -> None:
            bar.update(task, completed=index, total=total, description=name)

        warm_kernels(show, needs=needs)
        bar.update(task, description="done")


@contextlib.contextmanager
def _ended_by_interrupt(console: Console) -> Iterator[None]:
    """Within it Ctrl-C ends the process at once.

    An exception could be raised where nothing hears it, in a finalizer that runs just then, and the command would go on. There is
    nothing to finish: the compiling processes die with this one, and what they had ready stays in the cache.
    """

    def end(number: int, frame: Any) -> None:
        console.show_cursor(True)
        os._exit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
