"""The world in one process: spawning, and transforms down a deep tree."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from elys.common.components import Collider, MeshRenderer, RigidBody, Transform
from elys.sim_node.ecs.world import SpawnBatch, World

Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    return [
        ("100,000 entities with four components spawned", f"{best(spawn, 3) * 1000:.0f} ms"),
        ("world transforms of 10,000 nodes, depth 20, all changed", f"{propagate():.3f} ms"),
    ]


def spawn() -> None:
    positions = np.random.default_rng(0).normal(size=(100_000, 3))
    columns = {Transform: {"position": positions}, RigidBody: {}, Collider: {}, MeshRenderer: {}}
    World().spawn_many(100_000, columns, names="Box")


def propagate() -> float:
    """Milliseconds for one propagation."""
    world, count, depth = World(), 10_000, 20
    rng = np.random.default_rng(0)
    per_level = count // depth
    parents = np.full(count, -1)
    for level in range(1, depth):
        first = level * per_level
        parents[first : first + per_level] = rng.integers(first - per_level, first, per_level)
    transform = {"position": rng.normal(size=(count, 3)), "rotation": (0, 0, 0, 1), "scale": (1, 1, 1)}
    batch = SpawnBatch(
        names=[""] * count,
        parents=parents,
        enabled=np.ones(count, np.bool_),
        components={"Transform": (None, transform)},
    )
    places = world.spawn_batch(batch).astype(np.intp)

    def once() -> None:
        world.transforms.mark_dirty(places)
        world.transforms.propagate()

    return best(once, 50) * 1000


def best(work: Callable[[], None], repeats: int) -> float:
    """Seconds of the fastest of so many."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)
