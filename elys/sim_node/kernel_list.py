"""Every kernel of the simulation with its signatures, and how long each will take to compile, roughly."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any, NamedTuple

from elys.sim_node.kernel_directory import kernel_packages


class Kernel(NamedTuple):
    """A kernel and the signatures it is compiled for."""

    name: str
    function: Any
    signatures: tuple[tuple[Any, ...], ...]


def all_kernels() -> tuple[Kernel, ...]:
    """The kernels of all packages, as their `KERNELS` list them."""
    modules = [importlib.import_module(f"elys.sim_node.{package}.kernels") for package in kernel_packages()]
    return tuple(Kernel(*entry) for module in modules for entry in module.KERNELS)


def make_callable(kernel: Kernel) -> None:
    """Compiles a kernel, or loads it where it is in a cache."""
    if not hasattr(kernel.function, "stats"):  # the compiler is switched off
        return
    for signature in kernel.signatures:
        kernel.function.compile(signature)


def compiling_cost(kernel: Kernel) -> int:
    """How much there is to compile: the bytes of Python's code in a kernel and in all that it calls.

    Most of a compilation is numba's work on Python statements, so this orders kernels well enough to deal them out.
    """
    return len(kernel.signatures) * sum(len(function.__code__.co_code) for function in _called_by(kernel.function))


def _called_by(function: Any) -> Iterator[Any]:
    """A compiled function's Python function and, once each, those that it calls."""
    seen: set[int] = set()
    waiting = [getattr(function, "py_func", function)]
    while waiting:
        python = waiting.pop()
        if id(python) in seen:
            continue
        seen.add(id(python))
        yield python
        known = python.__globals__
        called = [known.get(name) for name in python.__code__.co_names]
        called += [cell.cell_contents for cell in python.__closure__ or ()]
        waiting += [called.py_func for called in called if hasattr(called, "py_func")]
