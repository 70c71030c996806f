"""A scene of ELYS as plain columns, where it is one that other engines can be told."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.common.components import Collider, Joint, RigidBody
from elys.common.ids import Entity
from elys.lab.peers.engine import CannotError
from elys.samples.rigid_cases import DYNAMIC, STATIC, Bodies, RigidScene
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.collider_shapes import stretched_lengths

_SHAPES = {"box": 0, "sphere": 1, "capsule": 2}


def columns_of(simulation: Simulation) -> RigidScene:
    """The bodies of a scene that was loaded and has not moved yet, dynamic and static, each with the one shape on it.

    Raises:
        CannotError: something in it has no equal among the peers; the entity and the reason.
    """
    world, states = simulation.world, simulation.physics.bodies
    if simulation.settings.attractors:
        raise CannotError("points that attract are not built in other engines")
    if len(world.query(Joint)):
        raise CannotError("joints are not built in other engines yet")
    entities = states.entity.copy()
    colliders: list[Collider] = []
    for entity, motion in zip(entities.tolist(), states.motion.tolist(), strict=True):
        colliders.append(_only_collider(simulation, Entity(entity), motion))
    owned = len(world.query(Collider, enabled_only=True))
    if owned != len(entities):
        raise CannotError(
            f"{owned} colliders stand on {len(entities)} bodies: compounds are not built in other engines yet"
        )
    lengths = stretched_lengths(world, entities, world.transforms.world_poses(entities).scale)
    bodies = Bodies(
        motion=states.motion.astype(np.uint8),
        shape=np.array([_SHAPES[collider.shape] for collider in colliders], np.uint8),
        size=lengths["size"],
        radius=lengths["radius"],
        half_length=lengths["half_length"],
        position=states.position.astype(np.float64),
        rotation=states.rotation.astype(np.float64),
        linear_velocity=states.linear_velocity.astype(np.float64),
        angular_velocity=states.angular_velocity.astype(np.float64),
        mass=np.where(states.motion == DYNAMIC, simulation.physics.masses, 1.0),
        friction=np.array([collider.friction for collider in colliders]),
        restitution=np.array([collider.restitution for collider in colliders]),
        fast=np.zeros(len(entities), np.bool_),
    )
    return RigidScene(bodies, simulation.settings.gravity)


def _only_collider(simulation: Simulation, entity: Entity, motion: int) -> Collider:
    world = simulation.world
    name = world.hierarchy.name_of(entity)
    collider = world.try_get(entity, Collider)
    if collider is None:
        raise CannotError(f"{name} has its shape on a child, which is not built in other engines yet")
    if motion not in (DYNAMIC, STATIC):
        raise CannotError(f"{name} is kinematic, which is not built in other engines yet")
    reasons: dict[str, Any] = {
        f"is a {collider.shape}": collider.shape not in _SHAPES,
        "stands off its entity": any(collider.offset),
        "is a trigger": collider.is_trigger,
        "resists rolling or spinning": collider.rolling_friction or collider.spin_friction,
        "collides with some layers alone": collider.mask != -1,
    }
    body = world.try_get(entity, RigidBody)
    if body is not None:
        reasons["is damped"] = body.linear_damping or body.angular_damping
        reasons["has a gravity of its own"] = body.gravity_scale != 1.0
        reasons["has locked axes"] = any(
            getattr(body, f"lock_{what}_{axis}") for what in ("move", "turn") for axis in "xyz"
        )
    for reason, is_given in reasons.items():
        if is_given:
            raise CannotError(f"{name} {reason}, which is not built in other engines yet")
    return collider
