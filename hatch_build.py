"""Builds a platform wheel that carries compiled kernels (`make wheel`). Without this hook the wheel is pure and compiles.

One wheel holds all levels of its architecture. It is bound to one Python and to one numba: for any other the folders' names do
not fit, and kernels are compiled as from a pure wheel.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# The oldest C library for which numba itself is built; the kernels call none.
MANYLINUX = "manylinux_2_28"
SHIP = "import sys; from elys.sim_node.kernel_cache import ship_kernels; ship_kernels(sys.argv[1])"


class ShippedKernels(BuildHookInterface[Any]):
    """Compiles the kernels for each level and puts them into the wheel, under elys/_kernels."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it packs; `version` is `editable` for an installation that stays a checkout."""
        if version == "editable":
            return
        folder = Path(self.root) / "build" / "shipped-kernels"
        shutil.rmtree(folder, ignore_errors=True)
        self._compile_into(folder)
        build_data["force_include"][str(folder)] = "elys/_kernels"
        build_data["dependencies"].append(f"numba=={metadata.version('numba')}")
        build_data["pure_python"] = False
        if platform.libc_ver()[0] == "glibc":
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            build_data["tag"] = f"{python}-{python}-{MANYLINUX}_{platform.machine()}"
        else:
            build_data["infer_tag"] = True

    def _compile_into(self, folder: Path) -> None:
        levels = ("v3", "v2") if platform.machine() == "x86_64" else ("",)
        # Nothing of the builder's own taste may reach the machine code.
        clean = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
        path = os.pathsep.join([self.root, *filter(None, sys.path)])
        command = [sys.executable, "-c", SHIP, str(folder)]
        self.app.display_info(f"Compiling kernels for {platform.machine()} {' and '.join(levels)} (a minute) ...")
        builds = [
            subprocess.Popen(command, cwd=self.root, env={**clean, "PYTHONPATH": path, "ELYS_CPU_LEVEL": level})
            for level in levels
        ]
        failed = [level for level, build in zip(levels, builds, strict=True) if build.wait() != 0]
        if failed:
            self.app.abort(f"The kernels for {' and '.join(failed)} could not be compiled: the lines above say why.")
