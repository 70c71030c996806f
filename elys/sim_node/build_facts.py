"""What program this is, on what kind of machine: the same facts, the same scene and the same commands give the same bits."""

from __future__ import annotations

import functools
import hashlib
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Final

import elys
from elys.sim_node.cpu_level import cpu_level, is_native
from elys.sim_node.kernel_directory import kernel_packages, source_hash

_PACKAGE: Final = Path(__file__).parents[1]
_COUNTED: Final = ("common", "sim_node")  # what decides what a tick does
# What may differ without any other bit coming out.
HARMLESS: Final = frozenset({"threads", "epoch"})
_WORDS: Final = {
    "elys": "ELYS",
    "sources": "its sources",
    "kernels": "the sources of its kernels",
    "cpu_level": "the level of processors that kernels are compiled for",
    "processor": "the processor",
    "machine": "the machine's architecture",
    "system": "the operating system",
}


@functools.cache
def build_facts() -> Mapping[str, str]:
    """By name: versions, hashes of sources, the level of processors, the kind of machine. Reads sources once, about 10 ms."""
    kernels = "".join(source_hash(package) for package in kernel_packages())
    return {
        "elys": elys.__version__,
        "sources": _source_hash(),
        "kernels": kernels,
        "cpu_level": cpu_level(),
        # Code for a fixed level gives the same bits on every processor that has it; code for one processor does not.
        "processor": platform.processor() or platform.machine() if is_native() else "any of the level",
        "python": platform.python_version(),
        "numba": metadata.version("numba"),
        "llvmlite": metadata.version("llvmlite"),
        "numpy": metadata.version("numpy"),
        "machine": platform.machine(),
        "system": platform.system(),
    }


def differences(recorded: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """In words what is another than it was, of what may give other bits; of facts that are not told nothing is said."""
    return [
        f"{_WORDS.get(name, name)} ({recorded[name]} there, {here[name]} here)"
        for name in here
        if name not in HARMLESS and name in recorded and recorded[name] != here[name]
    ]


def _source_hash() -> str:
    digest = hashlib.blake2b(digest_size=8)
    for folder in _COUNTED:
        for path in sorted((_PACKAGE / folder).rglob("*.py")):
            digest.update(path.relative_to(_PACKAGE).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
