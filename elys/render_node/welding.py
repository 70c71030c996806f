"""Meshes without their corners' repetitions: where only places are drawn, a cube has 8 vertices and not 24."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

LARGEST: Final = 1 << 15  # vertices; larger meshes are drawn once or twice, seldom by thousands, and take long to sort
WORTH_IT: Final = 0.8  # of the vertices are left at most


def welded(
    positions: NDArray[np.float32], indices: NDArray[np.uint32]
) -> tuple[NDArray[np.float32], NDArray[np.uint32]] | None:
    """Positions (K, 3) that all differ, in the order in which they first appear, and the same triangles by them; None where that
    saves little. Equal is what has the same bits.
    """
    if not 0 < len(positions) <= LARGEST:
        return None
    bits = np.ascontiguousarray(positions, np.float32).view(np.uint32)
    order = np.lexsort(bits.T)
    begins = np.append(True, (bits[order[1:]] != bits[order[:-1]]).any(axis=1))
    if begins.sum() > WORTH_IT * len(positions):
        return None
    # The sort is stable: the first of each run of equals is the one that appears first.
    first = order[begins]
    representative = np.empty(len(positions), np.intp)
    representative[order] = first[np.cumsum(begins) - 1]
    kept = np.sort(first)
    return positions[kept], np.searchsorted(kept, representative[indices]).astype(np.uint32)
