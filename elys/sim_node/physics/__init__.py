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
    NOTICES_ALL,
    NOTICES_MOVING,
    PLANE,
    SPHERE,
    STATIC,
)
from elys.sim_node.physics.plan import PlannedStage
from elys.sim_node.physics.settings import Attractor, PhysicsSettings
from elys.sim_node.physics.states import (
    BodyStates,
    ContactEvents,
    ContactPoints,
    Energy,
    EventChanges,
    Hits,
    Meetings,
    Momentum,
    Overlaps,
    Problem,
    Touches,
    TriggerEvents,
    Visits,
    WorldEvents,
)
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
    "NOTICES_ALL",
    "NOTICES_MOVING",
    "PLANE",
    "SPHERE",
    "STATIC",
    "Attractor",
    "BodyStates",
    "BrokenJoint",
    "ContactEvents",
    "ContactPoints",
    "Energy",
    "EventChanges",
    "Hits",
    "JointDescription",
    "JointStates",
    "Meetings",
    "Momentum",
    "Overlaps",
    "PhysicsSettings",
    "PhysicsWorld",
    "PlannedStage",
    "Problem",
    "Touches",
    "TriggerEvents",
    "Visits",
    "WorldEvents",
]
