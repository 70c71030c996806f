"""What the numbers of a batch's instances leave out of its shaders: terms that are zero for all of them are not compiled in."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

METALLIC: Final = "METALLIC"  # somebody is
GLOWING: Final = "GLOWING"  # somebody is emissive
EVEN_SCALE: Final = (
    "EVEN_SCALE"  # nobody is stretched more along one way than along another: normals go as directions do
)
EVEN_ENOUGH: Final = 1e-4  # of the squared scale: normals then are 3e-5 rad off

Terms = tuple[str, ...]


def terms_of_batches(
    first: NDArray[np.intp], surface: NDArray[np.float32], is_even: NDArray[np.bool_]
) -> tuple[Terms, ...]:
    """Definitions for each batch of consecutive instances, of which `first` (B,) begins it, given the numbers (M, 3, 4) of their
    materials as `instance.glsl` has them, and who of them (M,) is scaled evenly.
    """
    if not len(first):
        return ()
    red, green, blue = surface[:, 1, :3].T != 0.0
    found = {
        METALLIC: np.logical_or.reduceat(surface[:, 2, 0] != 0.0, first),
        GLOWING: np.logical_or.reduceat(red | green | blue, first),
        EVEN_SCALE: np.logical_and.reduceat(is_even, first),
    }
    return tuple(tuple(term for term, holds in found.items() if holds[batch]) for batch in range(len(first)))


def evenly_scaled(linear: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Which of N transforms (N, 3, 3) scale by the same number along all ways, as multiples of rotations and reflections do."""
    gram = np.einsum("nki,nkj->nij", linear, linear)
    squared = np.einsum("nii->n", gram) / 3.0
    gram[:, range(3), range(3)] -= squared[:, None]
    return np.asarray(np.abs(gram).max(axis=(1, 2), initial=0.0) <= EVEN_ENOUGH * squared)
