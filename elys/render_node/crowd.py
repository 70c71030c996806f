"""Instances in groups of neighbours: who is seen, who throws shadows and what is nearer is decided for some hundred groups,
however many instances there are, and the bounds of groups hold while bodies move a little.

    measure   where everything is, exactly: O(instances), when something has gone far
    spread    as far as anything may have gone since: a number, each picture
"""

from __future__ import annotations

import math
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from elys.common.math.aabb import transform_bounds
from elys.render_node.extents import Extents
from elys.render_node.instances import Instances
from elys.render_node.scene_tables import Rows, ranges

MOST_GROUPS: Final = 512  # about; scenes of fewer instances have one a group, where all is as exact as can be
GIANT: Final = 1.6  # times larger than all smaller things together: neither cameras nor shadow maps are fitted to it
LOOSE: Final = 0.01  # of the size of the whole, by which things may have gone before they are measured anew
KEPT_LISTS: Final = 16  # of instances, for what is drawn again and again
_STEPS: Final = 1023  # along each axis, by which neighbours are told


class Note(Protocol):
    """What somebody has worked out of a crowd."""

    def move(self, rows: Rows) -> None:
        """Takes where some instances, ascending, are measured now."""


class Crowd:
    """Groups of the solid instances of a scene, each of one batch and of those alone that throw shadows, or do not.

    Those whose bounds are known for every picture, as of what is animated, are groups of their own, the last ones.

    Attributes:
        batch, size: [G]. casts: [G] whether they throw shadows. centre: [3, G] f64 m. radius: [G] f32 m, of spheres that hold all
            of a group.
        item_centre: [M, 3] f64 m, of all instances where they were measured. item_radius: [M] f32 m.
        slack: [m] by which anything may be elsewhere than where it was measured; contained in `radius`.
        limit: [m] of slack from which on they should be measured anew.
        note: what somebody has worked out of where things were measured; None once they are measured anew.
        caster_rows: instances that throw shadows, as far as they are solid.
    """

    def __init__(self, instances: Instances, known: Rows, centre: NDArray[np.float64]) -> None:
        """`known` instances have bounds of their own for every picture; `centre` (M, 3) tells who are neighbours."""
        solid = np.arange(instances.first_blended)
        self._known = known[known < instances.first_blended]
        crowd = np.setdiff1d(solid, self._known, assume_unique=True)
        order, first = _grouped(crowd, instances.batch_of[crowd] * 2 + instances.casts[crowd], centre[crowd])
        self._members = np.concatenate([order, self._known]).astype(np.uint32)
        self._crowd_count = len(first)
        self._first = np.concatenate([first, len(order) + np.arange(len(self._known))]).astype(np.intp)
        self.size: Rows = np.diff(np.append(self._first, len(self._members)))
        leaders = self._members[self._first]
        self.batch: Rows = instances.batch_of[leaders]
        self.casts: NDArray[np.bool_] = instances.casts[leaders]
        self.caster_rows: Rows = np.flatnonzero(instances.casts[: instances.first_blended])
        self.centre = np.zeros((3, len(self.size)))
        self.radius = np.zeros(len(self.size), np.float32)
        self._measured_radius = self.radius
        self._group_of = np.full(len(instances.rows), -1)
        self._group_of[self._members] = np.repeat(np.arange(len(self.size)), self.size)
        self.slack, self.limit = 0.0, 0.0
        self.note: Note | None = None
        self._lists: dict[tuple[bytes, bytes], tuple[NDArray[np.uint32], Rows]] = {}

    def measure(
        self,
        position: NDArray[np.float64],
        linear: NDArray[np.float32],
        centre: NDArray[np.float64],
        extents: Extents,
    ) -> None:
        """Takes where all M instances are, exactly: (M, 3), (M, 3, 3), and the middles (M, 3) of spheres around them."""
        self._placed = position.copy(), linear.copy()
        self._extents = extents
        self.item_centre, self.item_radius = centre, extents.radius.copy()
        self.centre, self._measured_radius = self._bounds(self._members, self._first)
        self.limit = LOOSE * self._whole_size()
        self.note = None
        self.spread(0.0)

    def move(
        self,
        items: Rows,
        position: NDArray[np.float64],
        linear: NDArray[np.float32],
        centre: NDArray[np.float64],
    ) -> None:
        """Takes where some instances are now, as `measure` does for all; they stay in their groups, however far they went."""
        self._placed[0][items], self._placed[1][items] = position, linear
        self.item_centre[items], self.item_radius[items] = centre, self._extents.radius[items]
        groups = np.unique(self._group_of[items])
        groups = groups[np.searchsorted(groups, 0) : np.searchsorted(groups, self._crowd_count)]
        if len(groups):
            size = self.size[groups]
            members = self._members[ranges(self._first[groups], self._first[groups] + size)]
            self.centre[:, groups], self._measured_radius[groups] = self._bounds(members, np.cumsum(size) - size)
            self.spread(self.slack)
        if self.note is not None:
            self.note.move(items)

    def _bounds(self, members: NDArray[np.uint32], first: Rows) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Centres (3, G) and radii (G,) of spheres around groups of members, of which each begins at `first`."""
        places, reach = self.item_centre[members].T, self.item_radius[members]
        if len(first) == len(members):
            return np.ascontiguousarray(places), reach
        # fmin, fmax: a body that is nowhere any more, by what is no number, takes no neighbour along.
        lower = np.fmin.reduceat(places - reach, first, axis=1)
        upper = np.fmax.reduceat(places + reach, first, axis=1)
        centre = (lower + upper) / 2
        apart = places - np.repeat(centre, np.diff(np.append(first, len(members))), axis=1)
        distance = np.sqrt(np.einsum("ij,ij->j", apart, apart)) + reach
        return centre, np.fmax.reduceat(distance, first).astype(np.float32)

    def spread(self, slack: float) -> None:
        """Lets bounds hold where nothing is farther than this [m] from where it was measured."""
        self.slack = slack
        radius = self._measured_radius
        if slack > 0.0:
            # Rounded up: 32 bits.
            radius = radius + np.float32(slack * (1.0 + 1e-6))
            radius[self._crowd_count :] = self._measured_radius[self._crowd_count :]
        self.radius = radius

    def follow_known(self, centre: NDArray[np.float64], radius: NDArray[np.float32]) -> None:
        """Takes where those (K, 3) are that are known for every picture, and how large (K,)."""
        if len(self._known):
            self.centre[:, self._crowd_count :] = centre.T
            self._measured_radius[self._crowd_count :] = radius
            self.radius[self._crowd_count :] = radius
            self.item_centre[self._known], self.item_radius[self._known] = centre, radius

    @property
    def is_grouped(self) -> bool:
        """Whether any group has several members."""
        return len(self.size) < len(self._members)

    @property
    def known_casters(self) -> Rows:
        """Of the instances that are known for every picture, those that throw shadows."""
        return self._known[self.casts[self._crowd_count :]]

    def is_slack(self, rows: Rows) -> NDArray[np.bool_]:
        """Whether these instances may be elsewhere than where they were measured."""
        return np.asarray(self._group_of[rows] < self._crowd_count)

    def listed(self, groups: Rows) -> NDArray[np.uint32]:
        """The instances of these groups, one behind the other; the same array while the same are asked for."""
        return self.listed_without(groups, groups[:0])[0]

    def listed_without(self, groups: Rows, removed: Rows) -> tuple[NDArray[np.uint32], Rows]:
        """The same without some instances, and how many are left of each group."""
        key = (groups.tobytes(), removed.tobytes())
        found = self._lists.get(key)
        if found is None:
            if len(self._lists) >= KEPT_LISTS:
                del self._lists[next(iter(self._lists))]
            found = self._lists[key] = self._list(groups, removed)
        return found

    def _list(self, groups: Rows, removed: Rows) -> tuple[NDArray[np.uint32], Rows]:
        size = self.size[groups]
        end = np.cumsum(size)
        rows = self._members[ranges(self._first[groups], self._first[groups] + size)]
        if not len(removed) or not len(rows):
            return rows, size
        is_removed = np.zeros(len(self._group_of), np.bool_)
        is_removed[removed] = True
        kept = ~is_removed[rows]
        return rows[kept], np.add.reduceat(kept, end - size, dtype=np.intp)

    def groups_of(self, rows: Rows) -> Rows:
        """The groups of instances, -1 for those that are see-through."""
        return self._group_of[rows]

    def boxes(self, rows: Rows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (N, 3) of boxes along the world's axes around instances where they were measured."""
        position, linear = self._placed
        world_from_local = np.append(linear[rows], position[rows, :, None], axis=2)
        lower, upper = transform_bounds(world_from_local, self._extents.lower[rows], self._extents.upper[rows])
        return np.asarray(lower, np.float64), np.asarray(upper, np.float64)

    def _whole_size(self) -> float:
        """Of a box around all but giants [m]."""
        known = np.isfinite(self._measured_radius) & np.isfinite(self.centre).all(axis=0)
        if not known.any():
            return 0.0
        centre, radius = self.centre[:, known], self._measured_radius[known]
        kept = without_giants(centre.T, radius.astype(np.float64))
        box = (centre[:, kept] + radius[kept]).max(axis=1) - (centre[:, kept] - radius[kept]).min(axis=1)
        return float(np.linalg.norm(box))


