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
_DROP: Final = 2.2  # [m] from layer to layer: the topmost still falls while the lowest lie
_WALL_HEIGHT: Final = 30.0  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """A scene to be timed beside a peer, while it falls and once it has settled."""

    name: str
    title: str
    build: Callable[[], RigidScene]
    settle_steps: int  # after so many the settled window begins
    settled_bound: float = 0.5  # of the peer's time, at most
    falling_bound: float | None = 0.7  # the same of the first steps; None where nothing falls
    sleeping: bool = False  # whether bodies may sleep
    threads: int = 1


def _grid(count: int, spacing: float, *, seed: int, jitter: float) -> tuple[Array, float]:
    """Positions (N, 3) in layers over y = 0, and half the width of the bin around them [m]."""
    columns = math.ceil(math.sqrt(count / _LAYERS))
    layer, place = np.divmod(np.arange(count), columns * columns)
    row, column = np.divmod(place, columns)
    middle = 0.5 * (columns - 1)
    position = np.stack([(column - middle) * spacing, 1.0 + layer * _DROP, (row - middle) * spacing], axis=1)
    position[:, [0, 2]] += np.random.default_rng(seed).uniform(-jitter, jitter, (count, 2))
    return position, 0.5 * columns * spacing + 0.2


def _bin(half: float) -> Bodies:
    """A floor and four walls, 2 m thick, about a square of half width `half`."""
    middle, wide = half + 1.0, 2.0 * half + 4.0
    up = 0.5 * _WALL_HEIGHT
    position = [[0, up, middle], [0, up, -middle], [middle, up, 0], [-middle, up, 0]]
    size = [[wide, _WALL_HEIGHT, 2.0]] * 2 + [[2.0, _WALL_HEIGHT, wide]] * 2
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
    shape = np.array([BOX, SPHERE, CAPSULE])[np.arange(count) % 3]
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


def _pile(count: int, *, threads: int = 1) -> Crowd:
    return Crowd(
        name=f"pile-{count}" + (f"-threads-{threads}" if threads > 1 else ""),
        title=f"pile of {count} cubes" + (f", {threads} threads" if threads > 1 else ""),
        build=partial(pile, count),
        settle_steps=400,
        threads=threads,
    )


def _asleep(count: int) -> Crowd:
    return Crowd(
        name=f"asleep-{count}",
        title=f"{count} cubes asleep in towers, one sphere moving",
        build=partial(sleeping_towers, count),
        settle_steps=300,
        settled_bound=1.0,
        falling_bound=None,
        sleeping=True,
    )


CROWDS: Final[Mapping[str, Crowd]] = {
    crowd.name: crowd
    for crowd in (
        _pile(1000),
        _pile(5000),
        _pile(10000),
        Crowd(
            name="heap-1000",
            title="heap of 1000 randomly turned cubes",
            build=partial(heap, 1000),
            settle_steps=600,
        ),
        Crowd(
            name="pyramid-40",
            title="pyramid of base 40, 820 cubes",
            build=partial(pyramid, 40),
            settle_steps=300,
            falling_bound=None,
        ),
        Crowd(
            name="mixed-1000",
            title="1000 boxes, spheres and capsules",
            build=partial(mixed, 1000),
            settle_steps=600,
        ),
        _pile(5000, threads=2),
        _asleep(1000),
        _asleep(5000),
    )
}
