"""The kernels of physics, and how they are compiled ahead: `KERNELS` lists name, function and explicit signatures."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.compilation import signature_of
from elys.sim_node.physics.kernels import tables
from elys.sim_node.physics.kernels.broadphase import find_new_pairs, give_slots, index_pairs, merge_pairs
from elys.sim_node.physics.kernels.integrator import finish_step, publish_poses
from elys.sim_node.physics.kernels.joint_preparation import prepare_joints
from elys.sim_node.physics.kernels.joints import finish_joints
from elys.sim_node.physics.kernels.narrow_phase import update_manifolds
from elys.sim_node.physics.kernels.placement import fatten_boxes, place_colliders, place_inertia
from elys.sim_node.physics.kernels.preparation import prepare_contacts
from elys.sim_node.physics.kernels.queries import cast_rays
from elys.sim_node.physics.kernels.solver import solve_contacts
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.tree import build_tree

Kernel = tuple[str, Any, tuple[tuple[Any, ...], ...]]


def _kernels() -> tuple[Kernel, ...]:
    (
        bodies,
        poses,
        colliders,
        pairs,
        manifolds,
        points,
        rows,
        row_points,
        leaves,
        found,
        constants,
        joints,
        joint_rows,
        columns,
        blocks,
    ) = (
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
            tables.JOINT,
            tables.JOINT_ROW,
            tables.JOINT_COLUMN,
            tables.JOINT_BLOCK,
        )
    )
    indices = np.zeros(1, np.int32)
    entities = np.zeros(1, np.uint32)
    numbers = np.zeros(1)
    nodes = np.zeros((2, 6))
    vectors = np.zeros((1, 3))
    boxes = np.zeros(2, tables.COLLIDER)["box"]
    keys = np.zeros(1, np.int64)
    words = np.zeros((1, 2), np.uint64)
    # The quick ones first, so that a progress bar moves early.
    listed: list[tuple[Any, tuple[Any, ...]]] = [
        (cast_rays, (colliders, leaves, nodes, indices, numbers, vectors, vectors, numbers, indices, numbers, vectors)),
        (hash_bodies, (entities, words)),
        (publish_poses, (bodies, poses)),
        (finish_step, (bodies, poses, indices)),
        (fatten_boxes, (bodies, colliders, constants)),
        (place_colliders, (bodies, colliders)),
        (place_inertia, (bodies, numbers)),
        (build_tree, (boxes, leaves, nodes, indices, numbers, True)),
        (index_pairs, (pairs, 0, indices)),
        (give_slots, (pairs, 0, manifolds, points, indices, indices)),
        (merge_pairs, (colliders, pairs, 0, pairs, 0, pairs, indices, indices, indices)),
        (find_new_pairs, (bodies, colliders, leaves, nodes, pairs, indices, keys, pairs, indices)),
        (prepare_contacts, (bodies, colliders, pairs, indices, 0, manifolds, points, rows, row_points, constants)),
        (update_manifolds, (bodies, colliders, pairs, 0, manifolds, points, found, constants, indices)),
        (prepare_joints, (bodies, joints, joint_rows, 0, nodes, constants)),
        (finish_joints, (bodies, joints, joint_rows, 0, constants, indices)),
        (
            solve_contacts,
            (
                *(bodies, manifolds, points, rows, row_points, 0),
                *(joints, joint_rows, 0, columns, blocks, indices, nodes, constants),
            ),
        ),
    ]
    return tuple((f"physics.{function.__name__}", function, (signature_of(*a),)) for function, a in listed)


KERNELS = _kernels()
