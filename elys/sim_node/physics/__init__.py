"""Rigid bodies: `PhysicsWorld` holds them, `PhysicsSettings` says how they are simulated."""

from elys.sim_node.physics.joint_checks import JOINT_KINDS
from elys.sim_node.physics.joint_making import JointDescription
from elys.sim_node.physics.joints import BrokenJoint, JointStates
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
from elys.sim_node.physics.settings import PhysicsSettings
from elys.sim_node.physics.states import BodyStates, ContactPoints, Energy, Hits, Momentum, Overlaps, Problem
from elys.sim_node.physics.world import PhysicsWorld

__all__ = [
    "BOX",
    "CAPSULE",
    "CYLINDER",
    "DYNAMIC",
    "HEIGHT_FIELD",
    "HULL",
    "JOINT_KINDS",
    "KINEMATIC",
    "MESH",
    "PLANE",
    "SPHERE",
    "STATIC",
    "BodyStates",
    "BrokenJoint",
    "ContactPoints",
    "Energy",
    "Hits",
    "JointDescription",
    "JointStates",
    "Momentum",
    "Overlaps",
    "PhysicsSettings",
    "PhysicsWorld",
    "Problem",
]
