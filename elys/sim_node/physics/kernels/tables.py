"""The tables that kernels work on: structured arrays, one row for each body, collider, pair, manifold or contact.

A kernel takes a table as ONE argument and reads `body.velocity[0]`. Measured against tuples of separate columns this
compiles four times faster (a table is a pointer, a column is seven values that every call hands on) and keeps what is
used together in one place of the memory. In Python `table["velocity"]` is an (N, 6) array.

Vectors are in world axes unless a name says otherwise, quaternions are x y z w, and a manifold's normal points from its
first body to its second. Numbers are float64, but for what the contact solver works on: that is float32, eight at a time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

Table = np.ndarray[Any, Any]

DYNAMIC, KINEMATIC, STATIC = 0, 1, 2
JOINTED = 2  # in `held`: a joint may act on a body
BOX, SPHERE, CAPSULE, CYLINDER, HULL, MESH, PLANE, HEIGHT_FIELD = 0, 1, 2, 3, 4, 5, 6, 7
ROUNDED = (SPHERE, CAPSULE)  # a core with a radius around it
TRIANGLE = 8  # a part of a mesh or a height field; no collider is of this kind
TRIGGER, IN_PARTS = 1, 2
SOLID, NOTICES_MOVING, NOTICES_ALL = 0, 1, 2
GEOMETRIC_MEAN, MINIMUM, MAXIMUM, AVERAGE, MULTIPLY = 0, 1, 2, 3, 4
CORNERS = 32  # the most corners of a face that contacts are made with; of larger faces some are left out
MOST_ATTRACTORS = 16
FORCED = 2  # of can_bounce: all that it is about is done whether or not anything needs it
TOLD_SPEED, TOLD_SPIN, FRESH = 1, 2, 4
POINTS = 4  # the most contact points a manifold keeps; point p of manifold m is row 4 m + p of the points

# What moves. A body's frame sits in its centre of mass, along its principal axes of inertia.
BODY = np.dtype(
    [
        ("position", "f8", 3),  # centre of mass [m]
        ("rotation", "f8", 4),  # world_from_principal
        ("velocity", "f8", 6),  # linear [m/s], angular [rad/s]
        ("inverse_mass", "f8"),  # [1/kg], 0 for what no force moves
        ("inverse_inertia", "f8", 3),  # about the principal axes [1/(kg m^2)]
        ("gravity_scale", "f8"),
        ("linear_damping", "f8"),  # [1/s]
        ("angular_damping", "f8"),  # [1/s]
        ("extent", "f8"),  # distance of its farthest point from the centre of mass [m]
        ("still_time", "f8"),  # for how long it has hardly moved [s]
        ("next_asleep", "i4"),  # row of the next body of its sleeping island, in a ring
        ("entity", "u4"),
        ("motion", "u1"),  # DYNAMIC, KINEMATIC or STATIC
        ("asleep", "u1"),  # AWAKE, ASLEEP or WAKING
        ("strength", "u1"),  # which row of STRENGTH its contacts asked for in the last step
        ("calm", "u1"),  # for how many steps its island has been solved more strongly than it asked for
        ("held", "u1"),  # 1 where a contact may act on it in this step, JOINTED where a joint may, else 0
        ("locked", "u1"),  # bits: axes of the world along which (0 to 2) and about which (3 to 5) it never moves
        ("pushed", "u1"),  # its row of FORCE is not zero
        ("told", "u1"),  # bits of what has been told about it, TOLD_SPEED to TOLD_SPIN, and FRESH
    ],
    align=True,
)

# What pushes a body from outside, beside fields: force [N] and torque about the centre of mass [N m], in world axes.
FORCE = np.dtype([("once", "f8", 6), ("lasting", "f8", 6)])  # for the next step only; until it is changed

# A body as the contact solver sees it, 64 bytes: one line of the cache. Its flat float32 view is what vectors are loaded
# from. Row i is body row i; one more row at the end stands for everything that never moves.
SOLVER_BODY = np.dtype(
    [
        ("velocity", "f4", 6),  # linear [m/s], angular [rad/s]
        ("inverse_mass", "f4"),  # [1/kg]
        ("struck", "f4"),  # above 0: a contact began to push in this substep
        ("displacement", "f4", 6),  # translation [m], rotation vector [rad] since the step began
        ("unused", "f4", 2),
    ]
)
# What changes a body apart from contacts, in eights as well.
SOLVER_DRIVE = np.dtype(
    [
        ("free_velocity", "f4", 8),  # velocity without the contacts' impulses of this substep
        ("start_velocity", "f4", 8),  # velocity as the substep began
        ("kick", "f4", 8),  # change of velocity by forces in a substep
        ("keep", "f4", 8),  # what damping leaves of the velocity in a substep
        ("inverse_inertia", "f4", 6),  # in world axes, as the step began: xx yy zz xy xz yz [1/(kg m^2)]
        ("gravity_scale", "f4"),
        ("locked", "f4"),  # bits 0 to 2 of the body's, as a number
        ("impact_shift", "f4", 8),  # displacement that impacts of this substep add, while they are found
    ]
)

# What a step has found on its way; a table of one row.
STEP_REPORT = np.dtype(
    [
        ("fast_count", "i4"),  # bodies that have become faster than allowed
        ("most_gained", "i4"),  # the row of the body that has gained the most energy
        ("kinetic_before", "f8"),  # of all awake dynamic bodies, without their turning [J]
        ("kinetic_after", "f8"),
        ("mass", "f8"),  # of them [kg]
        ("forced", "f8"),  # what forces from outside would have given to them at rest [J]
        ("driven", "f8"),  # the largest squared speed of what moves by itself [m^2/s^2]
        ("gain", "f8"),  # of the body named above [J]
    ],
    align=True,
)

# The worst contacts among those that `measure_step` has looked at in a round; entities of their bodies, 0 where there are none.
GLANCE = np.dtype(
    [
        ("deepest_overlap", "f8"),  # [m]
        ("residual", "f8"),  # fastest approach that the solver left where surfaces overlap [m/s]
        ("deepest_a", "u4"),
        ("deepest_b", "u4"),
        ("restless_a", "u4"),
        ("restless_b", "u4"),
    ],
    align=True,
)

# All that it finds, in the order of `StepDiagnostics`; a table of one row. No field is an array: those take Python longer.
MEASURES = np.dtype(
    [
        ("kinetic", "f8"),  # of the bodies that were looked at [J]
        ("potential", "f8"),
        ("momentum_x", "f8"),  # [kg m/s]
        ("momentum_y", "f8"),
        ("momentum_z", "f8"),
        ("angular_x", "f8"),  # about the origin [kg m^2/s]
        ("angular_y", "f8"),
        ("angular_z", "f8"),
        *GLANCE.descr,
        ("joint_error", "f8"),  # [m]
        ("joint_angle_error", "f8"),  # [rad]
        ("joint", "u4"),  # ids of the joints that are so far off, 0 for none
        ("turned_joint", "u4"),
        ("awake_count", "i4"),  # dynamic bodies that are awake
        ("island_count", "i4"),  # of them
    ],
    align=True,
)

# Where a body was when the step began.
START = np.dtype([("position", "f8", 3), ("rotation", "f8", 4)], align=True)

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
        ("kind", "u1"),  # BOX to HEIGHT_FIELD
        ("trigger", "u1"),  # SOLID, or notices what touches it and pushes nothing
        ("layer", "u4"),  # bits: two colliders meet when each one's layer is in the other's mask
        ("mask", "u4"),
        ("geometry", "i4"),  # row of the header of a hull, mesh or height field, else -1
        ("half_extents", "f8", 3),  # along the shape's axes [m]; radius, half length without caps, radius of a capsule
        ("center", "f8", 3),  # in world space [m]
        ("axes", "f8", 9),  # the three axes of the shape in world space, one after another
        ("reach", "f8"),  # radius of the ball around the shape's centre that holds it [m]
        ("turning", "f8"),  # how far its farthest point can go in this step because the body turns [m]
        ("local_position", "f8", 3),  # in the body's frame [m]
        ("local_rotation", "f8", 4),  # principal_from_shape
        ("friction", "f8"),
        ("restitution", "f8"),
        ("rolling_friction", "f8"),  # arm of the normal force that resists rolling [m]
        ("spin_friction", "f8"),  # and turning about the normal [m]
        ("box", "f8", 6),  # smallest axis-aligned box: lower corner, upper corner [m]
    ],
    align=True,
)

# A collider as the broad phase sees it, three lines of the cache. The first is what the search for pairs reads: its own box, and
# copies of all that decides whether two are a pair, taken whenever it gets a new box. The others are copies of what says how near
# two are in this step.
PROXY = np.dtype(
    [
        ("fat_box", "f8", 6),  # what pairs are found with: larger than the smallest box, so that it lasts [m]
        ("body", "i4"),
        ("layer", "u4"),
        ("mask", "u4"),
        ("kind", "u1"),
        ("trigger", "u1"),
        ("motion", "u1"),  # of the body
        ("unused", "u1"),
        ("box", "f8", 6),  # as in COLLIDER [m]
        ("turning", "f8"),
        ("reach", "f8"),
        ("velocity", "f8", 3),  # of the body [m/s]
        ("thinness", "f8"),  # how far something may move past its surface before its middle lies behind it [m]
        ("special", "u1"),  # TRIGGER or IN_PARTS, else 0
        ("unused_too", "u1", 31),
    ]
)

# Morton codes and the order they give, twice: a radix sort needs room.
TREE_LEAF = np.dtype([("code", "i8"), ("other_code", "i8"), ("order", "i4"), ("other_order", "i4")], align=True)

# Colliders whose fat boxes overlap, a < b; the manifold stands in the same row, its slot. Where a is -1 there is no pair.
PAIR = np.dtype(
    [
        ("a", "i4"),
        ("b", "i4"),
        ("part", "i4"),  # which triangle of a mesh or height field, else 0
        ("touched", "u1"),  # it touched, or was in the trigger, as the last step that looked at it ended
        ("blank", "u1"),  # its manifold says nothing: the two were too far apart, or were never looked at
    ],
    align=True,
)

# Two colliders that met or parted: their entities and their bodies'. Of a visit a is the trigger.
MEETING = np.dtype([("a", "u4"), ("b", "u4"), ("body_a", "u4"), ("body_b", "u4")])

# The same with where and how: a contact that has begun, or goes on. Not a prefix of it: numba would take one for the other.
TOUCH = np.dtype(
    [
        ("point", "f8", 3),  # the deepest, in the middle between the surfaces [m]
        ("normal", "f8", 3),  # from a to b
        ("depth", "f8"),  # overlap there after the step, negative for a gap [m]
        ("impulse", "f8"),  # of the step, along the normals of all points [N s]
        ("speed", "f8"),  # at which they closed as they first touched; 0 for one that goes on [m/s]
        *MEETING.descr,
    ],
    align=True,
)

# What is remembered of a pair from step to step. The first 64 floats are gathered as vectors, eight at a time.
MANIFOLD = np.dtype(
    [
        ("normal", "f4", 3),
        ("friction", "f4"),
        ("restitution", "f4"),
        ("live_points", "f4"),  # point_count again
        ("impulse_time", "f4"),  # of which substep the impulses below are [s]
        ("load", "f4"),  # force that it has held for some time [N]
        ("made_separation", "f4", POINTS),  # gaps when the manifold was made [m], negative for overlap
        ("shift", "f4", 3),  # how far b has moved against a since [m]
        ("unused_too", "f4"),
        ("anchors", "f4", 6 * POINTS),  # of each point on a and on b, from their centres of mass [m]
        ("turn_a", "f4", 3),  # rotation vectors since the manifold was made [rad]
        ("turn_b", "f4", 3),
        ("padding", "f4", 2),
        ("normal_impulse", "f4", POINTS),  # of the last substep [N s]
        ("friction_impulse", "f4", 3),  # in world axes
        ("twist_impulse", "f4"),  # about the normal [N m s]
        ("separation", "f4", POINTS),  # gaps at the end of the last step [m]
        ("step_impulse", "f4", POINTS),  # of the whole last step [N s]
        ("rolling_impulse", "f4", 3),  # in world axes [N m s]
        ("rolling_friction", "f4"),  # [m]
        ("spin_friction", "f4"),  # [m]
        ("padding_too", "f4", 3),
        ("made_offset", "f8", 3),  # from a to b when made [m]
        ("made_rotation_a", "f8", 4),
        ("made_rotation_b", "f8", 4),
        ("margin", "f8"),  # gap up to which points were looked for when made [m]; negative: never made
        ("feature", "i4", POINTS),  # which corner, edge or face meets which: recognises a point in the next step
        ("point_count", "i4"),
    ],
    align=True,
)

# What a narrow phase function finds, and the room it works in.
FOUND = np.dtype(
    [
        ("hint", "f8", 3),  # the normal of the step before, from a to b; 0 for none
        ("normal", "f8", 3),
        ("point", "f8", 3 * POINTS),  # in the middle between the surfaces [m]
        ("separation", "f8", POINTS),  # [m]
        ("impulse", "f8", POINTS),  # room to find the old points' impulses
        ("step_impulse", "f8", POINTS),
        ("polygon", "f8", 48),  # two polygons of eight corners: u, v, height over the reference face
        ("edges", "i4", 32),  # which two edges meet in a corner
        ("feature", "i4", POINTS),
        # The same for faces of any shape: corners of the two that meet, from the pair's origin; then outlines as above.
        ("reference", "f8", 3 * CORNERS),
        ("incident", "f8", 3 * CORNERS),
        ("outline", "f8", 12 * CORNERS),  # two outlines of up to 2 CORNERS corners: u, v, height
        ("sides", "i4", 8 * CORNERS),  # which two sides meet in each of those corners
    ],
    align=True,
)

# A convex shape as the general narrow phase and casts see it: a core, and a radius around it. Balls are points with a
# radius, capsules segments with one; everything else is all core. Places are relative to a point that both shapes of a
# pair share, near them, so that nothing is lost far from the origin.
CONVEX = np.dtype(
    [
        ("center", "f8", 3),  # [m]
        ("axes", "f8", 9),  # the shape's axes, one after another; a triangle's second is its normal
        ("half_extents", "f8", 3),  # as in COLLIDER [m]
        ("radius", "f8"),  # around the core [m]
        ("scale", "f8"),  # of the core about its centre, 1 but for a first guess where cores overlap
        ("corners", "f8", 9),  # of a triangle, from its centre [m]
        ("kind", "i4"),
        ("first_point", "i4"),  # of a hull
        ("point_count", "i4"),
        ("first_face", "i4"),
        ("face_count", "i4"),
        # Of a triangle: bit k where something may hang over its edge from corner k to the next, bit 3 + k where one triangle lies
        # beyond that edge. What else is known around it follows its corners in the points, see `geometry._surroundings`.
        ("active", "i4"),
    ],
    align=True,
)

# The room that distances between cores are found in, and what was found.
SIMPLEX = np.dtype(
    [
        ("vertex", "f8", 12),  # up to four points of a minus b [m]
        ("from_a", "f8", 12),  # the points of a that they come from [m]
        ("weight", "f8", 4),
        ("direction", "f8", 3),  # unit vector from a to b
        ("on_a", "f8", 3),  # the points of the cores that are closest [m]
        ("on_b", "f8", 3),
        ("count", "i4"),
    ],
    align=True,
)

# Where a hull, mesh or height field lies in the arrays of all geometry; its points are relative to the collider's centre.
GEOMETRY = np.dtype(
    [
        ("kind", "i4"),
        ("first_point", "i4"),  # of a hull's vertices; corners of faces come after them
        ("point_count", "i4"),
        ("first_face", "i4"),
        ("face_count", "i4"),
        ("first_node", "i4"),  # of the tree over a mesh's triangles, two to a leaf, in the order of the faces
        ("leaf_count", "i4"),
    ],
    align=True,
)

# Faces of hulls and triangles of meshes.
FACE = np.dtype(
    [
        ("normal", "f8", 3),
        ("first_corner", "i4"),  # in the points; corners go round counter-clockwise as seen from outside
        ("corner_count", "i4"),
        ("active", "i4"),  # as in CONVEX
        ("source", "i4"),  # which triangle it was in the arrays that a mesh was made from
    ],
    align=True,
)

# A manifold that may bounce, as impacts see it: what stays during the step.
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
        ("closing", "f8"),  # relative acceleration by gravity, against the normal [m/s^2]
        ("friction_mass", "f8", 3),  # inverse of the symmetric 2 x 2 effective inverse mass: 11, 12, 22
        ("friction_arm", "f8", 12),  # r x t at the centre of friction: first tangent on a, on b, second on a, on b
        ("friction_turn", "f8", 12),  # inverse inertia times that
    ],
    align=True,
)
ROW_POINT = np.dtype(
    [
        ("arm", "f8", 6),  # r x n on a and on b [m]
        ("turn", "f8", 6),  # inverse inertia times that
        ("separation", "f8"),  # as the step began [m]
        ("effective_mass", "f8"),  # [kg]
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
CORRECTION_SPEED = 10.0  # at which it is taken away at most [m/s], [rad/s]
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
        ("impulse_time", "f8"),  # of which substep the impulses above are [s]; 0 where none was yet
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
        ("live", "u1"),  # holds something that is awake
        ("strength", "u1"),  # of its island
        ("mover", "i4", 2),  # rows of the solver's bodies, -1 for what never moves
        ("geared_by", "u1"),  # a gear acts on its coordinate
        ("part", "i4"),  # which it was solved with in the last step, -1 for none
        ("free", "u1"),  # how many of the free rows anything acts on
        ("direct", "u1"),  # its locked rows are solved together with those of other joints
        ("locked", "i4"),  # how many rows are locked
        ("inverse_mass", "f8", 2),
        ("axis_mass", "f8", 6),  # the same along the axes of the world, 0 along locked ones
        ("turns_locked", "u1", 2),  # some turns of the body are locked
        ("start_inertia", "f8", 12),  # world inverse inertia as the step began
        ("start_arm", "f8", 6),  # from the centres of mass to the anchors
        ("start_frame", "f8", 8),  # world_from_joint
        ("start_offset", "f8", 3),  # from anchor to anchor
        ("shift", "f8", 12),  # displacements of both bodies
        ("velocity", "f8", 12),
        ("path", "f8", 12),  # the mean velocities over a substep that the rows are written for
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
# Joints whose locked rows are solved directly, part by part in the order of elimination, and what stands below the diagonal.
JOINT_COLUMN = np.dtype([("joint", "i4"), ("first", "i4"), ("count", "i4"), ("update", "i4")], align=True)
# Joints that feel one another, as they hang together by bodies that can be pushed and by gears: they are solved together.
JOINT_PART = np.dtype(
    [
        ("first", "i4"),  # range of the list that joints are sorted into by part
        ("last", "i4"),
        ("first_column", "i4"),
        ("last_column", "i4"),
        ("impulsive", "u1"),  # in this substep: solved as a blow where it begins, see kernels/joints.py
    ],
    align=True,
)
# The awake parts of one strength, a range of the list that parts are sorted into.
JOINT_GROUP = np.dtype([("first", "i4"), ("last", "i4")], align=True)
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
        ("time", "f8"),  # of the step [s]
        ("gravity", "f8", 3),  # [m/s^2]
        ("down", "f8", 3),  # its direction; zero without gravity
        ("margin", "f8"),  # gap up to which resting contacts are kept [m]
        ("fattening", "f8"),  # how much larger fat boxes are [m]
        ("recycle_distance", "f8"),  # a manifold is kept while its bodies moved less against each other [m]
        ("recycle_angle", "f8"),  # and each turned less [rad]
        ("bounce_speed", "f8"),  # slower approaches do not bounce [m/s]
        ("sleep_speed", "f8"),  # what is slower [m/s]
        ("sleep_spin", "f8"),  # and turns more slowly [rad/s]
        ("sleep_time", "f8"),  # for so long falls asleep [s]
        ("overlap", "f8"),  # contacts that would give way more are solved by a stronger row of STRENGTH [m]
        ("friction_rule", "u1"),  # how a pair's coefficient follows from two: GEOMETRIC_MEAN to MULTIPLY
        ("restitution_rule", "u1"),
        ("can_bounce", "u1"),  # some collider has restitution; or FORCED
        ("can_roll", "u1"),  # some collider has rolling or spinning friction
        ("can_lock", "u1"),  # some body has a locked axis
        ("gyroscopic", "u1"),  # bodies with three equal moments turn as Euler's equations say, like all others
        ("attractor_count", "i4"),
        ("attractors", "f8", 5 * MOST_ATTRACTORS),  # place [m], strength [m^3/s^2], squared softening [m^2] of each
        ("max_linear_speed", "f8"),  # [m/s]
        ("max_angular_speed", "f8"),  # [rad/s]
    ],
    align=True,
)

# How strongly contacts are solved: a row for each number of substeps that islands may be given, weakest first.
STRENGTH = np.dtype(
    [
        ("substep", "f8"),  # [s]
        ("softness", "f8"),  # how much a contact gives way: overlap [m] = softness * force [N] / effective mass [kg]
        ("push_speed", "f4"),  # overlap is never removed faster [m/s]
        ("soft", "f4", 3),  # between bodies that can both move: push rate [1/s], share of the effective mass, leak
        ("firm", "f4", 3),  # the same against what cannot be moved
        ("substeps", "i4"),
        ("relax_every", "i4"),  # after so many substeps contacts are solved once more, without the push
    ],
    align=True,
)

# An island, in the row of its first body.
ISLAND = np.dtype(
    [
        ("still_time", "f8"),  # the shortest of its bodies' [s]
        ("low", "f8"),  # its lowest and highest centre of mass along gravity [m]
        ("high", "f8"),
        ("extent", "f8"),  # sum of its bodies' [m]
        ("body_count", "i4"),
        ("wanted", "u1"),  # the strength that its contacts ask for
        ("present", "u1"),  # the largest that its bodies had in the last step
        ("is_jointed", "u1"),
        ("contacts", "i4"),  # how many hold it together
        ("group", "i4"),  # row of GROUP that it is solved with
    ],
    align=True,
)

# Batches [first, last) that belong together: a colour's, or what no colour was left for, which has to be solved in its order.
SPAN = np.dtype([("first", "i4"), ("last", "i4"), ("is_serial", "i4")])

# Islands of one strength: their bodies in `held` and their colours in a table of SPANs.
GROUP = np.dtype(
    [
        ("strength", "i4"),  # row of STRENGTH
        ("contacts", "i4"),  # how many it has
        ("first_body", "i4"),
        ("last_body", "i4"),
        ("first_span", "i4"),
        ("last_span", "i4"),
        ("first_row", "i4"),  # of the table of ROWs: what may bounce
        ("last_row", "i4"),
    ]
)


# Contact points of a collider with several parts of a mesh that have one normal; twice the room of a manifold.
MOST_CLUSTERS = 16  # directions in which one collider can be held by one mesh
CLUSTER = np.dtype(
    [
        ("normal", "f8", 3),
        ("point", "f8", 6 * POINTS),
        ("separation", "f8", 2 * POINTS),
        ("feature", "i4", 2 * POINTS),
        ("count", "i4"),
        ("origin", "i4"),  # the pair in which it was found first
        ("host", "i4"),  # the pair that keeps it
    ],
    align=True,
)


class Geometry(NamedTuple):
    """Hulls, meshes and height fields of a world, and the room that the narrow phase works in."""

    headers: Table  # GEOMETRY
    faces: Table  # FACE
    points: Table  # (N, 3) vertices of hulls, corners of faces [m]
    nodes: Table  # (M, 6) trees over triangles, each with its root at first_node + 1
    convex: Table  # (2,) CONVEX
    simplex: Table  # (1,) SIMPLEX
    clusters: Table  # (MOST_CLUSTERS,) CLUSTER


def no_geometry() -> Geometry:
    """That of a world which has none yet."""
    return Geometry(
        np.zeros(0, GEOMETRY),
        np.zeros(0, FACE),
        np.zeros((0, 3)),
        np.zeros((0, 6)),
        np.zeros(2, CONVEX),
        np.zeros(1, SIMPLEX),
        np.zeros(MOST_CLUSTERS, CLUSTER),
    )


class SolverWork(NamedTuple):
    """What the contact solver works on: G groups, S spans, B batches, N bodies, M manifolds."""

    groups: Table  # (G,) GROUP
    spans: Table  # (S,) SPAN
    held: Table  # (N,) body rows, those of each group together, then those that no force moves
    body_a: Table  # (8 B,) body rows of each lane
    body_b: Table  # (8 B,)
    slots: Table  # (8 B,) manifold rows
    counts: Table  # (B,) points of the manifold with most
    batches: Table  # float32, see kernels/batch.py
    solver_bodies: Table  # (N + 1,) SOLVER_BODY
    solver: Table  # their flat float32 view
    drives: Table  # (N + 1,) SOLVER_DRIVE
    drive: Table  # their flat float32 view
    manifolds: Table  # (M,) MANIFOLD
    flat_manifolds: Table  # their flat float32 view
    rows: Table  # ROW, what may bounce
    row_points: Table  # ROW_POINT


class Joints(NamedTuple):
    """All that solving joints needs."""

    bodies: Table  # BODY
    rows: Table  # JOINT
    solver_rows: Table  # JOINT_ROW
    groups: Table  # JOINT_GROUP, one for each strength
    parts: Table  # (P,) JOINT_PART
    part_order: Table  # (P,) rows of the awake ones, by strength
    order: Table  # (J,) rows of joints that hold something that can be pushed, by part
    columns: Table  # JOINT_COLUMN, by part
    blocks: Table  # JOINT_BLOCK
    updates: Table  # (U,) rows of blocks
    loads: Table  # (N, 6) room, a row for each body
    rest: Table  # (N, 6) what single precision has left over of the solver's velocities
    turned: Table  # (N, 3) rotation vectors that bodies have turned by since the step began [rad]


def float_place(dtype: np.dtype[Any], field: str) -> int:
    """Where a field of a table stands in a row of the table's flat float32 view."""
    assert dtype.fields is not None
    return dtype.fields[field][1] // 4


def grown(table: Table, count: int) -> Table:
    """The same rows with room for `count`; what is added is zero."""
    larger = np.zeros((count, *table.shape[1:]), table.dtype)
    larger[: len(table)] = table
    return larger
