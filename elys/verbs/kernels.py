"""Compiling the kernels where a person can see it: a progress bar, once."""

from __future__ import annotations

from elys.sim_node.kernel_cache import kernels_are_warm, warm_kernels


def compile_with_progress() -> None:
    """Loads the kernels, or compiles them with a bar that names what is being compiled."""
    if kernels_are_warm():
        warm_kernels()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        TextColumn("Compiling kernels (once)"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
    )
    with bar:
        task = bar.add_task("", total=None)

        def show(name: str, index: int, total: int) -> None:
            bar.update(task, completed=index, total=total, description=name)

        warm_kernels(show)
        bar.update(task, description="done")
