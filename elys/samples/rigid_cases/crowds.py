"""Scenes of many bodies, for the measurement of speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from elys.samples.rigid_cases.scene import BOX, CAPSULE, SPHERE, STATIC, Bodies, RigidScene, bodies, ground, joined
from elys.samples.rigid_cases.standing import pyramid

Array = np.ndarray[Any, Any]

_LAYERS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """A scene to be timed, while it falls and once it has settled."""

    name: str
    title: str
    build: Callable[[], RigidScene]
    settle_steps: int  # after so many the settled window begins
    sleeping: bool = False  # whether bodies may sleep
    falls: bool = True  # whether the first steps are worth a row of their own
    threads: int = 1


def _grid(count: int, spacing: float, *, seed: int, jitter: float) -> tuple[Array, float]:
    """Positions (N, 3) in layers over y = 0, and half the width of the bin around them [m]."""
    columns = math.ceil(math.sqrt(count / _LAYERS))
    number = np.arange(count)
    layer, place = np.divmod(number, columns * columns)
    row, column = np.divmod(place, columns)
    position = np.stack([column - 0.5 * (columns - 1), layer + 0.6, row - 0.5 * (columns - 1)], axis=1) * spacing
    position[:, [0, 2]] += np.random.default_rng(seed).uniform(-jitter, jitter, (count, 2))
    return position, 0.5 * columns * spacing + 0.2


def _bin(half: float) -> Bodies:
    """A floor and four walls, 2 m thick and 14 m high, about a square of half width `half`."""
    middle, height = half + 1.0, 14.0
    wide = 2.0 * half + 4.0
    position = [[0, 7, middle], [0, 7, -middle], [middle, 7, 0], [-middle, 7, 0]]
    size = [[wide, height, 2.0]] * 2 + [[2.0, height, wide]] * 2
    return joined(ground(width=wide + 20.0), bodies(position, motion=STATIC, size=size))


def pile(count: int) -> RigidScene:
    """Upright cubes of 1 m in eight layers, shifted against each other, that drop into a bin."""
    position, half = _grid(count, 1.25, seed=count, jitter=0.12)
    return RigidScene(joined(_bin(half), bodies(position)))


def heap(count: int) -> RigidScene:
    """Cubes of 1 m, turned anyhow, that drop into a bin."""
    position, half = _grid(count, 1.75, seed=count, jitter=0.0)
    return RigidScene(joined(_bin(half), bodies(position, rotation=_random_turns(count, seed=count))))


def mixed(count: int) -> RigidScene:
    """Boxes, spheres and capsules, turned anyhow, that drop into a bin."""
    position, half = _grid(count, 1.75, seed=count, jitter=0.0)
    shape = np.arange(count) % 3
    assert {BOX, SPHERE, CAPSULE} == {0, 1, 2}
    falling = bodies(
        position,
        shape=shape,
        radius=np.where(shape == CAPSULE, 0.3, 0.5),
        half_length=np.where(shape == CAPSULE, 0.4, 0.0),
        rotation=_random_turns(count, seed=count),
    )
    return RigidScene(joined(_bin(half), falling))


def _random_turns(count: int, *, seed: int) -> Array:
    turn = np.random.default_rng(seed).normal(size=(count, 4))
    return np.asarray(turn / np.linalg.norm(turn, axis=1, keepdims=True))


def sleeping_towers(count: int) -> RigidScene:
    """Towers of five cubes, and last one sphere that slides past them without friction and without end."""
    tower_count = count // 5
    columns = math.ceil(math.sqrt(tower_count))
    row, column = np.divmod(np.arange(tower_count), columns)
    position = np.zeros((tower_count, 5, 3))
    position[:, :, 0] = 2.0 * column[:, None]
    position[:, :, 1] = np.arange(5) + 0.5
    position[:, :, 2] = 2.0 * row[:, None]
    mover = bodies((-20.0, 0.5, -20.0), shape=SPHERE, linear_velocity=(1.0, 0.0, 0.0), friction=0.0)
    return RigidScene(joined(ground(width=600.0), bodies(position.reshape(-1, 3)), mover))


def rays_into(scene: RigidScene, count: int) -> tuple[Array, Array]:
    """Origins (R, 3) on a sheet above a bin, and directions (R, 3) that point down into it, at all slants."""
    rng = np.random.default_rng(count)
    inside = scene.bodies.position[scene.bodies.motion != STATIC]
    low, high = inside.min(0), inside.max(0)
    origins, targets = rng.uniform(low, high, (count, 3)), rng.uniform(low, high, (count, 3))
    origins[:, 1], targets[:, 1] = 14.0, 0.5
    return origins, targets - origins


CROWDS: Final[Mapping[str, Crowd]] = {
    crowd.name: crowd
    for crowd in (
        Crowd(name="pile-1000", title="pile of 1000", build=partial(pile, 1000), settle_steps=400),
        Crowd(name="pile-5000", title="pile of 5000", build=partial(pile, 5000), settle_steps=400),
        Crowd(name="pile-10000", title="pile of 10000", build=partial(pile, 10000), settle_steps=400),
        Crowd(
            name="pile-5000-2",
            title="pile of 5000, two threads",
            build=partial(pile, 5000),
            settle_steps=400,
            threads=2,
        ),
        Crowd(name="heap-1000", title="heap of 1000 turned cubes", build=partial(heap, 1000), settle_steps=600),
        Crowd(
            name="pyramid-40",
            title="pyramid of base 40",
            build=partial(pyramid, 40),
            settle_steps=300,
            falls=False,
        ),
        Crowd(
            name="mixed-1000",
            title="1000 boxes, spheres, capsules",
            build=partial(mixed, 1000),
            settle_steps=600,
        ),
        Crowd(
            name="asleep-5000",
            title="5000 asleep, one mover",
            build=partial(sleeping_towers, 5000),
            settle_steps=300,
            sleeping=True,
            falls=False,
        ),
        Crowd(
            name="asleep-1000",
            title="1000 asleep, one mover",
            build=partial(sleeping_towers, 1000),
            settle_steps=300,
            sleeping=True,
            falls=False,
        ),
    )
}