def _grouped(rows: Rows, kind: Rows, centre: NDArray[np.float64]) -> tuple[Rows, Rows]:
    """Ascending rows (N,) so that neighbours of a kind stand together, and where each group of them begins."""
    if not len(rows):
        return rows, rows
    most = -(-len(rows) // MOST_GROUPS)
    order = np.argsort(kind, kind="stable") if most == 1 else np.lexsort((_morton(centre), kind))
    sorted_kind = kind[order]
    begins = np.append(True, sorted_kind[1:] != sorted_kind[:-1])
    run_start = np.flatnonzero(begins)[np.cumsum(begins) - 1]
    first = np.flatnonzero((np.arange(len(rows)) - run_start) % most == 0)
    return rows[order], first


def _morton(places: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Numbers (N,) that are near one another for places (N, 3) that are: the axes' bits in turns."""
    # What lies far outside must not press all others together.
    low, high = np.percentile(places, (2, 98), axis=0)
    step = _STEPS / np.maximum(high - low, 1e-9).max()
    cells = np.clip((places - low) * step, 0, _STEPS).astype(np.uint32)
    found = np.zeros(len(places), np.uint32)
    for axis in range(3):
        bits = cells[:, axis]
        for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
            bits = (bits | bits << np.uint32(shift)) & np.uint32(mask)
        found |= bits << np.uint32(axis)
    return found


def without_giants(centre: NDArray[np.float64], radius: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Who of N spheres is left without those that dwarf everything smaller together; all, if that leaves none."""
    everybody = np.ones(len(radius), np.bool_)
    # Only where sizes leap can a giant be: a sphere's own box reaches sqrt(3) times its radius.
    if radius.max(initial=0.0) <= GIANT * math.sqrt(3.0) * radius.min(initial=np.inf):
        return everybody
    sizes = np.sort(radius)
    for last in np.flatnonzero(sizes[1:] > GIANT * math.sqrt(3.0) * sizes[:-1]).tolist():
        smaller = radius <= sizes[last]
        reach = radius[smaller]
        places = np.compress(smaller, centre.T, axis=1)
        box = (places + reach).max(axis=1) - (places - reach).min(axis=1)
        if sizes[last + 1] > GIANT * np.linalg.norm(box) / 2:
            # One pebble does not make the house a giant: at least a few things must be left.
            return smaller if last + 1 >= min(4, len(radius)) else everybody
    return everybody
