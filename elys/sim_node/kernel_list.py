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


def first_kernels() -> tuple[Kernel, ...]:
    """The kernels of all packages that every world needs, as their `KERNELS` list them."""
    return tuple(Kernel(*entry) for module in _kernel_modules() for entry in module.KERNELS)


def all_kernels() -> tuple[Kernel, ...]:
    """Those and the ones that some worlds need, as `LATER_KERNELS` lists them."""
    later = (entry for module in _kernel_modules() for entry in getattr(module, "LATER_KERNELS", ()))
    return (*first_kernels(), *(Kernel(*entry) for entry in later))


def _kernel_modules() -> list[Any]:
    return [importlib.import_module(f"elys.sim_node.{package}.kernels") for package in kernel_packages()]


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
