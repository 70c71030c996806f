"""State hashes that every processor must reach: `python -m tests.pinned_hashes` prints those of this one.

Scenes that use as much of the physics as they can in 300 steps. Their hashes are pinned in pinned_hashes.json for each level of
processors. Whoever changes the physics on purpose pins them anew with `make pin`, which steps every level that the processor has.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from elys import PhysicsWorld
from elys.sim_node.kernel_cache import warm_kernels
from elys.sim_node.physics import BOX, SPHERE, STATIC

ROOT = Path(__file__).parents[1]
PINS = Path(__file__).with_suffix(".json")
LEVELS = ("v3", "v2")
STEPS = 300
DT = 1.0 / 60.0


def leaning_stack() -> PhysicsWorld:
    """Ten cubes upon one another, each set down carelessly."""
    world = world_on_the_ground()
    height = np.arange(10) + 0.5
    offset = 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, (10, 2))
    entities = np.arange(2, 12)
    world.add_bodies(entities, position=np.column_stack((offset[:, 0], height, offset[:, 1])))
    world.add_colliders(entities)
    return world


def mixed_heap() -> PhysicsWorld:
    """Turned boxes and balls of many sizes that fall onto a heap, bouncing."""
    world = world_on_the_ground()
    random = np.random.default_rng(2)
    count = 60
    entities = np.arange(2, 2 + count)
    rotation = random.uniform(-1.0, 1.0, (count, 4))
    rotation /= np.sqrt((rotation * rotation).sum(axis=1, keepdims=True))
    position = random.uniform(-2.0, 2.0, (count, 3))
    position[:, 1] = 1.0 + 0.5 * np.arange(count)
    world.add_bodies(entities, position=position, rotation=rotation, mass=random.uniform(0.1, 10.0, count))
    shape = np.where(np.arange(count) % 3 == 0, SPHERE, BOX)
    size = random.uniform(0.3, 1.2, (count, 3))
    world.add_colliders(entities, shape=shape, size=size, radius=size[:, 0] / 2.0, restitution=0.4, friction=0.6)
    return world


def tumbling_hammers() -> PhysicsWorld:
    """Bodies of two turned boxes each, which spin about every axis in free flight and strike the ground at an edge."""
    world = world_on_the_ground()
    random = np.random.default_rng(3)
    count = 12
    entities = np.arange(2, 2 + count)
    position = np.column_stack((3.0 * np.arange(count) - 16.0, random.uniform(4.0, 20.0, count), np.zeros(count)))
    spin = random.uniform(-9.0, 9.0, (count, 3))
    world.add_bodies(entities, position=position, angular_velocity=spin, linear_velocity=(0.3, 2.0, -0.2))
    world.add_colliders(entities, size=(0.2, 1.4, 0.2), position=(0.0, -0.5, 0.0))
    world.add_colliders(entities, size=(0.9, 0.3, 0.4), position=(0.0, 0.3, 0.1), rotation=(0.6, 0.0, 0.0, 0.8))
    return world


def struck_bridge() -> PhysicsWorld:
    """Planks on hinges from cliff to cliff, struck hard, and balls that hang below them and bump into each other."""
    world = PhysicsWorld()
    count, length = 12, 0.5
    planks = np.arange(1, count + 1)
    along = (np.arange(count) + 0.5) * length
    world.add_bodies(planks, position=np.column_stack((along, np.zeros(count), np.zeros(count))), mass=20.0)
    world.add_colliders(planks, size=(length, 0.1, 1.0))
    hinge = {"kind": "hinge", "axis_a": (0.0, 0.0, 1.0)}
    world.add_joints(planks, **hinge, entity_a=planks - 1, entity_b=planks, anchor_b=(-length / 2.0, 0.0, 0.0))
    world.add_joints([50], **hinge, entity_b=count, anchor_b=(length / 2.0, 0.0, 0.0))
    balls = np.arange(21, 21 + count)
    world.add_bodies(balls, position=np.column_stack((along, np.full(count, -1.0), np.zeros(count))), mass=5.0)
    world.add_colliders(balls, shape=SPHERE, radius=0.24, restitution=0.3)
    world.add_joints(balls, kind="ball", entity_a=planks, entity_b=balls, anchor_b=(0.0, 0.9, 0.0))
    world.apply_impulse([4], [0.0, -1500.0, 40.0])
    return world


def world_on_the_ground() -> PhysicsWorld:
    """A world with a wide floor, entity 1, whose top is at height 0."""
    world = PhysicsWorld()
    world.add_bodies([1], motion=STATIC, position=(0.0, -1.0, 0.0))
    world.add_colliders([1], size=(60.0, 2.0, 60.0))
    return world


SCENES = (leaning_stack, mixed_heap, tumbling_hammers, struck_bridge)


def hashes() -> dict[str, str]:
    """The state hash of every scene after its steps, on this processor and at this process's level."""
    found = {}
    for scene in SCENES:
        world = scene()
        for _ in range(STEPS):
            world.step(DT)
        assert np.isfinite(world.bodies.position).all()
        found[scene.__name__] = f"{world.state_hash():016x}"
    return found


def hashes_in_another_process(level: str, *launcher: str) -> dict[str, str]:
    """The same at a level, by a process of its own; `launcher` may be an emulator and its options."""
    environment = {
        **os.environ,
        "ELYS_CPU_LEVEL": level,
        "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)]),
    }
    command = [
        *launcher,
        str(Path(sys.executable).resolve()) if launcher else sys.executable,
        "-m",
        "tests.pinned_hashes",
    ]
    finished = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(finished.stdout)


def pinned(level: str) -> dict[str, str]:
    """The hashes that a level must reach."""
    return json.loads(PINS.read_text())[level]


def main(arguments: list[str]) -> None:
    if arguments == ["--pin"]:
        pins = {level: hashes_in_another_process(level) for level in LEVELS}
        PINS.write_text(json.dumps(pins, indent=2) + "\n")
        print(f"{PINS} holds the hashes of {', '.join(LEVELS)} as they are now")
    else:
        warm_kernels()
        print(json.dumps(hashes()))


if __name__ == "__main__":
    main(sys.argv[1:])
