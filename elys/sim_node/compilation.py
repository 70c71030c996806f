"""How kernels are compiled: `@kernel` for what Python calls, `@inner` and `@inlined` for what only kernels call.

A kernel is compiled once for a level of processors (see `compilation_target`) and loaded from a cache afterwards: the one that a
wheel ships, or the user's. Inner functions are not cached: their code is part of every kernel that uses them. They have to be
made by the decorators here; a function of numba's own `njit` belongs to another target, and no kernel can call it.
"""

from __future__ import annotations

import contextlib
import functools
import logging
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit, typeof
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, _CacheLocator

from elys.sim_node.compilation_target import TARGET
from elys.sim_node.kernel_directory import cache_directory, shipped_directory, source_hash

_log = logging.getLogger(__name__)
_made = 0

Function = TypeVar("Function", bound=Callable[..., Any])

# No fastmath: the same build must give the same bits. Division by zero gives infinity, as in C, and is not checked. And no
# reference counts (numba's runtime, "nrt"): kernels allocate nothing, their callers hold what they work on, and to count each
# array that one function hands to another took up to half of a step.
_OPTIONS = {"error_model": "numpy", "nogil": True, "_nrt": False, "_target": TARGET}


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


def inlined(function: Function) -> Function:
    """As `inner`, but becomes part of its caller even where the compiler would rather call it."""
    compiled: Any = njit(**_OPTIONS, forceinline=True)(function)
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


def kernels_made() -> int:
    """How often this process has loaded or compiled a kernel: who asked for it then took long, and will not again."""
    return _made


class _KernelLocator(_CacheLocator):
    """Puts a function's machine code into the folder of its package's present sources."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.package = function.__module__.split(".")[2]  # elys.sim_node.<package>...
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _KernelLocator:
        return cls(py_func)

    def get_cache_path(self) -> str:
        return str(cache_directory(self.package))

    def get_source_stamp(self) -> str:
        return source_hash(self.package)

    def get_disambiguator(self) -> str:
        return str(self._line)


class _KernelCacheFiles(CompileResultCacheImpl):
    _locator_classes = [_KernelLocator]


class _KernelCache(FunctionCache):
    """Looks into the machine code that a wheel ships, then into the user's; writes the user's alone."""

    _impl_class = _KernelCacheFiles

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._kernel = function.__name__
        locator = self._impl.locator
        self._shipped = IndexDataCacheFile(
            cache_path=str(shipped_directory(locator.package)),
            filename_base=self._impl.filename_base,
            source_stamp=locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function for a signature, None if it has to be compiled.

        Numba would first load all that it can type, a third of a second for which machine code has no use; a compilation does it
        by itself.
        """
        global _made
        _made += 1
        return self._load_overload(sig, target_context)

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        shipped = self._shipped.load(self._index_key(sig, target_context.codegen()))
        if shipped is not None:
            return self._impl.rebuild(target_context, shipped)
        kept = super()._load_overload(sig, target_context)
        if kept is None:
            _log.info("compiling %s (once)", self._kernel)
        return kept

    def _save_overload(self, sig: Any, data: Any) -> None:
        # Where nothing can be written the kernel works all the same, and is compiled again next time.
        with contextlib.suppress(OSError):
            super()._save_overload(sig, data)
