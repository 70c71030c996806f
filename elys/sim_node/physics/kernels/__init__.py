"""The kernels of physics, and how they are compiled ahead: `KERNELS` lists name, function and explicit signatures."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.compilation import signature_of
from elys.sim_node.physics.kernels import tables
from elys.sim_node.physics.kernels.broadphase import find_new_pairs, give_slots, index_pairs, merge_pairs
from elys.sim_node.physics.kernels.cast import TOUCH
from elys.sim_node.physics.kernels.integrator import finish_step, publish_poses
from elys.sim_node.physics.kernels.narrow_phase import update_manifolds
from elys.sim_node.physics.kernels.nearby import find_closest, find_overlaps
from elys.sim_node.physics.kernels.placement import fatten_boxes, place_colliders, place_inertia
from elys.sim_node.physics.kernels.preparation import prepare_contacts
from elys.sim_node.physics.kernels.queries import cast_rays, cast_shapes
from elys.sim_node.physics.kernels.query_tree import QUERY_NODE, build_query_tree, refit_query_tree
from elys.sim_node.physics.kernels.solver import solve_contacts
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.tree import build_tree

Kernel = tuple[str, Any, tuple[tuple[Any, ...], ...]]


def _kernels() -> tuple[Kernel, ...]:
    bodies, poses, colliders, pairs, manifolds, points, rows, row_points, leaves, found, constants = (
        np.zeros(1, dtype)
        for dtype in (
            tables.BODY,
            tables.POSE,
            tables.COLLIDER,
            tables.PAIR,
            tables.MANIFOLD,
            tables.MANIFOLD_POINT,
            tables.ROW,
            tables.ROW_POINT,
            tables.TREE_LEAF,
            tables.FOUND,
            tables.CONSTANTS,
        )
    )
    geometry = tables.Geometry(
        np.zeros(1, tables.GEOMETRY),
        np.zeros(1, tables.FACE),
        np.zeros((1, 3)),
        np.zeros((2, 6)),
        np.zeros(2, tables.CONVEX),
        np.zeros(1, tables.SIMPLEX),
    )
    indices = np.zeros(1, np.int32)
    entities = np.zeros(1, np.uint32)
    numbers = np.zeros(1)
    nodes = np.zeros((2, 6))
    vectors = np.zeros((1, 3))
    boxes = np.zeros(2, tables.COLLIDER)["box"]
    words = np.zeros((1, 2), np.uint64)
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
        (finish_step, (bodies, poses, indices)),
        (fatten_boxes, (bodies, colliders, constants)),
        (place_colliders, (bodies, colliders)),
        (place_inertia, (bodies, numbers)),
        (build_tree, (boxes, leaves, nodes, indices, numbers, True)),
        (index_pairs, (pairs, 0, indices)),
        (give_slots, (pairs, 0, manifolds, points, indices, indices)),
        (merge_pairs, (colliders, geometry, pairs, 0, pairs, 0, pairs, indices, indices, indices)),
        (find_new_pairs, (bodies, colliders, leaves, nodes, geometry, pairs, indices, pairs, indices)),
        (prepare_contacts, (bodies, colliders, pairs, indices, 0, manifolds, points, rows, row_points, constants)),
        (update_manifolds, (bodies, colliders, pairs, 0, manifolds, points, found, geometry, constants, indices)),
        (solve_contacts, (bodies, manifolds, points, rows, row_points, 0, constants)),
    ]
    return tuple((f"physics.{function.__name__}", function, (signature_of(*a),)) for function, a in listed)


KERNELS = _kernels()
