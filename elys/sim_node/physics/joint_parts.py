"""Which joints feel one another: those that hang together by bodies that can be pushed, or by gears.

What is fixed at both ends hangs on nothing, and two doors in one wall do not feel each other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def parts_of(bodies: Array, holds: Array, gears: Array, geared: Array) -> Array:
    """The part (J,) of each joint, numbered in the order of their first joints; -1 for what pushes nothing.

    Parameters: bodies (J, 2) are body rows, -1 for what cannot be pushed; holds (J,) is false where a joint is broken;
    gears (J,) is true for gears, which couple the joints in rows geared (J, 2).
    """
    parent = list(range(len(bodies)))

    def root(j: int) -> int:
        while parent[j] != j:
            parent[j] = parent[parent[j]]
            j = parent[j]
        return j

    def join(j: int, k: int) -> None:
        j, k = root(j), root(k)
        parent[max(j, k)] = min(j, k)

    pushes = holds & ~gears & (bodies >= 0).any(1)
    first_on: dict[int, int] = {}
    for j in np.flatnonzero(pushes).tolist():
        for body in bodies[j].tolist():
            if body >= 0:
                join(j, first_on.setdefault(body, j))
    couples = holds & gears & pushes[geared].all(1)
    for j in np.flatnonzero(couples).tolist():
        for k in geared[j].tolist():
            join(j, k)
    part = np.full(len(bodies), -1)
    member = np.flatnonzero(pushes | couples)
    part[member] = np.unique([root(j) for j in member.tolist()], return_inverse=True)[1]
    return part


def ranges_of(part: Array, count: int) -> tuple[Array, Array]:
    """Where each of `count` parts begins and ends in a list that is sorted by part."""
    numbers = np.arange(count)
    return np.searchsorted(part, numbers, "left"), np.searchsorted(part, numbers, "right")
