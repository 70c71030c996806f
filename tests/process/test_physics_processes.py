"""The same scene gives the same bits in another process, and the same motion with the compiler switched off."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PROGRAM = """
import numpy as np
from elys.sim_node.physics import PhysicsWorld

rng = np.random.default_rng(7)
world = PhysicsWorld()
count = 24
entities = np.arange(1, count + 2)
position = np.concatenate([[[0, -1, 0]], rng.uniform([-1.5, 0.5, -1.5], [1.5, 4, 1.5], (count, 3))])
world.add_bodies(entities, motion=[2] + [0] * count, position=position)
world.add_colliders(entities, shape=[0] + [k % 2 for k in range(count)], size=[[40, 2, 40]] + [[.8, .6, .7]] * count,
                    radius=.4, restitution=.3)
for _ in range({steps}):
    world.step(1 / 60)
hits = world.raycast([[0, 9, 0], [1, 9, 1]], [0, -1, 0])
print(world.state_hash(), hits.entity.tolist(), hits.distance.tolist())
print(world.bodies.position.tolist())
"""


def run_program(steps: int, **environment: str) -> str:
    root = Path(__file__).parents[2]
    finished = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM.format(steps=steps)],
        env={**os.environ, **environment, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=False,
        timeout=250,
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


@pytest.mark.process
def test_another_process_gives_the_same_bits():
    assert run_program(240) == run_program(240)


@pytest.mark.process
def test_the_interpreted_kernels_give_the_same_motion_as_the_compiled_ones():
    # Python rounds some of the solver's float32 where the compiler keeps more digits: not the bits, but the motion.
    places = [json.loads(run_program(12, **how).splitlines()[1]) for how in ({"NUMBA_DISABLE_JIT": "1"}, {})]
    np.testing.assert_allclose(places[0], places[1], atol=1e-5)
