"""Rigid bodies: `PhysicsWorld` holds them, `PhysicsSettings` says how they are simulated."""

from elys.sim_node.physics.joint_checks import JOINT_KINDS
from elys.sim_node.physics.joint_making import JointDescription
from elys.sim_node.physics.joints import BrokenJoint, JointStates
from elys.sim_node.physics.kernels.tables import BOX, DYNAMIC, KINEMATIC, SPHERE, STATIC
from elys.sim_node.physics.settings import PhysicsSettings
from elys.sim_node.physics.states import BodyStates, ContactPoints, Energy, Momentum, Problem, RayHits
from elys.sim_node.physics.world import PhysicsWorld

__all__ = [
    "BOX",
    "DYNAMIC",
    "JOINT_KINDS",
    "KINEMATIC",
    "SPHERE",
    "STATIC",
    "BodyStates",
    "BrokenJoint",
    "ContactPoints",
    "Energy",
    "JointDescription",
    "JointStates",
    "Momentum",
    "PhysicsSettings",
    "PhysicsWorld",
    "Problem",
    "RayHits",
]
