"""Compiling all kernels ahead, once for a machine, with exact progress; loading them afterwards takes a fraction of a second.

Nothing needs to be set before the process starts: each kernel looks for its machine code in the folder that
`kernel_directory` names, whoever imports it first. A caller that wants a progress bar asks `kernels_are_warm()`, which
imports no compiler, and then calls `warm_kernels` with a function that shows the progress.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import platform
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from elys.common.errors import ElysError
from elys.sim_node.kernel_directory import cache_directory, cache_root, kernel_packages

Progress = Callable[[str, int, int], None]  # name of the kernel that is ready, how many are, how many there are

KEPT_STATES = 4  # folders of earlier sources that are kept for each package
_STAMP = "complete"

# What takes longest to compile, dealt out so that two processes finish together; all others belong to the first.
_SECOND_PROCESS = ("physics.update_manifolds", "physics.prepare_contacts", "physics.cast_rays")


class KernelCacheReport(NamedTuple):
    """What the cache holds for the present sources."""

    path: Path  # the folder over all states
    present: int
    total: int
    missing: tuple[str, ...]  # names of kernels
    size: int  # [bytes]


class Kernel(NamedTuple):
    """A kernel and the signatures it is compiled for."""

    name: str
    function: Any
    signatures: tuple[tuple[Any, ...], ...]


def kernels_are_warm() -> bool:
    """Whether all kernels of these sources have been compiled on this kind of machine. Costs a few milliseconds."""
    return all(_stamp(package).exists() for package in kernel_packages())


def warm_kernels(progress: Progress | None = None) -> None:
    """Compiles every kernel of the simulation, or loads it from the cache.

    On a first start two processes share the work. `progress` is told of each kernel as it becomes ready.

    Raises:
        ElysError: the cache's folder cannot be written, or the second process failed.
    """
    kernels = _all_kernels()
    done = 0
    lock = threading.Lock()

    def ready(name: str) -> None:
        nonlocal done
        with lock:
            done += 1
            if progress is not None:
                progress(name, done, len(kernels))

    if kernels_are_warm():
        for kernel in kernels:
            _compile(kernel)
            ready(kernel.name)
        return
    _make_folders()
    _compile_in_two_processes(kernels, ready)
    for package in kernel_packages():
        _stamp(package).touch()
    _forget_old_states()


def kernel_cache_report() -> KernelCacheReport:
    """What `elys doctor` shows: where the cache is, which kernels are in it and how large it is."""
    folders = tuple(cache_directory(package) for package in kernel_packages())
    files = [file for folder in folders if folder.exists() for file in folder.iterdir()]
    kernels = _all_kernels()
    missing = tuple(kernel.name for kernel in kernels if not any(_holds(file, kernel) for file in files))
    size = sum(file.stat().st_size for file in files)
    return KernelCacheReport(cache_root(), len(kernels) - len(missing), len(kernels), missing, size)


def _holds(file: Path, kernel: Kernel) -> bool:
    """Whether a file of the cache is the kernel's machine code; numba names it by module, function and line."""
    function = getattr(kernel.function, "py_func", kernel.function)
    module = function.__module__.rpartition(".")[2]
    return file.suffix == ".nbc" and file.name.startswith(f"{module}.{function.__qualname__}-")


def _all_kernels() -> tuple[Kernel, ...]:
    modules = [importlib.import_module(f"elys.sim_node.{package}.kernels") for package in kernel_packages()]
    return tuple(Kernel(*entry) for module in modules for entry in module.KERNELS)


def _compile(kernel: Kernel) -> None:
    """Makes a kernel callable: compiled, or loaded where it is in the cache."""
    if not hasattr(kernel.function, "stats"):  # the compiler is switched off
        return
    for signature in kernel.signatures:
        kernel.function.compile(signature)


def _compile_in_two_processes(kernels: tuple[Kernel, ...], ready: Callable[[str], None]) -> None:
    """The first share here, the second in another process, which leaves it in the cache to be loaded."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "elys.sim_node.kernel_cache"]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
    ) as second:
        listener = threading.Thread(target=_listen, args=(second, ready), daemon=True)
        try:
            listener.start()
            for kernel in _share(kernels, second=False):
                _compile(kernel)
                ready(kernel.name)
            listener.join()
        except BaseException:
            second.kill()
            raise
        assert second.stderr is not None
        complaint = second.stderr.read().strip()
    if second.returncode != 0:
        last = complaint.splitlines()[-1] if complaint else f"exit status {second.returncode}"
        raise ElysError(f"The second process that compiles kernels failed: {last}")
    for kernel in _share(kernels, second=True):
        _compile(kernel)


def _listen(second: subprocess.Popen[str], ready: Callable[[str], None]) -> None:
    """Hears which kernels the second process has ready while the first one works."""
    assert second.stdout is not None
    with contextlib.suppress(ValueError):  # the pipe is closed while it is read: the compilation was interrupted
        for line in second.stdout:
            ready(line.strip())


def _share(kernels: tuple[Kernel, ...], *, second: bool) -> Iterator[Kernel]:
    return (kernel for kernel in kernels if (kernel.name in _SECOND_PROCESS) == second)


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


def _stamp(package: str) -> Path:
    """The file that says that a package's kernels are complete for this kind of processor."""
    return cache_directory(package) / f"{_STAMP}-{_processor()}"


def _processor() -> str:
    """What decides whether machine code fits: cheap, and different wherever numba would compile anew."""
    chosen = os.environ.get("NUMBA_CPU_NAME")
    if chosen:
        return chosen
    import llvmlite.binding as llvm

    return f"{platform.machine()}-{llvm.get_host_cpu_name()}"


def _forget_old_states() -> None:
    """Deletes the machine code of sources that were changed long ago."""
    for package in kernel_packages():
        states = [folder for folder in cache_root().glob(f"{package}-*") if folder.is_dir()]
        states.sort(key=lambda folder: folder.stat().st_mtime, reverse=True)
        for folder in states[KEPT_STATES:]:
            shutil.rmtree(folder, ignore_errors=True)


def _compile_second_share() -> None:
    if sys.platform == "linux":
        # PR_SET_PDEATHSIG, prctl(2): nobody waits for this process once the first one was killed.
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    for kernel in _share(_all_kernels(), second=True):
        _compile(kernel)
        print(kernel.name, flush=True)


if __name__ == "__main__":
    _compile_second_share()
