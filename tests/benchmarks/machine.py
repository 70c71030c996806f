"""What was measured on."""

from __future__ import annotations

import platform
from importlib import metadata
from pathlib import Path


def machine() -> str:
    """What was measured on, with the versions that matter."""
    cpu = platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            cpu = line.split(":", 1)[1].strip()
            break
    cores = len([line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("processor")])
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numba", "numpy", "eclipse-zenoh"))
    return f"{cpu}, {cores} cores, software OpenGL; Python {platform.python_version()}, {versions}."
