"""How kernels are compiled: `@kernel` for what Python calls, `@inner` for what only kernels call.

A kernel is compiled once for a machine and loaded from the cache afterwards. Inner functions are not cached: their code is
part of every kernel that uses them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit, typeof
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

from elys.sim_node.kernel_directory import cache_directory, source_hash

Function = TypeVar("Function", bound=Callable[..., Any])

# No fastmath: the same build must give the same bits. Division by zero gives infinity, as in C, and is not checked.
_OPTIONS = {"error_model": "numpy", "nogil": True}


def kernel(function: Function) -> Function:
    """Compiles a function that Python calls, and keeps the machine code in the kernel cache."""
    dispatcher: Any = njit(**_OPTIONS)(function)
    if not hasattr(dispatcher, "enable_caching"):
        return _interpreted(function)
    dispatcher._cache = _KernelCache(function)
    return cast(Function, dispatcher)


def inner(function: Function) -> Function:
    """Compiles a function that only kernels call."""
    compiled: Any = njit(**_OPTIONS)(function)
    return cast(Function, compiled)


def _interpreted(function: Function) -> Function:
    """A kernel with the compiler switched off (NUMBA_DISABLE_JIT): Python reads `row.field` of record arrays only."""

    @functools.wraps(function)
    def run(*arguments: Any) -> Any:
        return function(*(_readable(argument) for argument in arguments))

    return cast(Function, run)


def _readable(argument: Any) -> Any:
    if isinstance(argument, np.ndarray) and argument.dtype.names is not None:
        return argument.view(np.recarray)
    if isinstance(argument, tuple) and hasattr(argument, "_fields"):
        return type(argument)(*(_readable(part) for part in argument))
    return argument


def signature_of(*examples: Any) -> tuple[Any, ...]:
    """The explicit signature with which a kernel accepts arguments like these."""
    return tuple(typeof(example) for example in examples)


class _KernelLocator(_CacheLocator):
    """Puts a function's machine code into the folder of its package's present sources."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._module = function.__module__
        self._package = self._module.split(".")[2]  # elys.sim_node.<package>...
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _KernelLocator:
        return cls(py_func)

    def get_cache_path(self) -> str:
        return str(cache_directory(self._package))

    def get_source_stamp(self) -> str:
        return source_hash(self._package)

    def get_disambiguator(self) -> str:
        return str(self._line)


class _KernelCacheFiles(CompileResultCacheImpl):
    _locator_classes = [_KernelLocator]


class _KernelCache(FunctionCache):
    _impl_class = _KernelCacheFiles
