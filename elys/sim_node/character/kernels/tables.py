"""The tables that characters are moved with: one row each, in float64; lengths in m, times in s, y is up."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from elys.sim_node.physics.kernels.tables import Geometry

Table = np.ndarray[Any, Any]

WALK, SWIM, FLY = 0, 1, 2  # as the column of Character.mode has them

SKIN = 0.01  # gap that a character keeps to everything [m]: what it stands on, too
NEAR = 1e-6  # a surface is touched when it is no farther beyond the skin than this [m]: what lies a little farther ahead on a
# level floor would otherwise count as a slope
STEEPEST_PERCH = 0.15  # height of the normal on the edge of something level that still carries a character
MOST_PLANES = 24

CHARACTER = np.dtype(
    [
        ("entity", "u4"),
        ("body", "i4"),  # row of its body
        ("collider", "i4"),  # and of its capsule
        ("mode", "u1"),
        ("wish_run", "u1"),
        ("wish_jump", "u1"),
        ("wish_crouch", "u1"),
        ("grounded", "u1"),
        ("jump_held", "u1"),
        ("has_jumped", "u1"),  # in this time off the ground: no second jump out of the coyote time
        ("blocked", "u1"),  # something stopped it in this tick
        ("ground", "i4"),  # body row of what carries it, -1 for none
        ("radius", "f8"),
        ("height", "f8"),  # upright
        ("crouch_height", "f8"),
        ("stature", "f8"),  # as it is now
        ("walk_speed", "f8"),
        ("run_speed", "f8"),
        ("crouch_speed", "f8"),
        ("swim_speed", "f8"),
        ("fly_speed", "f8"),
        ("fall_speed", "f8"),
        ("acceleration", "f8"),
        ("braking", "f8"),
        ("air_control", "f8"),
        ("jump_height", "f8"),
        ("coyote_time", "f8"),
        ("jump_buffer", "f8"),
        ("slope_limit", "f8"),  # [deg]
        ("least_up", "f8"),  # height of the steepest normal that can be stood on: the cosine of that
        ("step_height", "f8"),
        ("push_force", "f8"),  # [N]
        ("mass", "f8"),  # [kg]
        ("gravity", "f8"),  # that acts on it, downwards [m/s^2]
        ("wish", "f8", 3),  # direction, of length 1 at most
        ("yaw", "f8"),  # [rad]
        ("position", "f8", 3),  # of the feet
        ("velocity", "f8", 3),  # its own, beside what carries it
        ("carried", "f8", 3),  # velocity of what carries it
        ("normal", "f8", 3),  # of the ground; of a slope too steep to stand on; else 0
        ("air_time", "f8"),  # since it last stood
        ("jump_time", "f8"),  # since jump was pressed last
        ("rotation", "f8", 4),  # what yaw makes of it
    ],
    align=True,
)

# A flat piece of the surroundings: where the capsule touches something.
PLANE = np.dtype(
    [
        ("normal", "f8", 3),  # towards the character
        ("gap", "f8"),  # beyond the skin [m], negative where it is too near
        ("point", "f8", 3),
        ("velocity", "f8", 3),  # of the surface there [m/s]
        ("push", "f8"),  # how far the solver has pushed along it [m]
        ("body", "i4"),
        ("motion", "u1"),
        ("slant", "u1"),  # FLOOR, STEEP or WALL
    ],
    align=True,
)
FLOOR, STEEP, WALL = 0, 1, 2

# What a sweep has met first.
HIT = np.dtype([("distance", "f8"), ("point", "f8", 3), ("normal", "f8", 3), ("collider", "i4")], align=True)

# What characters do to dynamic bodies: a force [N] at a point.
PUSH = np.dtype([("body", "i4"), ("force", "f8", 3), ("point", "f8", 3)], align=True)


class Surroundings(NamedTuple):
    """What characters move in, and the room to work in.

    Tables of physics; the query tree's nodes and a stack; for each body whether it is a character's; and for the one that is
    moved the rows that are near it, the planes it touches, and three hits: of a sweep, of the ground, of what is too steep.
    """

    bodies: Table
    mass: Table  # (B,) [kg]
    colliders: Table
    geometry: Geometry
    nodes: Table
    stack: Table
    is_character: Table
    near: Table
    planes: Table
    hits: Table
    touch: Table
    pushes: Table
