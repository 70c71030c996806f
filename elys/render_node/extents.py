"""How large instances are: boxes in their own space, spheres around them, and whose middles are not where they stand."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.batch_terms import evenly_scaled
from elys.render_node.drawable_assets import UNKNOWN_EXTENT, DrawableAssets
from elys.render_node.instances import Instances
from elys.render_node.scene_tables import Rows

_CORNER_SIGNS: Final = np.array([(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)], np.float64)


class Extents:
    """Of M instances.

    Attributes:
        lower, upper: corners [M, 3] f32 m of boxes in the instances' own space. radius: [M] f32 m around their middles.
        is_measured: [M] whether the size of the mesh is known. is_even: [M] scaled by the same along all ways, at rest.
        aside: rows of those whose boxes are not around their origins, with their `middle` (A, 3).
    """

    def __init__(self, instances: Instances, linear: NDArray[np.float64], assets: DrawableAssets) -> None:
        """`linear` (M, 3, 3): their rotations and scales at rest."""
        found, of_batch = [assets.extent_of(batch.mesh) for batch in instances.batches], instances.batch_of
        self.lower = np.array([extent.lower for extent in found], np.float32).reshape(-1, 3)[of_batch]
        self.upper = np.array([extent.upper for extent in found], np.float32).reshape(-1, 3)[of_batch]
        self._rest_lower, self._rest_upper = self.lower.copy(), self.upper.copy()
        self.is_measured = np.array([extent is not UNKNOWN_EXTENT for extent in found], np.bool_)[of_batch]
        self._mesh_radius = np.array([extent.radius for extent in found], np.float32)[of_batch]
        self.radius = self._radii(np.arange(len(of_batch)), linear)
        self.is_even = evenly_scaled(linear)
        self._find_middles()

    def rest(self, rows: Rows, linear: NDArray[np.float64]) -> None:
        """Takes the scales (N, 3, 3) that some have at rest."""
        self.radius[rows], self.is_even[rows] = self._radii(rows, linear), evenly_scaled(linear)

    def stretch(self, rows: Rows, linear: NDArray[np.floating[Any]]) -> None:
        """Takes the scales (N, 3, 3) that some have now."""
        if len(rows):
            self.radius[rows] = self._radii(rows, linear)

    def morph(self, rows: Rows, reach: NDArray[np.float32], linear: NDArray[np.floating[Any]]) -> None:
        """Takes how far (N, 3) morph targets may draw some, which are scaled so (N, 3, 3)."""
        self.lower[rows], self.upper[rows] = self._rest_lower[rows] - reach, self._rest_upper[rows] + reach
        self._mesh_radius[rows] = np.inf  # the box tells
        self.radius[rows] = self._radii(rows, linear)
        self._find_middles()

    def bend(self, rows: Rows, boxes: tuple[NDArray[np.float32], NDArray[np.float32]]) -> None:
        """Takes the boxes (N, 3) around some that are bent, along the world's axes."""
        self.lower[rows], self.upper[rows] = boxes
        self.radius[rows] = np.linalg.norm(boxes[1] - boxes[0], axis=1) / 2
        self._find_middles()

    def middles(
        self, rows: Rows, position: NDArray[np.float64], linear: NDArray[np.floating[Any]]
    ) -> NDArray[np.float64]:
        """World places (N, 3) [m] around which the spheres are, of some that stand so."""
        middle = (self.lower[rows] + self.upper[rows]) / 2
        return np.asarray(position + np.einsum("nij,nj->ni", linear, middle))

    def _find_middles(self) -> None:
        middle = (self.lower + self.upper) / 2
        self.aside: Rows = np.flatnonzero(middle.any(axis=1))
        self.middle = middle[self.aside]

    def _radii(self, rows: Rows, linear: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Of spheres around instances (N,) that are scaled and sheared so (N, 3, 3)."""
        gram = np.einsum("nki,nkj->nij", linear, linear)
        # A scale alone leaves the Gram matrix diagonal; with shear its row sums bound the largest eigenvalue (Gershgorin).
        stretch = np.sqrt(np.abs(gram).sum(axis=2).max(axis=1, initial=0.0))
        # What is long and thin is better enclosed by its box; four of the corners do, the others lie opposite.
        half = (self.upper[rows] - self.lower[rows]) / 2
        corners = np.einsum("nij,nkj->nki", linear, half[:, None, :] * _CORNER_SIGNS)
        corner = np.sqrt(np.einsum("nki,nki->nk", corners, corners).max(axis=1, initial=0.0))
        corner = np.where(self.is_measured[rows], corner, np.inf)
        return np.minimum(self._mesh_radius[rows] * stretch, corner).astype(np.float32)
