"""Scenes of rigid bodies that are hard to get right or quick, each with the measures of its own error.

Pure data: an engine is told the columns of a scene, moves them, and a case judges the trajectory that was recorded. So one
measure judges every engine, ELYS as its peers, and knows nothing of any of them.
"""

from elys.samples.rigid_cases.case import TIME_STEP, Measure, RigidCase, Trajectory
from elys.samples.rigid_cases.crowds import CROWDS, Crowd, rays_into
from elys.samples.rigid_cases.overlap import deepest_overlap
from elys.samples.rigid_cases.registry import RIGID_CASES
from elys.samples.rigid_cases.scene import BOX, CAPSULE, DYNAMIC, SPHERE, STATIC, Bodies, RigidScene

__all__ = [
    "BOX",
    "CAPSULE",
    "CROWDS",
    "DYNAMIC",
    "RIGID_CASES",
    "SPHERE",
    "STATIC",
    "TIME_STEP",
    "Bodies",
    "Crowd",
    "Measure",
    "RigidCase",
    "RigidScene",
    "Trajectory",
    "deepest_overlap",
    "rays_into",
]
