"""What questions are asked with, checked: rays, places, and the shapes that are moved or put there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CONVEX, SPHERE

Array = np.ndarray[Any, Any]

FARTHEST = 1e300  # stands for infinity where differences are taken


class Probes(NamedTuple):
    """Convex shapes to ask with, one for each question or one for all."""

    rows: Array  # (R,) or (1,) CONVEX
    reach: Array  # (R, 3) or (1, 3) half the extents of their axis-aligned boxes [m]


def balls(question: str, radius: ArrayLike, count: int) -> Probes:
    """Balls of radii (R,) or one [m], 0 allowed."""
    r = sizes_of(question, "radius", radius, count, 0)
    rows = _rows(SPHERE, len(r))
    rows["radius"] = r
    return Probes(rows, np.repeat(r[:, None], 3, axis=1))


def boxes(question: str, size: ArrayLike, rotation: ArrayLike, count: int) -> Probes:
    """Boxes of full edge lengths (R, 3) [m], turned by (R, 4)."""
    half = 0.5 * sizes_of(question, "size", size, count, 3)
    turn = rotations_of(question, rotation, count)
    rows = _rows(BOX, max(len(half), len(turn)))
    rows["half_extents"] = half
    rows["axes"] = _axes(turn)
    reach = (abs(rows["axes"].reshape(-1, 3, 3)) * rows["half_extents"][:, :, None]).sum(axis=1)
    return Probes(rows, reach)


def capsules(question: str, radius: ArrayLike, half_length: ArrayLike, rotation: ArrayLike, count: int) -> Probes:
    """Capsules along their y axes: radii and half lengths of the straight part (R,) [m], turned by (R, 4)."""
    r = sizes_of(question, "radius", radius, count, 0)
    half = sizes_of(question, "half_length", half_length, count, 0)
    turn = rotations_of(question, rotation, count)
    rows = _rows(CAPSULE, max(len(r), len(half), len(turn)))
    rows["half_extents"] = np.stack(np.broadcast_arrays(r, half, r), axis=-1)
    rows["axes"] = _axes(turn)
    rows["radius"] = r
    return Probes(rows, rows["radius"][:, None] + rows["half_extents"][:, 1:2] * abs(rows["axes"][:, 3:6]))


def rays_of(
    question: str, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike
) -> tuple[Array, Array, Array]:
    """Origins and unit directions (R, 3) and finite lengths (R,)."""
    start, along = _vectors(question, "origins", origins), _vectors(question, "directions", directions)
    if len(start) != len(along) and 1 not in (len(start), len(along)):
        raise PhysicsError(
            f"{question} takes as many origins as directions, or one of either, not {len(start)} and {len(along)}"
        )
    start, along = (np.ascontiguousarray(a) for a in np.broadcast_arrays(start, along))
    along = along + 0.0  # -0 becomes 0: its inverse is an infinity of the wrong sign
    return start, _units(question, along), limits_of(question, max_distance, len(start))


def _units(question: str, vectors: Array) -> Array:
    """Vectors (R, 3) at length 1; PhysicsError where one has none."""
    squared = np.einsum("ij,ij->i", vectors, vectors)
    if len(squared) == 0 or (squared.min() > 1e-280 and squared.max() < 1e280):
        return vectors / np.sqrt(squared)[:, None]
    # The square of a very long or very short vector is no number of this size: scaled first.
    largest = abs(vectors).max(axis=1, keepdims=True)
    if (largest == 0.0).any():
        raise PhysicsError(f"{question} cannot look along a direction of length 0, as number {largest.argmin()} is")
    scaled = vectors / largest
    return scaled / np.linalg.norm(scaled, axis=1, keepdims=True)


def places_of(question: str, name: str, places: ArrayLike) -> Array:
    """Places (R, 3) [m]."""
    return np.ascontiguousarray(_vectors(question, name, places))


def limits_of(question: str, max_distance: ArrayLike, count: int) -> Array:
    """Farthest distances (R,), infinity as a number that can be calculated with."""
    limits = np.asarray(max_distance, np.float64)
    if limits.shape not in ((), (1,), (count,)):
        raise PhysicsError(f"{question} takes one farthest distance or one for each of {count}, not {limits.shape}")
    if not (limits >= 0.0).all():
        raise PhysicsError(f"{question} takes distances of 0 m or more")
    return np.array(np.broadcast_to(np.minimum(limits, FARTHEST), (count,)))


def sizes_of(question: str, name: str, values: ArrayLike, count: int, width: int) -> Array:
    """Lengths (1,) or (R,), or (1, width) or (R, width), finite and not negative."""
    sizes = np.atleast_2d(np.asarray(values, np.float64)) if width else np.atleast_1d(np.asarray(values, np.float64))
    shapes = ((1, width), (count, width)) if width else ((1,), (count,))
    if sizes.shape not in shapes or not (np.isfinite(sizes).all() and (sizes >= 0.0).all()):
        raise PhysicsError(f"{question} takes one {name} or one for each of {count}, finite and 0 m or more")
    return sizes


def rotations_of(question: str, values: ArrayLike, count: int) -> Array:
    """Unit quaternions (1, 4) or (R, 4)."""
    turns = np.atleast_2d(np.asarray(values, np.float64))
    if turns.shape not in ((1, 4), (count, 4)) or not (abs(np.linalg.norm(turns, axis=1) - 1.0) <= 0.01).all():
        raise PhysicsError(f"{question} takes one rotation or one for each of {count}: unit quaternions x y z w")
    return quaternion.normalize(turns)


def _vectors(question: str, name: str, values: ArrayLike) -> Array:
    try:
        vectors = np.atleast_2d(np.asarray(values, np.float64))
    except (ValueError, TypeError) as error:
        raise PhysicsError(f"{question} takes {name} as numbers of shape (R, 3)") from error
    if vectors.ndim != 2 or vectors.shape[1] != 3 or not np.isfinite(vectors).all():
        raise PhysicsError(f"{question} takes finite {name} of shape (R, 3)")
    return vectors


def _rows(kind: int, count: int) -> Array:
    rows = np.zeros(count, CONVEX)
    rows["kind"] = kind
    rows["scale"] = 1.0
    return rows


def _axes(rotation: Array) -> Array:
    """The axes (N, 9) of turned shapes, one after another."""
    return np.swapaxes(quaternion.to_matrix(rotation), -1, -2).reshape(-1, 9)
