"""Where compiled kernels live: one folder for each state of their sources and level of processors, without importing numba.

Numba notices when the file of a cached function changes, but not when a function which that one calls does. So the folder
is named by a hash over ALL kernel sources of a package, Python and numba: a change anywhere in them is a new folder, and
nothing stale can ever be loaded. A kernel may therefore only use what is written in a file counted here: `kernels.py` or
`kernels/*.py` of its own package in the simulation's node, or of one that `BUILT_ON` names for it, and `compilation*.py`.

A wheel may ship such folders inside the package. They are only read; what they lack goes into the user's cache.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import tempfile
from importlib import metadata
from pathlib import Path

import platformdirs

from elys.sim_node.cpu_level import cpu_level

CACHE_VARIABLE = "ELYS_KERNEL_CACHE"  # moves the cache elsewhere: a test, a read-only home
BUILT_ON = {"character": ("physics",)}  # packages whose kernels call those of others
_NODE = Path(__file__).parent
SHIPPED_ROOT = _NODE.parent / "_kernels"  # in a wheel that carries compiled kernels


@functools.cache
def kernel_packages() -> tuple[str, ...]:
    """The packages of the simulation's node that have kernels, in alphabetical order."""
    return tuple(
        sorted({path.relative_to(_NODE).parts[0] for path in _NODE.glob("*/kernels*") if path.stem == "kernels"})
    )


def source_files(package: str) -> tuple[Path, ...]:
    """Every file that the kernels of a package may be built from, in a fixed order."""
    folders = [_NODE / name for name in (package, *BUILT_ON.get(package, ()))]
    own = [path for folder in folders for pattern in ("kernels.py", "kernels/*.py") for path in folder.glob(pattern)]
    return tuple(sorted([*own, *_NODE.glob("compilation*.py")]))


@functools.cache
def source_hash(package: str) -> str:
    """16 hexadecimal digits over a package's kernel sources, Python and numba; costs about a millisecond."""
    digest = hashlib.blake2b(digest_size=8)
    digest.update(f"{sys.implementation.cache_tag} numba {metadata.version('numba')}".encode())
    for path in source_files(package):
        digest.update(path.relative_to(_NODE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def cache_directory(package: str) -> Path:
    """The folder of a package's compiled kernels; it may not exist yet. Never inside the installed package."""
    return cache_root() / _state(package)


def shipped_directory(package: str) -> Path:
    """The folder of the compiled kernels that came with the package; most installations have none."""
    return SHIPPED_ROOT / _state(package)


def _state(package: str) -> str:
    return f"{package}-{source_hash(package)}-{cpu_level()}"


@functools.cache
def cache_root() -> Path:
    """The folder over all states of the sources: the user's cache, or the temporary folder where that cannot be written."""
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return Path(chosen)
    root = Path(platformdirs.user_cache_dir("elys", appauthor=False)) / "kernels"
    existing = next(folder for folder in (root, *root.parents) if folder.exists())
    if os.access(existing, os.W_OK):
        return root
    return Path(tempfile.gettempdir()) / f"elys-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
