"""pull_grabbed: hands that hold bodies pull them towards where they are, in every tick until they let go.

A hand is a spring between a point of a body and a point in the world, damped critically. Its force is measured by the mass that
is felt at that point (at most 1 / (1/m + r^2 / I) for an arm r and the least moment of inertia I, of an impulse across the arm),
so that it neither whips a light body nor the end of a long one.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.commands import Grab
from elys.common.errors import RequestError
from elys.common.math import quaternion
from elys.sim_node.physics.debug_geometry import Lines, lines_of_forces
from elys.sim_node.physics.force_lines import HAND
from elys.sim_node.physics.kernels.tables import DYNAMIC
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.systems.simulate_physics import REACH

Point = NDArray[np.float64]

MOST_HANDS: Final = 64
_SHARE: Final = (
    0.25  # of its distance that a hand may correct in a tick: stiffer ones would swing up instead of coming to rest
)


class Hands:
    """Who holds which body. Bodies that are gone or do not move any more are let go."""

    def __init__(self, physics: PhysicsWorld) -> None:
        self._physics = physics
        self._grabs: tuple[Grab, ...] = ()  # one of each holder

    def take(self, grab: Grab, named: str) -> None:
        """Holds a body, in the place of what the same holder held; `named` is what a refusal calls it.

        Raises:
            RequestError: it is no body that forces move, or a number is none.
        """
        numbers = (*grab.anchor, *grab.target)
        if not all(math.isfinite(number) and abs(number) <= REACH for number in numbers):
            raise RequestError(f"a hand cannot hold {named} there: it must lie within {REACH:g} m of the origin")
        if not (math.isfinite(grab.stiffness) and grab.stiffness > 0.0):
            raise RequestError(f"a hand's stiffness must be above 0, not {grab.stiffness:g}: 100 is a firm one")
        if not self._is_moved(grab.entity):
            raise RequestError(f"{named} cannot be dragged by a hand: only dynamic rigid bodies that are enabled can")
        others = tuple(other for other in self._grabs if other.holder != grab.holder)
        if len(others) >= MOST_HANDS:
            raise RequestError(f"{MOST_HANDS} hands hold bodies already: let one go first")
        self._grabs = (*others, grab)

    def release(self, holder: str) -> None:
        """Lets go of what a holder holds, if anything."""
        self._grabs = tuple(grab for grab in self._grabs if grab.holder != holder)

    def holds(self, holder: str) -> bool:
        """Whether somebody holds a body."""
        return any(grab.holder == holder for grab in self._grabs)

    def pull(self, tick_time: float) -> None:
        """Pulls during the next step, which takes `tick_time` [s]."""
        if not self._grabs:
            return
        self._grabs = tuple(grab for grab in self._grabs if self._is_moved(grab.entity))
        for grab in self._grabs:
            point, pull = self._pull(grab, tick_time)
            self._physics.apply_force([grab.entity], pull, point)

    def force_lines(self, tick_time: float) -> Lines:
        """How they pull as things stand, as physics shows forces."""
        grabs = [grab for grab in self._grabs if self._is_moved(grab.entity)]
        pulls = np.array([self._pull(grab, tick_time) for grab in grabs]).reshape(-1, 2, 3)
        entities = np.array([grab.entity for grab in grabs], np.uint32)
        return lines_of_forces({HAND: (entities, pulls[:, 0], pulls[:, 1])})

    def _pull(self, grab: Grab, tick_time: float) -> tuple[Point, Point]:
        """Where a hand holds [m], and its force there [N]."""
        bodies = self._physics.bodies
        row = self._row_of(grab.entity)
        rotation = bodies.rotation[row].astype(np.float64)
        point = bodies.position[row] + quaternion.rotate(rotation, np.array(grab.anchor))
        velocity, mass = self._physics.motion_at([grab.entity], point)
        rate = min(math.sqrt(grab.stiffness), _SHARE / tick_time)  # [1/s]
        return point, mass[0] * (rate * rate * (np.array(grab.target) - point) - 2.0 * rate * velocity[0])

    def _is_moved(self, entity: int) -> bool:
        """Whether an entity is a body that forces move."""
        row = self._row_of(entity)
        return row >= 0 and bool(self._physics.bodies.motion[row] == DYNAMIC)

    def _row_of(self, entity: int) -> int:
        """Among the bodies; -1 for none."""
        rows = np.flatnonzero(self._physics.bodies.entity == entity)
        return int(rows[0]) if len(rows) else -1
