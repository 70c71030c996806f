"""Whole rows of tables, copied as bytes: numpy copies structured rows field by field, which takes ten times as long."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def joined_rows(first: Array, second: Array) -> Array:
    """The rows of two tables of one dtype (N,) and (M,), one after the other."""
    whole = np.empty(len(first) + len(second), first.dtype)
    _as_bytes(whole)[: len(first)] = _as_bytes(first)
    _as_bytes(whole)[len(first) :] = _as_bytes(second)
    return whole


def picked_rows(table: Array, rows: Array) -> Array:
    """The rows of a table (N,) that `rows` (M,) names, a copy."""
    return np.asarray(np.take(_as_bytes(table), rows, axis=0).view(table.dtype))


def kept_rows(table: Array, rows: slice | Array) -> Array:
    """The rows of a table (N,) in a slice or named by (M,), a copy."""
    return np.asarray(_as_bytes(table)[rows].copy().view(table.dtype))


def copied_rows(table: Array) -> Array:
    """A copy of a table (N,)."""
    return np.frombuffer(bytearray(table.tobytes()), table.dtype).reshape(table.shape)


def _as_bytes(table: Array) -> Array:
    """A view with one opaque number for each row."""
    return table.view(f"V{table.dtype.itemsize}")
