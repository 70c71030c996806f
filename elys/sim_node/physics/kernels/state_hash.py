"""One number for the whole state: two simulations that agree in it agree in every bit of every body."""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel

# The multipliers of MurmurHash3 and of splitmix64.
_A = np.uint64(0xFF51AFD7ED558CCD)
_B = np.uint64(0xC4CEB9FE1A85EC53)
_C = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(29)


@inner
def mixed(state, word):
    state = (state ^ word) * _A
    return state ^ (state >> _SHIFT)


@kernel
def hash_bodies(entities, words):
    """Hashes bodies: their ids (N,) and their tables' rows as uint64 (N, W), which begin with position, rotation, velocity."""
    total = _C
    for i in range(entities.shape[0]):
        # Three chains that do not wait for one another.
        row = np.uint64(entities[i]) * _C
        for k in range(3):
            row = mixed(row, words[i, k])
        other = _B
        for k in range(3, 7):
            other = mixed(other, words[i, k])
        third = _A
        for k in range(7, 13):
            third = mixed(third, words[i, k])
        row = mixed(mixed(row, other), third)
        total = (total ^ row) * _B
        total ^= total >> _SHIFT
    return total
