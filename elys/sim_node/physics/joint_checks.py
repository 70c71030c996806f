"""What comes in about joints is checked here, and refused with a sentence that names the joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError

Array = np.ndarray[Any, Any]

# In the order of the constants in kernels/tables.py.
JOINT_KINDS = ("fixed", "ball", "hinge", "slider", "distance", "cone_twist", "gear", "motor")


def joint_named(joint: int) -> str:
    """How a joint is called in a sentence."""
    return f"joint {int(joint)}"


def joint_column(joints: ArrayLike) -> Array:
    """Joint ids as an (M,) uint32 array; PhysicsError when one is 0 or comes twice."""
    column = np.atleast_1d(np.asarray(joints))
    if column.ndim != 1 or (column.size and column.dtype.kind not in "iu"):
        raise PhysicsError(f"Joints must be a row of ids, not an array of shape {column.shape} and {column.dtype}")
    if column.size and (column.min() <= 0 or column.max() >= 2**32):
        raise PhysicsError("A joint's id must be from 1 to 2^32 - 1")
    values, counts = np.unique(column, return_counts=True)
    if (counts > 1).any():
        raise PhysicsError(f"{joint_named(values[counts > 1][0])} is named twice: name each joint once")
    return column.astype(np.uint32)


def kind_column(kind: str | Sequence[str], joints: Array) -> Array:
    """Names of kinds as (M,) uint8."""
    names = [kind] * len(joints) if isinstance(kind, str) else list(kind)
    if len(names) != len(joints):
        raise PhysicsError(f"kind must be one name or a row of {len(joints)}, not {len(names)}")
    for joint, name in zip(joints, names, strict=True):
        if name not in JOINT_KINDS:
            raise PhysicsError(
                f"{joint_named(joint)} has the kind {name!r}: it must be one of {', '.join(JOINT_KINDS)}"
            )
    return np.array([JOINT_KINDS.index(name) for name in names], np.uint8)


class JointNumbers:
    """Checks values for joints, one for all or a row for each, and names the joint with a bad one."""

    def __init__(self, joints: Array) -> None:
        self._joints = joints

    def number(
        self,
        name: str,
        values: ArrayLike,
        *,
        width: int = 0,
        minimum: float | None = None,
        maximum: float | None = None,
        infinite: bool = False,
    ) -> Array:
        """Values as float64 (M,) or (M, width).

        Raises:
            PhysicsError: a value is not a number, not finite (unless `infinite`), or out of its range.
        """
        shape = (len(self._joints), width) if width else (len(self._joints),)
        try:
            column = np.array(np.broadcast_to(np.asarray(values, np.float64), shape))
        except (ValueError, TypeError) as error:
            raise PhysicsError(f"{name} must be numbers of shape {shape}, not {np.shape(values)}") from error
        flat = column.reshape(len(self._joints), -1)
        self.refuse((np.isnan(flat) if infinite else ~np.isfinite(flat)).any(1), column, f"{name} must be finite")
        if minimum is not None:
            self.refuse((flat < minimum).any(1), column, f"{name} must be at least {minimum:g}")
        if maximum is not None:
            self.refuse((flat > maximum).any(1), column, f"{name} must be at most {maximum:g}")
        return column

    def axis(self, name: str, values: ArrayLike) -> Array:
        """Directions of any length but 0 as unit vectors (M, 3)."""
        column = self.number(name, values, width=3)
        length = np.linalg.norm(column, axis=1)
        self.refuse(length < 1e-9, column, f"{name} must have a length")
        return np.asarray(column / length[:, None])

    def rotation(self, name: str, values: ArrayLike) -> Array:
        """Unit quaternions (M, 4)."""
        column = self.number(name, values, width=4)
        length = np.linalg.norm(column, axis=1)
        self.refuse(abs(length - 1.0) > 0.01, column, f"{name} must be a unit quaternion x y z w")
        return np.asarray(column / length[:, None])

    def refuse(self, bad: Any, values: Array, rule: str) -> None:
        """Raises PhysicsError for the first joint that is `bad`."""
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise PhysicsError(
                f"{rule}: {joint_named(self._joints[first])} has {np.array2string(values[first], precision=6)}"
            )
