"""What comes into physics from outside is checked here, once, and refused with a sentence that names the entity."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.ids import MAX_ENTITIES, generation_of, index_of

Array = np.ndarray[Any, Any]


def named(entity: int) -> str:
    """How an entity is called in a sentence."""
    generation = generation_of(int(entity))
    again = f" (generation {generation})" if generation else ""
    return f"entity {index_of(int(entity))}{again}"


def entity_column(entities: ArrayLike, *, unique: bool = True) -> Array:
    """Entity ids as an (N,) uint32 array; PhysicsError when one is 0 or, with `unique`, comes twice."""
    column = np.atleast_1d(np.asarray(entities))
    if column.ndim != 1 or (column.size and column.dtype.kind not in "iu"):
        raise PhysicsError(f"Entities must be a row of ids, not an array of shape {column.shape} and {column.dtype}")
    if column.size and (column.min() <= 0 or column.max() >= 2**32):
        raise PhysicsError("An entity id must be from 1 to 2^32 - 1; 0 is nobody")
    column = column.astype(np.uint32)
    if unique and len(np.unique(column)) != len(column):
        values, counts = np.unique(column, return_counts=True)
        raise PhysicsError(f"{named(values[counts > 1][0])} is named twice: name each entity once")
    return column


def number_column(
    name: str, values: ArrayLike, entities: Array, *, width: int = 0, minimum: float | None = None, above: bool = False
) -> Array:
    """Values for each entity as float64 (N,) or (N, width); one value is taken for all.

    Raises:
        PhysicsError: a value is not finite, below the minimum (or not above it, with `above`), or the shape does not fit.
    """
    shape = (len(entities), width) if width else (len(entities),)
    try:
        column = np.array(np.broadcast_to(np.asarray(values, np.float64), shape))
    except (ValueError, TypeError) as error:
        raise PhysicsError(f"{name} must be numbers of shape {shape}, not {np.shape(values)}") from error
    flat = column.reshape(len(entities), max(width, 1))
    refuse(~np.isfinite(flat).all(1), entities, column, f"{name} must be finite")
    if minimum is not None:
        bad = (flat <= minimum).any(1) if above else (flat < minimum).any(1)
        refuse(bad, entities, column, f"{name} must be {'above' if above else 'at least'} {minimum:g}")
    return column


def rotation_column(name: str, values: ArrayLike, entities: Array) -> Array:
    """Quaternions as float64 (N, 4) of unit length.

    Raises:
        PhysicsError: a quaternion is not finite or far from unit length.
    """
    column = number_column(name, values, entities, width=4)
    length = np.linalg.norm(column, axis=1)
    refuse(abs(length - 1.0) > 0.01, entities, column, f"{name} must be a unit quaternion x y z w")
    # Already of unit length to the last bit but one: left alone, so that a pose written back is the same pose.
    scale = np.where(abs(length - 1.0) < 4e-16, 1.0, length)
    return column / scale[:, None]


def choice_column(name: str, values: ArrayLike, entities: Array, count: int) -> Array:
    """Small whole numbers from 0 to count - 1 as (N,) uint8."""
    column = np.broadcast_to(np.asarray(values), (len(entities),))
    refuse((column < 0) | (column >= count), entities, column, f"{name} must be from 0 to {count - 1}")
    return column.astype(np.uint8)


def switch_column(name: str, values: ArrayLike, entities: Array, width: int) -> Array:
    """Truth values (N, width), or one row for all, as bits (N,) uint8; the first is the lowest bit."""
    column = np.asarray(values)
    if column.dtype != np.bool_ or column.shape not in ((width,), (len(entities), width)):
        raise PhysicsError(
            f"{name} must be {width} truth values for each entity, not an array of shape {column.shape} and {column.dtype}"
        )
    return np.asarray((np.broadcast_to(column, (len(entities), width)) << np.arange(width)).sum(1), np.uint8)


def inertia_column(values: ArrayLike, mass: Array, entities: Array) -> Array:
    """Moments of inertia about an entity's axes (N, 3) [kg m^2], for 1 kg each; PhysicsError where no body can have them."""
    moments = number_column("inertia", values, entities, width=3, minimum=0.0, above=True)
    excess = 2.0 * moments.max(1) - moments.sum(1)
    rule = "inertia breaks the triangle inequality: each moment must be at most the sum of the two others"
    refuse(excess > 1e-9 * moments.sum(1), entities, moments, rule)
    return np.asarray(moments / mass[:, None])


def bits_column(name: str, values: ArrayLike, entities: Array) -> Array:
    """Sets of 32 layers as bits, (N,) uint32."""
    column = np.broadcast_to(np.asarray(values), (len(entities),))
    if column.dtype.kind not in "iu":
        raise PhysicsError(f"{name} must be whole numbers whose bits are layers, not {column.dtype}")
    wide = column.astype(np.int64)
    refuse((wide < 0) | (wide >= 2**32), entities, wide, f"{name} must be from 0 to 2^32 - 1, a bit for each layer")
    return wide.astype(np.uint32)


def refuse(bad: Any, entities: Array, values: Array, rule: str) -> None:
    """Raises PhysicsError for the first element that is `bad`."""
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        more = int(bad.sum()) - 1
        others = f" (and {more} more)" if more else ""
        raise PhysicsError(
            f"{rule}: {named(entities[first])} has {np.array2string(values[first], precision=6)}{others}"
        )


def index_column(entities: Array) -> Array:
    """The places in the tables that ids (N,) name."""
    return np.asarray(entities & MAX_ENTITIES)


def saved_table(snapshot: dict[str, Array], name: str, dtype: np.dtype[Any]) -> Array:
    """A copy of one table of a snapshot; PhysicsError when it is not there or laid out otherwise."""
    table = snapshot.get(name)
    if table is None or table.dtype != dtype:
        raise PhysicsError(
            f"This is not a snapshot of this version: its table {name!r} is missing or of another layout"
        )
    # Of the very dtype asked for: what was read from a file says the same of its layout in other words.
    return np.frombuffer(bytearray(table.tobytes()), dtype)
