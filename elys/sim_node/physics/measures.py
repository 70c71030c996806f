"""Energy and momentum of bodies, in double precision."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.common.components import Vec3
from elys.common.math import quaternion
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, DYNAMIC, HULL, SOLID, SPHERE
from elys.sim_node.physics.settings import Attractor
from elys.sim_node.physics.states import Energy, Momentum

Array = np.ndarray[Any, Any]


def energy_of(bodies: BodyTable, gravity: Vec3, attractors: tuple[Attractor, ...]) -> Energy:
    """Kinetic and potential energy of all dynamic bodies."""
    rows, mass, moments = _dynamic(bodies)
    v = rows["velocity"]
    spin = quaternion.rotate(quaternion.conjugate(rows["rotation"]), v[:, 3:])
    kinetic = 0.5 * float((mass * (v[:, :3] ** 2).sum(1)).sum() + (moments * spin**2).sum())
    height = rows["position"] @ np.asarray(gravity)
    potential = -height
    for attractor in attractors:
        away = rows["position"] - np.asarray(attractor.position)
        potential -= attractor.strength / np.sqrt((away**2).sum(1) + attractor.softening**2)
    return Energy(kinetic, float((mass * rows["gravity_scale"] * potential).sum()))


def field_at(points: Array, gravity: Vec3, attractors: tuple[Attractor, ...]) -> Array:
    """(N, 3) how fast gravity makes what falls at points (N, 3) [m/s^2]."""
    pull = np.broadcast_to(np.asarray(gravity, np.float64), points.shape).copy()
    for attractor in attractors:
        away = points - np.asarray(attractor.position)
        pull -= attractor.strength * away / ((away**2).sum(1) + attractor.softening**2)[:, None] ** 1.5
    return pull


def momentum_of(bodies: BodyTable) -> Momentum:
    """Linear momentum of all dynamic bodies, and angular momentum about the origin."""
    rows, mass, moments = _dynamic(bodies)
    linear = mass[:, None] * rows["velocity"][:, :3]
    spin = quaternion.rotate(quaternion.conjugate(rows["rotation"]), rows["velocity"][:, 3:])
    own = quaternion.rotate(rows["rotation"], moments * spin)
    return Momentum(linear.sum(0), (own + np.cross(rows["position"], linear)).sum(0))


def thickness_of(bodies: BodyTable, colliders: ColliderTable, entity: int) -> float:
    """How thick an entity's body is where its thinnest shape is [m]; infinite for what has no inside, or no body."""
    entities = np.array([entity], np.uint32)
    if not bodies.has(entities).all():
        return np.inf
    rows = colliders.rows[colliders.rows_on(bodies.rows_of(entities))]
    half = rows["half_extents"][rows["trigger"] == SOLID]
    kinds = rows["kind"][rows["trigger"] == SOLID]
    return min((_thickness(int(kind), lengths) for kind, lengths in zip(kinds, half, strict=True)), default=np.inf)


def _thickness(kind: int, half: Array) -> float:
    if kind in (SPHERE, CAPSULE):
        return 2.0 * float(half[0])
    if kind == CYLINDER:
        return 2.0 * float(half[:2].min())
    return 2.0 * float(half.min()) if kind in (BOX, HULL) else np.inf


def _dynamic(bodies: BodyTable) -> tuple[Array, Array, Array]:
    chosen = bodies.rows["motion"] == DYNAMIC
    mass = bodies.mass[chosen]
    return bodies.rows[chosen], mass, mass[:, None] * bodies.inertia[chosen]
