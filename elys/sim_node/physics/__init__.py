"""Rigid bodies: `PhysicsWorld` holds them, `PhysicsSettings` says how they are simulated."""

from elys.sim_node.physics.kernels.tables import (
    BOX,
    CAPSULE,
    CYLINDER,
    DYNAMIC,
    HEIGHT_FIELD,
    HULL,
    KINEMATIC,
    MESH,
    PLANE,
    SPHERE,
    STATIC,
)
from elys.sim_node.physics.settings import Attractor, PhysicsSettings
from elys.sim_node.physics.states import BodyStates, ContactPoints, Energy, Hits, Momentum, Overlaps, Problem
from elys.sim_node.physics.world import PhysicsWorld

__all__ = [
    "BOX",
    "CAPSULE",
    "CYLINDER",
    "DYNAMIC",
    "HEIGHT_FIELD",
    "HULL",
    "KINEMATIC",
    "MESH",
    "PLANE",
    "SPHERE",
    "STATIC",
    "Attractor",
    "BodyStates",
    "ContactPoints",
    "Energy",
    "Hits",
    "Momentum",
    "Overlaps",
    "PhysicsSettings",
    "PhysicsWorld",
    "Problem",
]
