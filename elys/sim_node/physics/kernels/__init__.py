"""The kernels of physics, and how they are compiled ahead: name, function and explicit signatures.

`KERNELS` are compiled before the first step, `LATER_KERNELS` when they are first called; a wheel carries all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.compilation import signature_of
from elys.sim_node.physics.kernels import tables
from elys.sim_node.physics.kernels.broadphase import find_pairs
from elys.sim_node.physics.kernels.cast import TOUCH
from elys.sim_node.physics.kernels.colouring import colour_contacts
from elys.sim_node.physics.kernels.events import describe_contacts, track_contacts, track_triggers
from elys.sim_node.physics.kernels.groups import form_groups
from elys.sim_node.physics.kernels.integrator import finish_step, publish_poses
from elys.sim_node.physics.kernels.islands import build_islands
from elys.sim_node.physics.kernels.joint_preparation import prepare_joints
from elys.sim_node.physics.kernels.joints import finish_joints
from elys.sim_node.physics.kernels.measuring import measure_joints, measure_step, sleeping_potential
from elys.sim_node.physics.kernels.narrow_phase import update_manifolds, update_simple_manifolds
from elys.sim_node.physics.kernels.nearby import find_closest, find_overlaps
from elys.sim_node.physics.kernels.overlaps import find_deep_overlaps
from elys.sim_node.physics.kernels.pair_list import compare_pairs, enter_pairs, list_pairs
from elys.sim_node.physics.kernels.placement import fatten_boxes, place_colliders
from elys.sim_node.physics.kernels.preparation import prepare_bodies, prepare_impacts
from elys.sim_node.physics.kernels.queries import cast_rays, cast_shapes
from elys.sim_node.physics.kernels.query_tree import QUERY_NODE, build_query_tree, refit_query_tree
from elys.sim_node.physics.kernels.sleeping import list_awake, put_to_sleep, wake_marked
from elys.sim_node.physics.kernels.solver import (
    solve_contacts,
    solve_jointed_contacts,
    solve_shared_contacts,
    solve_shared_jointed_contacts,
)
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.sweep import stop_at_impacts
from elys.sim_node.physics.kernels.team import new_team
from elys.sim_node.physics.kernels.tree import build_tree
from elys.sim_node.physics.kernels.wide_tree import build_wide_tree, refit_wide_tree

Kernel = tuple[str, Any, tuple[tuple[Any, ...], ...]]


# What only some worlds need, joints and several threads with the solver anew, and what only questions need: compiled when it
# is first called.
LATER: tuple[Any, ...] = (
    update_manifolds,
    stop_at_impacts,
    cast_rays,
    cast_shapes,
    find_overlaps,
    find_closest,
    build_query_tree,
    refit_query_tree,
    track_triggers,
    describe_contacts,
    prepare_joints,
    finish_joints,
    measure_joints,
    solve_jointed_contacts,
    solve_shared_contacts,
    solve_shared_jointed_contacts,
)

# What a step calls, with tables of its own alone, each time with the same types: called without a look at them.
DIRECT: tuple[Any, ...] = (
    place_colliders,
    fatten_boxes,
    update_simple_manifolds,
    update_manifolds,
    build_islands,
    form_groups,
    colour_contacts,
    prepare_bodies,
    prepare_impacts,
    solve_contacts,
    solve_jointed_contacts,
    track_contacts,
    finish_step,
    put_to_sleep,
    measure_step,
    measure_joints,
)


def _kernels() -> tuple[Kernel, ...]:
    bodies, poses, colliders, pairs, manifolds, rows, row_points, leaves, found, constants, groups, spans, strengths = (
        np.zeros(1, dtype)
        for dtype in (
            tables.BODY,
            tables.POSE,
            tables.COLLIDER,
            tables.PAIR,
            tables.MANIFOLD,
            tables.ROW,
            tables.ROW_POINT,
            tables.TREE_LEAF,
            tables.FOUND,
            tables.CONSTANTS,
            tables.GROUP,
            tables.SPAN,
            tables.STRENGTH,
        )
    )
    solver, drives = np.zeros(1, tables.SOLVER_BODY), np.zeros(1, tables.SOLVER_DRIVE)
    geometry = tables.no_geometry()
    starts, proxies = np.zeros(1, tables.START), np.zeros(1, tables.PROXY)
    forces, reports = np.zeros(1, tables.FORCE), np.zeros(1, tables.STEP_REPORT)
    islands = np.zeros(1, tables.ISLAND)
    glances, measures = np.zeros(1, tables.GLANCE), np.zeros(1, tables.MEASURES)
    indices = np.zeros(1, np.int32)
    entities = np.zeros(1, np.uint32)
    masks = np.zeros(1, np.uint64)
    numbers = np.zeros(1)
    floats = np.zeros(1, np.float32)
    nodes = np.zeros((2, 6))
    vectors = np.zeros((1, 3))
    boxes = np.zeros(2, tables.PROXY)["fat_box"]
    words = np.zeros((1, 2), np.uint64)
    touching = (bodies, colliders, pairs, indices, 0, manifolds)
    touches, meetings = np.zeros(1, tables.TOUCH), np.zeros(1, tables.MEETING)
    lanes = (indices, indices, indices, indices)
    flags = np.zeros(1, np.uint8)
    places = np.zeros(1, np.int64)
    query_nodes = np.zeros(1, QUERY_NODE)
    walk = (indices, np.zeros(1, np.float32))
    rays = (vectors, vectors, numbers)
    probes = (np.zeros(1, tables.CONVEX), vectors, np.zeros(1, TOUCH))
    answer = (places, indices, entities, numbers, vectors, vectors)
    links = np.zeros((1, 2), np.int32)
    work = tables.SolverWork(
        *(groups, spans, indices, *lanes, floats, solver, floats, drives, floats),
        *(manifolds, floats, rows, row_points),
    )
    joints = tables.Joints(
        bodies,
        np.zeros(1, tables.JOINT),
        np.zeros(1, tables.JOINT_ROW),
        np.zeros(1, tables.JOINT_GROUP),
        np.zeros(1, tables.JOINT_PART),
        indices,
        indices,
        np.zeros(1, tables.JOINT_COLUMN),
        np.zeros(1, tables.JOINT_BLOCK),
        indices,
        np.zeros((1, 6)),
        np.zeros((1, 6)),
        vectors,
    )
    # The quick ones first, so that a progress bar moves early.
    listed: list[tuple[Any, tuple[Any, ...]]] = [
        (refit_query_tree, (boxes, query_nodes)),
        (build_query_tree, (boxes, query_nodes, indices, nodes, numbers)),
        (
            cast_rays,
            (colliders, geometry, query_nodes, flags, indices, *walk, *rays, True, *answer),
        ),
        (cast_shapes, (colliders, geometry, query_nodes, flags, indices, *walk, *rays, *probes, True, *answer)),
        (
            find_overlaps,
            (colliders, geometry, query_nodes, flags, indices, indices, vectors, *probes[:2], places, indices),
        ),
        (
            find_closest,
            (colliders, geometry, query_nodes, flags, indices, indices, numbers, vectors, numbers, *answer[1:]),
        ),
        (hash_bodies, (entities, words)),
        (publish_poses, (bodies, poses)),
        (finish_step, (bodies, forces, indices, 0, poses, starts, solver, indices, reports, numbers, constants)),
        (
            stop_at_impacts,
            (bodies, colliders, pairs, indices, 0, starts, numbers, poses, bodies, colliders, geometry, constants),
        ),
        (track_contacts, (*touching, solver, touches, meetings, constants)),
        (describe_contacts, (*touching, touches)),
        (
            track_triggers,
            (bodies, colliders, pairs, indices, 0, starts, numbers, bodies, colliders, geometry, meetings, meetings),
        ),
        (fatten_boxes, (bodies, colliders, proxies, indices, 0, indices, constants)),
        (place_colliders, (bodies, colliders, indices, 0, geometry)),
        (build_tree, (boxes, leaves, nodes, indices, numbers, True)),
        (build_wide_tree, (boxes, leaves, indices, floats, indices, 0, indices, numbers, True)),
        (refit_wide_tree, (boxes, indices, 0, indices, floats, indices, 0)),
        (list_pairs, (bodies, colliders, pairs, True, indices, indices)),
        (
            compare_pairs,
            (pairs, 0, indices, 0, flags, pairs, manifolds, indices, 0, indices, 0, indices, indices, indices),
        ),
        (enter_pairs, (pairs, 0, indices, pairs, manifolds, indices, 0, indices, indices)),
        (find_deep_overlaps, (*touching, indices, numbers)),
        (
            find_pairs,
            (
                *(colliders, proxies, indices, 0, flags, leaves, indices, floats, indices, 0),
                *(flags, indices, indices, geometry, places, pairs, pairs, indices),
            ),
        ),
        (sleeping_potential, (bodies, numbers, constants)),
        (
            measure_step,
            (
                *(bodies, numbers, vectors, indices, 0, True, indices, True, *touching[1:4], 0, 0, 0, manifolds),
                *(numbers, glances, measures, constants),
            ),
        ),
        (list_awake, (bodies, colliders, proxies, indices, indices)),
        (wake_marked, (bodies,)),
        (put_to_sleep, (bodies, poses, indices, 0, indices, islands, indices, constants)),
        (build_islands, (bodies, indices, 0, *touching[1:], links, indices, islands, strengths, constants, True)),
        (form_groups, (bodies, indices, 0, 0, indices, islands, 0, groups, indices, indices, indices)),
        (colour_contacts, (*touching, indices, masks, indices, indices, indices, indices, groups, spans, *lanes)),
        (prepare_bodies, (bodies, forces, indices, 0, groups, solver, drives, strengths, constants)),
        (prepare_impacts, (*touching, rows, row_points, indices, groups, solver, drives, constants)),
        (
            update_simple_manifolds,
            (bodies, colliders, proxies, pairs, indices, 0, indices, numbers, manifolds, found, constants, *lanes),
        ),
        (
            update_manifolds,
            (
                bodies,
                colliders,
                proxies,
                pairs,
                indices,
                0,
                indices,
                numbers,
                manifolds,
                found,
                geometry,
                constants,
                *lanes,
            ),
        ),
        (solve_contacts, (work, 0, strengths, constants)),
    ]
    team = new_team()
    listed += [
        (prepare_joints, (joints, drives, strengths)),
        (finish_joints, (joints, solver, constants, indices)),
        (measure_joints, (bodies, joints.rows, numbers, measures)),
        (solve_jointed_contacts, (work, 0, joints, strengths, constants)),
        (solve_shared_contacts, (work, 0, strengths, constants, team, 0, 1)),
        (solve_shared_jointed_contacts, (work, 0, joints, strengths, constants, team, 0, 1)),
    ]
    return tuple((f"physics.{function.__name__}", function, (signature_of(*given),)) for function, given in listed)


_ALL = _kernels()
KERNELS = tuple(entry for entry in _ALL if entry[1] not in LATER)
LATER_KERNELS = tuple(entry for entry in _ALL if entry[1] in LATER)

for _, _function, _signatures in _ALL:
    if _function in DIRECT:
        _function.direct_signature = _signatures[0]
