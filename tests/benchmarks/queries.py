"""Questions a second into a settled pile of 1000 cubes, on one thread, beside Rapier where it is installed."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics import DYNAMIC, STATIC, PhysicsWorld
from tests.benchmarks.scene_tree import best

Row = tuple[str, str]
Array = np.ndarray[Any, Any]

CUBES = 1000
RAYS = 100_000
REPEATS = 7
RAPIER_RAYS = 10_000  # one call each
WALLS = (((0, -0.5, 0), (40, 1, 40)), ((8, 7, 0), (1, 14, 16)), ((-8, 7, 0), (1, 14, 16)))
WALLS += (((0, 7, 8), (16, 14, 1)), ((0, 7, -8), (16, 14, 1)))


def measure() -> list[Row]:
    """Rows of the table."""
    world = settled()
    rows = []
    for name, (origins, directions) in {"rays from above": from_above(), "rays from among them": from_inside()}.items():
        ours = RAYS / best(lambda o=origins, d=directions: world.raycast(o, d, 100.0), REPEATS)  # type: ignore[misc]
        rows.append((f"{name} into 1000 settled cubes", f"{ours / 1e6:.2f} million/s"))
        theirs = rapier_rays(world, origins, directions)
        if theirs:
            rows.append((f"{name}, Rapier, one call a ray", f"{theirs / 1e6:.2f} million/s"))
    origins, directions = (part[: RAYS // 10] for part in from_above())
    casts = {
        "balls": lambda: world.cast_sphere(origins, directions, 0.25, 100.0),
        "boxes": lambda: world.cast_box(origins, directions, (0.5, 0.5, 0.5), 100.0),
        "overlaps of balls": lambda: world.overlap_sphere(origins - (0, 15, 0), 0.75),
        "closest points": lambda: world.closest_point(origins - (0, 9, 0)),
    }
    for name, ask in casts.items():
        rows.append((f"{name} into 1000 settled cubes", f"{len(origins) / best(ask, REPEATS) / 1e6:.2f} million/s"))

    def moved() -> None:
        world.set_velocities([len(WALLS) + 1], linear=(0, 0, 0))  # the tree may not be what it was
        world.raycast((0, 20, 0), (0, -1, 0))

    rows.append(("one ray after a change among 1000 cubes", f"{best(moved, 50) * 1e6:.0f} µs"))
    return rows


def settled() -> PhysicsWorld:
    """A bin of cubes that fell for four seconds."""
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(*[np.arange(10)] * 3, indexing="ij"), -1).reshape(-1, 3)
    cubes = (grid - (4.5, 0, 4.5)) * 1.15 + (0, 0.6, 0) + rng.uniform(-0.05, 0.05, (CUBES, 3))
    places, sizes = (np.array(column, float) for column in zip(*WALLS, strict=True))
    world = PhysicsWorld()
    entities = np.arange(1, len(WALLS) + CUBES + 1)
    motion = np.where(entities <= len(WALLS), STATIC, DYNAMIC)
    world.add_bodies(entities, motion=motion, position=np.concatenate([places, cubes]))
    world.add_colliders(entities, size=np.concatenate([sizes, np.ones((CUBES, 3))]))
    for _ in range(240):
        world.step(1 / 60)
    return world


def from_above() -> tuple[Array, Array]:
    """Steep rays that all end in the pile."""
    rng = np.random.default_rng(1)
    origins = np.column_stack([rng.uniform(-7, 7, RAYS), np.full(RAYS, 20.0), rng.uniform(-7, 7, RAYS)])
    return origins, rng.uniform((-5, 0, -5), (5, 3, 5), (RAYS, 3)) - origins


def from_inside() -> tuple[Array, Array]:
    """Rays from anywhere in the bin to anywhere."""
    rng = np.random.default_rng(2)
    return rng.uniform((-7, 0.2, -7), (7, 14, 7), (RAYS, 3)), rng.normal(size=(RAYS, 3))


def rapier_rays(world: PhysicsWorld, origins: Array, directions: Array) -> float | None:
    """Rays a second of Rapier into the same cubes, through its one call for each; None where it is not installed."""
    try:
        import rapier3d
    except ImportError:
        return None
    peer = rapier3d.PhysicsWorld()
    peer.set_num_threads(1)
    _, _, position, rotation, *_ = world.bodies
    for row, (place, (x, y, z, w)) in enumerate(zip(position.tolist(), rotation.tolist(), strict=True)):
        size = WALLS[row][1] if row < len(WALLS) else (1, 1, 1)
        turn = rapier3d.Rotation3.from_quaternion(w, x, y, z)
        builder = rapier3d.RigidBodyBuilder(rapier3d.RigidBodyType.FIXED).position((place, turn))
        peer.add_body(builder, [rapier3d.Collider.cuboid(*(0.5 * length for length in size))])
    peer.step()
    make_ray, cast = rapier3d.Ray, peer.query_pipeline.cast_ray_and_get_normal
    rays = [
        make_ray(*ray) for ray in zip(origins[:RAPIER_RAYS].tolist(), directions[:RAPIER_RAYS].tolist(), strict=True)
    ]
    return len(rays) / best(lambda: cast_all(cast, rays), REPEATS)


def cast_all(cast: Any, rays: list[Any]) -> None:
    for ray in rays:
        cast(ray, 100.0, True)
