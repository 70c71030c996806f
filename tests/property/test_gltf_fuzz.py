"""Mutated models, opened and drawn in a child of limited memory: each is drawn, or refused in one sentence that names it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MEMORY = 4 << 30  # [B] of addresses, of which software GL takes a good part for itself
BATCH = 250


@pytest.mark.gl
@pytest.mark.timeout(1800)
def test_mutated_models_are_drawn_or_refused(tmp_path: Path, soak: bool) -> None:
    count = 2000 if soak else 120
    drawn = refused = 0
    for first in range(0, count, BATCH):
        command = [sys.executable, str(ROOT / "tests" / "property" / "programs" / "gltf_fuzz.py")]
        command += [str(first), str(min(BATCH, count - first)), str(MEMORY), str(tmp_path)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(command, check=False, capture_output=True, text=True, env=environment, timeout=900)
        assert done.returncode == 0, done.stderr[-3000:]  # a crash ends the child
        report = json.loads(done.stdout.splitlines()[-1])
        assert report["wrong"] == []
        drawn, refused = drawn + report["drawn"], refused + report["refused"]
    assert drawn + refused == count
    assert min(drawn, refused) > count // 20  # the mutations are neither harmless nor hopeless
