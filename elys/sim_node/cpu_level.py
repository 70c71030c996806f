"""For which processors kernels are compiled: a fixed level of x86-64, never the one machine at hand.

Machine code for a level runs on every processor that has it, gives the same bits on all of them, and can be shipped. The levels
are those of the x86-64 psABI: v3 adds AVX2 and FMA (Haswell and Zen, 2013 to 2017), v2 SSE4.2 (2008). Nothing here imports numba.
"""

from __future__ import annotations

import functools
import os
import platform
from typing import Final

from elys.common.errors import ElysError

LEVEL_VARIABLE: Final = "ELYS_CPU_LEVEL"  # v2, v3, or native: this very processor, whose bits and files are its own

# By name of the variable: LLVM's name of the level, and what it adds to the one before it, newest first.
_LEVELS: Final = {
    "v3": ("x86-64-v3", ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")),
    "v2": ("x86-64-v2", ("cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3")),
}
SHIPPED_LEVELS: Final = tuple(_LEVELS)


@functools.cache
def cpu_level() -> str:
    """LLVM's name of what kernels are compiled for: `x86-64-v3`, `x86-64-v2`, `x86-64`, or `generic` on other architectures.

    Raises:
        ElysError: ELYS_CPU_LEVEL names no level, or one that this processor does not have.
    """
    import llvmlite.binding as llvm

    chosen = os.environ.get(LEVEL_VARIABLE, "")
    if chosen == "native":
        return str(llvm.get_host_cpu_name())
    if chosen and chosen not in _LEVELS:
        raise ElysError(f"{LEVEL_VARIABLE} is '{chosen}', which is no level: set it to v3, v2 or native, or unset it")
    is_x86 = platform.machine().lower() in ("x86_64", "amd64")
    features = llvm.get_host_cpu_features()
    had = [level for level in _LEVELS if is_x86 and _has(level, features)]
    if chosen and chosen not in had:
        raise ElysError(f"{LEVEL_VARIABLE} is '{chosen}', but this processor has no x86-64-{chosen}: unset it")
    if had:
        return _LEVELS[chosen or had[0]][0]
    return "x86-64" if is_x86 else "generic"


def is_native() -> bool:
    """Whether kernels are compiled for this very processor, by the user's wish."""
    return os.environ.get(LEVEL_VARIABLE) == "native"


def _has(level: str, features: dict[str, bool]) -> bool:
    """Whether a processor with these features (LLVM's names) has a level and those below it."""
    names = list(_LEVELS)
    needed = [name for below in names[names.index(level) :] for name in _LEVELS[below][1]]
    return all(features.get(name, False) for name in needed)
