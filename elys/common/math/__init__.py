"""Rotations, transforms and boxes: array functions for many at once, and `poses` for one of a thing in plain floats.

`Aabb` and `Obb` are boxes along the axes and turned ones, for overlap, containment, rays and sweeps.

Of arrays float32 input gives float32 output, everything else is computed in float64.
"""

from elys.common.math.aabb import Aabb
from elys.common.math.obb import Obb
from elys.common.math.slabs import BoxRay, BoxSweep

__all__ = ["Aabb", "BoxRay", "BoxSweep", "Obb"]
