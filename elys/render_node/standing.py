"""Where the instances of one scene stand, as far as the processor must know it.

led       those that it places for every picture: joints, what is animated or see-through, lamps, cameras
all       placed by the card (`instance_place.vert`), and here only when somebody asks where they are
crowd     bounds of groups of them, which hold while nothing has gone far
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.crowd import Crowd
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.drift import Drift
from elys.render_node.extents import Extents
from elys.render_node.instance_rows import InstanceRows, led_texels
from elys.render_node.instances import Instances
from elys.render_node.placement import Placement
from elys.render_node.scene_tables import Rows, SceneTables, places_in
from elys.render_node.timeline import Timeline

STRAYED: Final = 1 / 16  # of all instances, that may be edited away from their neighbours before these are found anew
SLACK_STEPS: Final = 4  # by which bounds are widened until things are measured anew


class Standing:
    """Of M instances and F fixtures (lamps, cameras, what is around), for frames that tell of the same bodies.

    Attributes:
        extents: how large the instances are. led: [L] those that are placed for every picture. led_centre: [L, 3] f64 m,
            middles of spheres around them.
        fraction: of the way to the newest frame on which everything is placed.
    """

    def __init__(
        self,
        tables: SceneTables,
        instances: Instances,
        fixtures: Rows,
        timeline: Timeline,
        assets: DrawableAssets,
        rows: InstanceRows,
    ) -> None:
        """`fixtures` (F,) are rows of the tables; `rows` are filled for the card."""
        newest, nobody = timeline.newest, np.zeros(0, np.uint32)
        bodies = newest.entity if newest is not None else nobody
        animated = newest.local_entity if newest is not None else nobody
        self._instances, self._timeline, self._rows = instances, timeline, rows
        self._all = Placement(tables, instances.stand_rows, bodies, animated)
        self._placed: tuple[StateFrame | None, float] | None = None
        deformation = instances.deformation
        self._stretching = np.setdiff1d(self._all.articulated, deformation.bent)
        # Their places are not those of a body and what stays relative to it: the card cannot work them out.
        self._taken_along = np.union1d(self._all.articulated, deformation.bent).astype(np.intp)
        see_through = np.arange(instances.first_blended, len(instances.rows))
        self.led: Rows = np.union1d(np.union1d(self._taken_along, see_through), deformation.morphed).astype(np.intp)
        led_rows = np.concatenate([instances.stand_rows[self.led], fixtures, deformation.joint_rows])
        self._led = Placement(tables, led_rows, bodies, animated)
        self.extents = Extents(instances, tables.world_from_local[instances.rows, :, :3], assets)
        self.extents.is_even[self._stretching] = False  # their scale may be animated
        bent = deformation.bent
        intricate = (self._all.limb_rows, deformation.joint_rows, instances.rows[bent], instances.stand_rows[bent])
        self._intricate = np.unique(np.concatenate(intricate))
        rows.rest(instances, tables.world_from_local[instances.stand_rows], self._taken_along)
        self._drift = Drift()
        self._arm = 0.0  # [m] how far from its body anything that rides may be
        self._untold_in: StateFrame | None = None  # the frame that did not know where somebody was put by hand
        self.fraction = 1.0
        self.lead(1.0)
        self._gather()

    def lead(self, fraction: float) -> None:
        """Moves those that are led to where they are `fraction` of the way to the newest frame; others follow when asked for."""
        self.fraction = fraction
        self._is_spread = False
        self._led.follow(self._timeline, fraction)
        count = len(self.led)
        linear, position = self._led.linear[:count], self._led.position[:count]
        if not self._instances.deformation.is_none:
            self._deform(fraction, linear, position)
        if len(self._stretching):
            self.extents.stretch(self._stretching, linear[np.searchsorted(self.led, self._stretching)])
        self.led_centre = self.extents.middles(self.led, position, linear)

    def move(self, tables: SceneTables, moved: Rows) -> Rows | None:
        """Lets some rows of the tables, ascending, and all below them stand where these say now; returns which instances that
        are. None where joints or what is animated are among them: all has to be made anew.
        """
        if not len(moved):
            return moved
        if places_in(self._intricate, moved)[1].any():
            return None
        self._all.move(tables, moved)
        self._led.move(tables, moved)
        items = np.sort(self._instances.of_rows(moved))
        if len(items):
            world_from_instance = tables.world_from_local[self._instances.rows[items]]
            self.extents.rest(items, world_from_instance[:, :, :3])
            self._rows.move(self._all, items, world_from_instance)
        self.lead(self.fraction)
        if len(items):
            self._move_crowd(items)
        return items

    def _move_crowd(self, items: Rows) -> None:
        everybody, crowd = self._all, self._crowd
        riders = everybody.riding(items)
        if len(riders):
            self._arm = max(self._arm, self._reach_of(riders))
            self._placed = None  # bodies take them along from where they were put
        self._moved_count += len(items)
        if crowd.is_grouped and self._moved_count > len(self._instances.rows) * STRAYED:
            self._gather()
        elif len(riders) > len(everybody.untold(riders, self._timeline)):
            self._measure()
        else:
            self._untold_in = self._timeline.newest if len(riders) else self._untold_in
            position, linear = everybody.position[items], everybody.linear[items]
            crowd.move(items, position, linear, self.extents.middles(items, position, linear))

    def _reach_of(self, riders: Rows) -> float:
        """How far [m] from the bodies on which they ride the middles of some instances may be."""
        affine = self._all.on_carriers(riders)
        arms = self.extents.middles(riders, affine[:, :, 3].astype(np.float64), affine[:, :, :3])
        return float(np.linalg.norm(arms, axis=1).max(initial=0.0))

    def fixture(self, number: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Position (3,) [m], and rotation and scale (3, 3), of a fixture."""
        item = len(self.led) + number
        return self._led.position[item], self._led.linear[item]

    @property
    def everybody(self) -> Placement:
        """Where all instances are, worked out if nobody has asked since they moved."""
        return self._at(self.fraction)

    def middles(self, placement: Placement) -> NDArray[np.float64]:
        """Of spheres around all instances (M, 3) [m]."""
        columns = placement.position.T.copy()
        aside = self.extents.aside
        if len(aside):
            columns[:, aside] += np.einsum("nij,nj->in", placement.linear[aside], self.extents.middle)
        centre: NDArray[np.float64] = columns.T  # as columns, like positions
        return centre

    def crowd(self, *, exact: bool) -> Crowd:
        """The solid instances in groups, with bounds that hold for where they are; `exact` ones are no wider than needed."""
        if exact and self._moved_count:
            self._gather()
        crowd, timeline = self._crowd, self._timeline
        if not self._is_spread:
            self._is_spread = True
            slack = self._drift.at(timeline, self.fraction)
            is_at_rest = timeline.is_still or timeline.previous is None
            is_loose = slack > crowd.limit or (slack > 0.0 and (exact or is_at_rest))
            # Who was put elsewhere by hand leaps to where a frame says that knows of it.
            is_loose = is_loose or (self._untold_in is not None and self._untold_in is not timeline.newest)
            if is_loose and self._drift.origin is not timeline.newest:
                slack = self._measure()
            if not exact and 0.0 < slack <= crowd.limit:
                step = crowd.limit / SLACK_STEPS  # so that the same are seen, and maps stay, for some pictures
                slack = math.ceil(slack / step) * step
            crowd.spread(slack)
            solid = int(np.searchsorted(self.led, self._instances.first_blended))
            crowd.follow_known(self.led_centre[:solid], self.extents.radius[self.led[:solid]])
        return crowd

    def card_rows(self) -> InstanceRows:
        """What the card is to know of the instances, with who rides on which body now."""
        self._rows.follow(self._all, self._timeline)
        return self._rows

    @property
    def is_leading(self) -> bool:
        """Whether there are instances that the card cannot place."""
        return len(self._taken_along) > 0

    @property
    def led_texels(self) -> NDArray[np.float32]:
        """Where those stand, as `instance_place.vert` reads them, that it cannot place itself."""
        places = np.searchsorted(self.led, self._taken_along)
        return led_texels(self._led.position[places], self._led.linear[places])

    def _at(self, fraction: float) -> Placement:
        newest = self._timeline.newest
        if self._placed is None or self._placed[0] is not newest or self._placed[1] != fraction:
            self._all.follow(self._timeline, fraction)
            self._all.linear[self._instances.deformation.bent] = np.eye(3)
            self._placed = (newest, fraction)
        return self._all

    def _deform(self, fraction: float, linear: NDArray[np.float32], position: NDArray[np.float64]) -> None:
        """Brings joints and weights, and the boxes around what they move, to where things are placed."""
        deformation, extents = self._instances.deformation, self.extents
        morphed, bent = deformation.morphed, deformation.bent
        if len(morphed):
            deformation.morph(self._timeline, fraction)
            extents.morph(morphed, deformation.reach[morphed], linear[np.searchsorted(self.led, morphed)])
        if len(bent):
            places = np.searchsorted(self.led, bent)
            joints = slice(len(self._led.position) - len(deformation.joint_rows), None)
            origin = np.zeros((len(self._instances.rows), 3))
            origin[bent] = position[places]
            boxes = deformation.bend(self._led.linear[joints], self._led.position[joints], origin)
            linear[places] = np.eye(3)
            extents.bend(bent, boxes)

    def _gather(self) -> None:
        """Puts neighbours together, where they are in the newest frame."""
        known = self.led[self.led < self._instances.first_blended]
        self._crowd = Crowd(self._instances, known, self.middles(self._at(1.0)))
        self._moved_count = 0
        self._arm = self._reach_of(np.setdiff1d(self._all.moving, self.led, assume_unique=True))
        self._measure()

    def _measure(self) -> float:
        """Measures the crowd where it is in the newest frame; returns how far [m] it may be from there."""
        untold = self._all.untold(self._all.moving, self._timeline)
        self._untold_in = self._timeline.newest if len(untold) else None
        newest = self._at(1.0)
        self._crowd.measure(newest.position, newest.linear, self.middles(newest), self.extents)
        self._drift.start(self._timeline.newest, self._arm)
        return self._drift.at(self._timeline, self.fraction)
