"""Transforms as columns: each number of all of them in one row, along which numpy is several times quicker than over matrices."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

NEGLIGIBLE: Final = 1e-8  # of the length of an axis, or of the longest for an offset: below what 32 bits tell apart

Columns = NDArray[Any]  # (3, 3, N) or (3, 4, N)


def matrices_of(rotation: NDArray[np.float32]) -> Columns:
    """(3, 3, N) of unit quaternions (N, 4)."""
    x, y, z, w = np.ascontiguousarray(rotation.T, np.float32)
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    matrix = np.empty((3, 3, len(rotation)), np.float32)
    for axis, (first, second) in enumerate(((yy, zz), (xx, zz), (xx, yy))):
        np.subtract(1.0, first, out=matrix[axis, axis])
        matrix[axis, axis] -= second
    np.subtract(xy, wz, out=matrix[0, 1])
    np.add(xz, wy, out=matrix[0, 2])
    np.add(xy, wz, out=matrix[1, 0])
    np.subtract(yz, wx, out=matrix[1, 2])
    np.subtract(xz, wy, out=matrix[2, 0])
    np.add(yz, wx, out=matrix[2, 1])
    return matrix


class FixedTransforms:
    """N transforms that stay, often little more than scales: what is zero, or one, for all of them is not multiplied."""

    def __init__(self, affine: NDArray[np.floating[Any]]) -> None:
        """`affine` (N, 3, 4)."""
        self._columns = np.empty((3, 4, len(affine)), np.float32)
        self.replace(np.arange(len(affine)), affine)

    def replace(self, places: NDArray[np.intp], affine: NDArray[np.floating[Any]]) -> None:
        """Takes others (K, 3, 4) for some of them."""
        size = np.abs(affine)
        axes = size[:, :, :3].max(axis=1, keepdims=True)  # (K, 1, 3)
        largest = np.concatenate([axes, axes.max(axis=2, keepdims=True)], axis=2)
        cleaned = np.where(size > NEGLIGIBLE * largest, affine, 0.0)
        cleaned = np.where(np.abs(cleaned - 1.0) > NEGLIGIBLE, cleaned, 1.0)
        self._columns[:, :, places] = np.moveaxis(cleaned, 0, 2)
        self._is_zero: NDArray[np.bool_] = (self._columns == 0.0).all(axis=2)
        self._is_one: NDArray[np.bool_] = (self._columns == 1.0).all(axis=2)

    @property
    def affine(self) -> NDArray[np.float32]:
        """(N, 3, 4)"""
        return np.moveaxis(self._columns, 2, 0)

    @property
    def offsets_are_none(self) -> bool:
        """Whether none of them moves anything."""
        return bool(self._is_zero[:, 3].all())

    def turned(self, matrix: Columns, *, chosen: NDArray[np.intp] | None = None) -> Columns:
        """Products (3, 4, N) of matrices (3, 3, N) and these, or the chosen of these."""
        columns = self._columns if chosen is None else self._columns[:, :, chosen]
        product = np.empty((3, 4, matrix.shape[2]), np.float32)
        for column in range(4):
            terms = [term for term in range(3) if not self._is_zero[term, column]]
            for row in range(3):
                result = product[row, column]
                if not terms:
                    result[:] = 0.0
                for place, term in enumerate(terms):
                    factor = matrix[row, term]
                    if place:
                        result += factor * columns[term, column]
                    elif self._is_one[term, column]:
                        result[:] = factor
                    else:
                        np.multiply(factor, columns[term, column], out=result)
        return product
