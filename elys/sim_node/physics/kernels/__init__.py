"""The kernels of physics, and how they are compiled ahead: `KERNELS` lists name, function and explicit signatures."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.compilation import signature_of
from elys.sim_node.physics.kernels import tables
from elys.sim_node.physics.kernels.broadphase import change_pairs, find_new_pairs, list_active_pairs
from elys.sim_node.physics.kernels.cast import TOUCH
from elys.sim_node.physics.kernels.colouring import colour_contacts
from elys.sim_node.physics.kernels.events import describe_contacts, track_contacts, track_triggers
from elys.sim_node.physics.kernels.integrator import finish_step, publish_poses
from elys.sim_node.physics.kernels.islands import build_islands, list_held
from elys.sim_node.physics.kernels.narrow_phase import update_manifolds
from elys.sim_node.physics.kernels.nearby import find_closest, find_overlaps
from elys.sim_node.physics.kernels.pair_table import fill_table
from elys.sim_node.physics.kernels.placement import fatten_boxes, place_colliders
from elys.sim_node.physics.kernels.preparation import prepare_bodies, prepare_contacts, prepare_impacts
from elys.sim_node.physics.kernels.queries import cast_rays, cast_shapes
from elys.sim_node.physics.kernels.query_tree import QUERY_NODE, build_query_tree, refit_query_tree
from elys.sim_node.physics.kernels.sleeping import list_awake, put_to_sleep, wake_marked
from elys.sim_node.physics.kernels.solver import solve_contacts
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.sweep import stop_at_impacts
from elys.sim_node.physics.kernels.tree import build_tree, refit_tree

Kernel = tuple[str, Any, tuple[tuple[Any, ...], ...]]


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
    geometry = tables.Geometry(
        np.zeros(1, tables.GEOMETRY),
        np.zeros(1, tables.FACE),
        np.zeros((1, 3)),
        np.zeros((2, 6)),
        np.zeros(2, tables.CONVEX),
        np.zeros(1, tables.SIMPLEX),
        np.zeros(1, tables.CLUSTER),
    )
    starts = np.zeros(1, tables.START)
    islands = np.zeros(1, tables.ISLAND)
    indices = np.zeros(1, np.int32)
    entities = np.zeros(1, np.uint32)
    masks = np.zeros(1, np.uint64)
    numbers = np.zeros(1)
    floats = np.zeros(1, np.float32)
    nodes = np.zeros((2, 6))
    vectors = np.zeros((1, 3))
    boxes = np.zeros(2, tables.COLLIDER)["box"]
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
        (finish_step, (bodies, indices, 0, poses, starts, solver, indices, constants)),
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
        (fatten_boxes, (bodies, colliders, indices, 0, indices, constants)),
        (place_colliders, (bodies, colliders, indices, 0)),
        (build_tree, (boxes, leaves, indices, nodes, indices, numbers, True)),
        (refit_tree, (boxes, indices, 0, leaves, indices, nodes)),
        (fill_table, (pairs, indices)),
        (list_active_pairs, (bodies, colliders, pairs, indices, indices)),
        (
            change_pairs,
            (colliders, indices, 0, geometry, pairs, manifolds, indices, indices, 0, pairs, 0, *lanes),
        ),
        (find_new_pairs, (bodies, colliders, indices, 0, leaves, nodes, geometry, pairs, indices, pairs, indices)),
        (list_awake, (bodies, colliders, indices, indices)),
        (wake_marked, (bodies,)),
        (put_to_sleep, (bodies, poses, indices, 0, indices, islands, indices, constants)),
        (build_islands, (bodies, indices, 0, *touching[1:], indices, islands, strengths, constants)),
        (list_held, (bodies, indices, 0, indices, groups)),
        (colour_contacts, (*touching, masks, indices, indices, indices, indices, groups, spans, *lanes)),
        (prepare_bodies, (bodies, indices, 0, groups, solver, drives, strengths, constants)),
        (prepare_contacts, (groups, spans, *lanes, floats, floats, floats, floats, strengths, constants)),
        (prepare_impacts, (*touching, rows, row_points, groups, solver, drives, constants)),
        (update_manifolds, (bodies, colliders, pairs, indices, 0, manifolds, found, geometry, constants, *lanes)),
        (
            solve_contacts,
            (
                *(groups, spans, indices, 0, *lanes, floats, solver, floats, drives, floats),
                *(manifolds, floats, rows, row_points, strengths, constants),
            ),
        ),
    ]
    return tuple((f"physics.{function.__name__}", function, (signature_of(*a),)) for function, a in listed)


KERNELS = _kernels()
