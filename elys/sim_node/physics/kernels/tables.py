"""The tables that kernels work on: structured arrays, one row for each body, collider, pair, manifold or contact.

A kernel takes a table as ONE argument and reads `body.velocity[0]`. Measured against tuples of separate columns this
compiles four times faster (a table is a pointer, a column is seven values that every call hands on) and keeps what is
used together in one place of the memory. In Python `table["velocity"]` is an (N, 6) array.

Vectors are in world axes unless a name says otherwise, quaternions are x y z w, and a manifold's normal points from its
first body to its second. Numbers are float64: as long as the solver is scalar it loses nothing by it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Table = np.ndarray[Any, Any]

DYNAMIC, KINEMATIC, STATIC = 0, 1, 2
BOX, SPHERE = 0, 1
POINTS = 4  # the most contact points a manifold keeps; point p of manifold m is row 4 m + p of the points

# What moves. A body's frame sits in its centre of mass, along its principal axes of inertia.
BODY = np.dtype(
    [
        ("position", "f8", 3),  # centre of mass [m]
        ("rotation", "f8", 4),  # world_from_principal
        ("velocity", "f8", 6),  # linear [m/s], angular [rad/s]
        ("displacement", "f8", 6),  # translation [m], rotation vector [rad] since the step began
        ("inverse_mass", "f8"),  # [1/kg], 0 for what no force moves
        ("inverse_inertia", "f8", 3),  # about the principal axes [1/(kg m^2)]
        ("world_inverse_inertia", "f8", 6),  # xx yy zz xy xz yz, as the step began
        ("gravity_scale", "f8"),
        ("linear_damping", "f8"),  # [1/s]
        ("angular_damping", "f8"),  # [1/s]
        ("free_velocity", "f8", 6),  # velocity without the contacts' impulses of this substep
        ("start_velocity", "f8", 6),  # velocity as the substep began
        ("impact_shift", "f8", 6),  # displacement that impacts of this substep add
        ("entity", "u4"),
        ("motion", "u1"),  # DYNAMIC, KINEMATIC or STATIC
        ("struck", "u1"),  # a contact began to push in this substep
    ],
    align=True,
)

# Bodies as the outside sees them: poses of entities, not of centres of mass.
POSE = np.dtype(
    [
        ("center", "f8", 3),  # centre of mass in the entity's space [m]
        ("axes", "f8", 4),  # entity_from_principal
        ("position", "f8", 3),  # of the entity [m]
        ("rotation", "f4", 4),  # world_from_entity
        ("linear_velocity", "f4", 3),  # of the centre of mass [m/s]
        ("angular_velocity", "f4", 3),  # [rad/s]
    ],
    align=True,
)

# Shapes, each on a body; sorted by body.
COLLIDER = np.dtype(
    [
        ("body", "i4"),
        ("entity", "u4"),  # the entity that carries the collider: the body's, or one below it
        ("kind", "u1"),  # BOX or SPHERE
        ("moved", "u1"),  # the fat box is new
        ("half_extents", "f8", 3),  # of a box; a sphere's radius three times [m]
        ("center", "f8", 3),  # in world space [m]
        ("axes", "f8", 9),  # the three axes of the shape in world space, one after another
        ("reach", "f8"),  # radius of the ball around the shape's centre that holds it [m]
        ("local_position", "f8", 3),  # in the body's frame [m]
        ("local_rotation", "f8", 4),  # principal_from_shape
        ("friction", "f8"),
        ("restitution", "f8"),
        ("box", "f8", 6),  # smallest axis-aligned box: lower corner, upper corner [m]
        ("fat_box", "f8", 6),  # what pairs are found with: larger, so that it lasts [m]
    ],
    align=True,
)

# Morton codes and the order they give, twice: a radix sort needs room.
TREE_LEAF = np.dtype([("code", "i8"), ("other_code", "i8"), ("order", "i4"), ("other_order", "i4")], align=True)

# Colliders whose fat boxes overlap, sorted by (a, b) with a < b.
PAIR = np.dtype([("a", "i4"), ("b", "i4"), ("slot", "i4")], align=True)  # slot: the pair's manifold

# What is remembered of a pair from step to step.
MANIFOLD = np.dtype(
    [
        ("point_count", "i4"),
        ("margin", "f8"),  # gap up to which points were looked for when made [m]; negative: never made
        ("normal", "f8", 3),
        ("friction_impulse", "f8", 3),  # of the last substep [N s]
        ("twist_impulse", "f8"),  # about the normal [N m s]
        ("made_offset", "f8", 3),  # from a to b when made [m]
        ("made_rotation_a", "f8", 4),
        ("made_rotation_b", "f8", 4),
    ],
    align=True,
)
MANIFOLD_POINT = np.dtype(
    [
        ("anchor_a", "f8", 3),  # on the surface of a, from a's centre of mass [m]
        ("anchor_b", "f8", 3),
        ("made_separation", "f8"),  # gap when the manifold was made [m], negative for overlap
        ("separation", "f8"),  # gap at the end of the last step [m]
        ("normal_impulse", "f8"),  # of the last substep [N s]
        ("step_impulse", "f8"),  # of the whole last step [N s]
        ("feature", "i4"),  # which corner, edge or face meets which: recognises a point in the next step
    ],
    align=True,
)

# What a narrow phase function finds, and the room it works in.
FOUND = np.dtype(
    [
        ("normal", "f8", 3),
        ("point", "f8", 3 * POINTS),  # in the middle between the surfaces [m]
        ("separation", "f8", POINTS),  # [m]
        ("impulse", "f8", POINTS),
        ("polygon", "f8", 48),  # two polygons of eight corners: u, v, height over the reference face
        ("edges", "i4", 32),  # which two edges meet in a corner
        ("feature", "i4", POINTS),
    ],
    align=True,
)

# The solver's view of a manifold with contact: what stays during the step, and its impulses.
ROW = np.dtype(
    [
        ("body_a", "i4"),
        ("body_b", "i4"),
        ("point_count", "i4"),
        ("slot", "i4"),
        ("normal", "f8", 3),
        ("tangent", "f8", 6),  # two directions, perpendicular to the normal and to each other
        ("friction", "f8"),
        ("restitution", "f8"),
        ("push_rate", "f8"),  # how fast overlap is pushed out [1/s]
        ("mass_scale", "f8"),  # softness: share of the effective mass
        ("impulse_scale", "f8"),  # softness: share of the impulse given back
        ("closing", "f8"),  # relative acceleration by gravity, against the normal [m/s^2]
        ("friction_mass", "f8", 3),  # inverse of the symmetric 2 x 2 effective inverse mass: 11, 12, 22
        ("friction_impulse", "f8", 3),  # along the tangents [N s], about the normal [N m s]
        ("friction_arm", "f8", 12),  # r x t at the centre of friction: first tangent on a, on b, second on a, on b
        ("friction_turn", "f8", 12),  # inverse inertia times that
        ("twist_turn", "f8", 6),
        ("twist_mass", "f8"),  # [kg m^2]
    ],
    align=True,
)
ROW_POINT = np.dtype(
    [
        ("arm", "f8", 6),  # r x n on a and on b [m]
        ("turn", "f8", 6),  # inverse inertia times that
        ("separation", "f8"),  # as the step began [m]
        ("effective_mass", "f8"),  # [kg]
        ("lever", "f8"),  # distance from the centre of friction [m]
        ("impulse", "f8"),  # of this substep [N s]
        ("step_impulse", "f8"),  # of the whole step so far [N s]
        ("bounce", "f8"),  # compression impulse of an impact [N s]
        ("bounce_time", "f8"),  # of the impact, from the start of the substep [s]; negative: no impact
    ],
    align=True,
)

# What a joint holds together: two bodies, or a body and the world (row -1). Where a field has room for both sides, body a
# comes first. A joint has LOCKED rows that are held, one row for its free coordinate (the angle of a hinge or a twist, the
# way of a slider, a length) and one for the angle by which a cone has swung.
FIXED, BALL, HINGE, SLIDER, DISTANCE, CONE, GEAR, MOTOR = range(8)
LOCKED, AXIS, SWING, JOINT_ROWS = 6, 6, 7, 8  # row r of joint j is row 8 j + r of the joint rows
CORRECTION = 0.25  # share of a joint's error that a substep takes away
LARGEST_ERROR = 0.2  # what is farther off comes back as if it were not [m], [rad]
JOINT = np.dtype(
    [
        # what was asked for
        ("id", "u4"),
        ("entity", "u4", 2),  # 0 for the world
        ("geared", "u4", 2),  # the joints that a gear couples
        ("kind", "u1"),
        ("collide_connected", "u1"),
        ("anchor", "f8", 6),  # in the spaces of the entities [m]
        ("rotation", "f8", 8),  # entity_from_joint, twice
        ("lower", "f8"),  # limits of the coordinate [m] or [rad]
        ("upper", "f8"),
        ("swing_limit", "f8"),  # [rad]
        ("frequency", "f8"),  # of the locked rows [Hz]; 0 for rigid
        ("damping_ratio", "f8"),
        ("spring_frequency", "f8"),  # of the coordinate about `spring_rest` [Hz]; 0 for no spring
        ("spring_damping", "f8"),  # damping ratio
        ("spring_rest", "f8"),
        ("spring_limit", "f8"),  # most force [N] or torque [N m]
        ("motor_speed", "f8"),  # [m/s] or [rad/s]
        ("motor_limit", "f8"),  # most force [N] or torque [N m]; 0 for no motor
        ("drive_velocity", "f8", 6),  # that a MOTOR gives b against a, in the frame of a: linear, angular
        ("drive_limit", "f8", 2),  # most force [N] and torque [N m] of a MOTOR
        ("ratio", "f8"),  # of a gear: its second coordinate changes by `ratio` where the first changes by one
        ("break_force", "f8"),  # [N]
        ("break_torque", "f8"),  # [N m]
        # what it remembers
        ("broken", "u1"),
        ("impulse", "f8", LOCKED),  # of the last substep, for each locked row
        ("spring_impulse", "f8"),
        ("motor_impulse", "f8"),
        ("lower_impulse", "f8"),
        ("upper_impulse", "f8"),
        ("gear_impulse", "f8"),  # of all gears on the coordinate
        ("swing_impulse", "f8"),
        ("coordinate", "f8"),  # angles are counted over turns
        ("gear_offset", "f8"),
        ("stiffness", "f8"),  # of the spring, [N/m] or [N m/rad]; negative: not known yet
        ("spring_friction", "f8"),  # of the spring, [N s/m] or [N m s/rad]
        # what it tells
        ("speed", "f8"),
        ("force", "f8"),  # between the bodies, mean over the last step [N]
        ("torque", "f8"),  # at the anchor [N m]
        # the place of things
        ("body", "i4", 2),
        ("gear_row", "i4", 2),
        ("local_anchor", "f8", 6),  # in the bodies' frames
        ("local_rotation", "f8", 8),  # principal_from_joint
        # work of a step
        ("live", "u1"),
        ("geared_by", "u1"),  # a gear acts on its coordinate
        ("free", "u1"),  # how many of the free rows anything acts on
        ("direct", "u1"),  # its locked rows are solved together with those of other joints
        ("locked", "i4"),  # how many rows are locked
        ("inverse_mass", "f8", 2),
        ("start_inertia", "f8", 12),  # world inverse inertia as the step began
        ("start_arm", "f8", 6),  # from the centres of mass to the anchors
        ("start_frame", "f8", 8),  # world_from_joint
        ("start_offset", "f8", 3),  # from anchor to anchor
        ("shift", "f8", 12),  # displacements of both bodies
        ("velocity", "f8", 12),
        ("turn", "f8", 8),  # of both bodies since the step began
        ("inertia", "f8", 12),
        ("arm", "f8", 6),
        ("frame", "f8", 8),
        ("offset", "f8", 3),
        ("axis_a", "f8", 9),  # the axes of a's frame, one after another
        ("axis_b", "f8", 3),  # the first axis of b's frame
        ("swing", "f8"),  # [rad]
        ("spring_start", "f8"),  # coordinate as the substep began
        ("factor", "f8", LOCKED * LOCKED),  # of the locked rows' inverse effective mass
        ("work", "f8", LOCKED),
        ("applied", "f8", 9),  # impulse in this substep: on b, and the angular ones on a and b
        ("given", "f8", 12),  # what it changed in the velocities
        ("step_impulse", "f8", 6),  # of the whole step: on b, and at the anchor
    ],
    align=True,
)
JOINT_ROW = np.dtype(
    [
        ("direction", "f8", 3),
        ("arm", "f8", 6),  # how the angular velocities count, minus on a and plus on b
        ("turn", "f8", 6),  # inverse inertia times that
        ("error", "f8"),  # [m] or [rad]
        ("lead", "f8"),  # how much faster the row will be at the end of the substep, because it turns
        ("start_rate", "f8"),  # as the substep began
        ("own", "f8"),  # how much a unit impulse changes the rate, without regard to other rows
        ("effective_mass", "f8"),  # with the locked rows held
        ("answer", "f8", LOCKED),  # impulses of the locked rows that answer a unit of this one
    ],
    align=True,
)
# Joints whose locked rows are solved directly, in the order of elimination, and what stands below the diagonal of each.
JOINT_COLUMN = np.dtype([("joint", "i4"), ("first", "i4"), ("count", "i4"), ("update", "i4")], align=True)
JOINT_BLOCK = np.dtype(
    [
        ("joint", "i4"),  # whose rows stand here; it is eliminated later
        ("response", "f8", LOCKED * LOCKED),  # of its rows to impulses of the column's rows
        ("gain", "f8", LOCKED * LOCKED),  # that times the inverse of the block on the diagonal
    ],
    align=True,
)

# What is the same for all bodies and contacts of a step; a table of one row.
CONSTANTS = np.dtype(
    [
        ("substep", "f8"),  # [s]
        ("gravity", "f8", 3),  # [m/s^2]
        ("margin", "f8"),  # gap up to which resting contacts are kept [m]
        ("fattening", "f8"),  # how much larger fat boxes are [m]
        ("recycle_distance", "f8"),  # a manifold is kept while its bodies moved less against each other [m]
        ("recycle_angle", "f8"),  # and each turned less [rad]
        ("push_speed", "f8"),  # overlap is never removed faster [m/s]
        ("bounce_speed", "f8"),  # slower approaches do not bounce [m/s]
        ("soft", "f8", 3),  # push_rate, mass_scale, impulse_scale between bodies that can both move
        ("firm", "f8", 3),  # the same against what cannot be moved
        ("substeps", "i4"),
        ("can_bounce", "u1"),  # some collider has restitution
    ],
    align=True,
)


def grown(table: Table, count: int) -> Table:
    """The same rows with room for `count`; what is added is zero."""
    larger = np.zeros((count, *table.shape[1:]), table.dtype)
    larger[: len(table)] = table
    return larger
