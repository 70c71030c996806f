"""Programs of others, where this machine has them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

NodeJs = Callable[..., Any]


@pytest.fixture
def node_js() -> NodeJs:
    """Runs a script of this folder with Node.js, and returns what it says as JSON.

    Packages (three, gltf-validator, @mcap/core, fzstd) come from ELYS_NODE_MODULES, a node_modules folder; a test skips where a
    package that it names is not there.
    """
    program = shutil.which("node")
    modules = os.environ.get("ELYS_NODE_MODULES", "")

    def run(script: str, *words: str | Path, needs: tuple[str, ...]) -> Any:
        if program is None:
            pytest.skip("there is no Node.js (node) on this machine")
        for package in needs:
            if not modules or not (Path(modules) / package).is_dir():
                pytest.skip(
                    f"there is no npm package {package}: npm install it, and set ELYS_NODE_MODULES to node_modules"
                )
        done = subprocess.run(
            [program, str(Path(__file__).parent / script), *map(str, words)],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run
