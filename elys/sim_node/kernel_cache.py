"""Compiling kernels ahead, once for a machine, with exact progress; loading them afterwards takes a fraction of a second.

Nothing needs to be set before the process starts: each kernel looks for its machine code in the folder that
`kernel_directory` names, whoever imports it first. A caller that wants a progress bar asks `kernels_are_warm()`, which
imports no compiler, and then calls `warm_kernels` with a function that shows the progress. Both are told what a scene needs
beside the kernels of every world (`kernel_needs`).
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from elys.common.errors import ElysError
from elys.sim_node.cpu_level import cpu_level
from elys.sim_node.kernel_directory import SHIPPED_ROOT, cache_directory, cache_root, kernel_packages, shipped_directory
from elys.sim_node.kernel_list import Kernel, all_kernels, first_kernels, make_callable
from elys.sim_node.kernel_workers import compile_in_processes, process_count

Progress = Callable[[str, int, int], None]  # name of the kernel that is ready, how many are, how many there are

KEPT_STATES = 6  # folders of earlier sources and of other levels that are kept for each package
_STAMP = "complete"  # a file that says so of its folder: the kernels of every world are there


class KernelCacheReport(NamedTuple):
    """What the cache holds for the present sources."""

    level: str  # of processors, see `cpu_level`
    path: Path  # the folder over all states
    present: int
    total: int
    missing: tuple[str, ...]  # names of kernels
    size: int  # [bytes]


def kernels_are_warm(needs: Sequence[str] = ()) -> bool:
    """Whether machine code of the kernels of every world and of those named is there, shipped or compiled earlier.

    Costs a few milliseconds.
    """
    return all(_has_stamp(package, _STAMP) for package in kernel_packages()) and all(map(_is_ready, needs))


def warm_kernels(
    progress: Progress | None = None,
    *,
    needs: Sequence[str] = (),
    processes: int | None = None,
    every: bool = False,
) -> None:
    """Compiles the kernels of every world and those named, or loads them from a cache; with `every` all there are.

    On a first start several processes share the work, one for each processor unless said otherwise. `progress` is told of each
    kernel as it becomes ready.

    Raises:
        ElysError: the cache's folder cannot be written, or ELYS_CPU_LEVEL names no level that this processor has.
    """
    first = first_kernels()
    later = [kernel for kernel in all_kernels()[len(first) :] if every or kernel.name in needs]
    missing = [*(() if kernels_are_warm() else first), *(kernel for kernel in later if not _is_ready(kernel.name))]
    if missing:
        _make_folders()
        compile_in_processes(missing, _counted(progress, len(missing)), processes=processes or process_count())
        _stamp(later)
    for kernel in (*first, *later):
        make_callable(kernel)


def _counted(progress: Progress | None, total: int) -> Callable[[str], None]:
    """Tells of each kernel and how many there are now; several threads call it."""
    done = 0
    lock = threading.Lock()

    def ready(name: str) -> None:
        nonlocal done
        with lock:
            done += 1
            if progress is not None:
                progress(name, done, total)

    return ready


def _stamp(later: Sequence[Kernel]) -> None:
    for package in kernel_packages():
        (cache_directory(package) / _STAMP).touch()
    for kernel in later:
        (cache_directory(_package_of(kernel.name)) / _stamp_of(kernel.name)).touch()
    _forget_old_states()


def ship_kernels(folder: str) -> None:
    """Puts the compiled kernels of this level into a folder that a wheel carries as `elys/_kernels`.

    Meant for a build that runs one process for each level; so this one compiles alone.
    """
    warm_kernels(processes=1, every=True)
    for package in kernel_packages():
        source = cache_directory(package)
        shutil.copytree(source, Path(folder) / source.name, ignore=shutil.ignore_patterns("*.tmp.*"))


def kernel_cache_report() -> KernelCacheReport:
    """What `elys doctor` shows: where the kernels are, which of them are there and how large they are."""
    places = [(shipped_directory(package), cache_directory(package)) for package in kernel_packages()]
    files = [file for pair in places for folder in pair if folder.exists() for file in folder.iterdir()]
    kernels = first_kernels()
    missing = tuple(kernel.name for kernel in kernels if not any(_holds(file, kernel) for file in files))
    size = sum(file.stat().st_size for file in files)
    is_shipped = all((shipped / _STAMP).exists() for shipped, _ in places)
    path = SHIPPED_ROOT if is_shipped else cache_root()
    return KernelCacheReport(cpu_level(), path, len(kernels) - len(missing), len(kernels), missing, size)


def kernel_sizes() -> dict[str, int]:
    """Bytes of machine code of each kernel that is in the cache or came with the package, by its name."""
    places = [folder(package) for package in kernel_packages() for folder in (shipped_directory, cache_directory)]
    files = [file for folder in places if folder.exists() for file in folder.glob("*.nbc")]
    held = {kernel.name: [file for file in files if _holds(file, kernel)] for kernel in all_kernels()}
    return {name: max(file.stat().st_size for file in its) for name, its in held.items() if its}


def _holds(file: Path, kernel: Kernel) -> bool:
    """Whether a file of the cache is the kernel's machine code; numba names it by module, function and line."""
    function = getattr(kernel.function, "py_func", kernel.function)
    module = function.__module__.rpartition(".")[2]
    return file.suffix == ".nbc" and file.name.startswith(f"{module}.{function.__qualname__}-")


def _make_folders() -> None:
    for package in kernel_packages():
        folder = cache_directory(package)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ElysError(
                f"Compiled kernels cannot be kept in {folder} ({error.strerror}): make it writable, or set ELYS_KERNEL_CACHE "
                f"to a folder that is"
            ) from error


def _is_ready(name: str) -> bool:
    """Whether a kernel that only some worlds need is there."""
    return _has_stamp(_package_of(name), _stamp_of(name))


def _package_of(kernel: str) -> str:
    return kernel.partition(".")[0]


def _stamp_of(kernel: str) -> str:
    return f"{kernel}.ready"


def _has_stamp(package: str, stamp: str) -> bool:
    return (shipped_directory(package) / stamp).exists() or (cache_directory(package) / stamp).exists()


def _forget_old_states() -> None:
    """Deletes the machine code of sources that were changed long ago."""
    for package in kernel_packages():
        states = [folder for folder in cache_root().glob(f"{package}-*") if folder.is_dir()]
        states.sort(key=lambda folder: folder.stat().st_mtime, reverse=True)
        for folder in states[KEPT_STATES:]:
            shutil.rmtree(folder, ignore_errors=True)
