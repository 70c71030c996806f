"""Rays into a world. Asking changes nothing: the tree for it is not the one that finds pairs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.sim_node.physics.contacts import BoxTree
from elys.sim_node.physics.kernels.placement import place_colliders
from elys.sim_node.physics.kernels.queries import cast_rays
from elys.sim_node.physics.states import RayHits

Array = np.ndarray[Any, Any]

_FARTHEST = 1e300  # stands for infinity where differences are taken


def query_tree(bodies: Array, colliders: Array) -> BoxTree:
    """A tree over the colliders' boxes as they are now. Their places are brought up to date, as the next step would."""
    place_colliders(bodies, colliders)
    tree = BoxTree(len(colliders))
    tree.build(colliders["box"], 0)
    return tree


def raycast(
    colliders: Array, tree: BoxTree, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike
) -> RayHits:
    """The first collider that each ray meets; see PhysicsWorld.raycast."""
    start, along = _rays(origins, directions)
    count = len(start)
    limits = np.minimum(np.broadcast_to(np.asarray(max_distance, np.float64), (count,)), _FARTHEST)
    if not (limits >= 0.0).all():
        raise PhysicsError("raycast takes distances of 0 m or more")
    hit = np.full(count, -1, np.int32)
    distance = np.full(count, np.inf)
    normal = np.zeros((count, 3))
    if len(colliders):
        walk = (tree.leaves, tree.nodes, tree.stack, tree.entries)
        cast_rays(colliders, *walk, start, along, limits, hit, distance, normal)
    entity = np.zeros(count, np.uint32)
    entity[hit >= 0] = colliders["entity"][hit[hit >= 0]]
    return RayHits(entity, distance, normal)


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[Array, Array]:
    """Origins and unit directions (R, 3), checked."""
    try:
        start, along = np.broadcast_arrays(
            np.atleast_2d(np.asarray(origins, np.float64)), np.atleast_2d(np.asarray(directions, np.float64))
        )
    except ValueError as error:
        raise PhysicsError("raycast takes as many origins as directions, or one of either") from error
    if start.ndim != 2 or start.shape[1] != 3 or not (np.isfinite(start).all() and np.isfinite(along).all()):
        raise PhysicsError("raycast takes finite origins and directions of shape (R, 3)")
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if (length == 0.0).any():
        raise PhysicsError("raycast cannot look along a direction of length 0")
    return np.ascontiguousarray(start), np.ascontiguousarray(along / length)
