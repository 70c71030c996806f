"""Forces and impulses of scripts: on bodies at once, and on what was spawned in this tick as soon as it has a body."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from elys.common.components import RigidBody
from elys.common.errors import PhysicsError, ScriptError
from elys.common.ids import Entity

if TYPE_CHECKING:
    from elys.sim_node.simulation import Simulation

Vec = tuple[float, ...]
Kind = Literal["force", "impulse", "torque"]
_log = logging.getLogger(__name__)


class Push(NamedTuple):
    """What is to be done to a body: how, by how much [N, N s or N m], at which place [m]; None: at its centre of mass."""

    kind: Kind
    entity: int
    vector: Vec
    point: Vec | None


class Pushes:
    """Pushes bodies, and keeps what waits for one."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.waiting: list[Push] = []

    def push(self, push: Push) -> None:
        """Now, or when the entity has its body.

        Raises:
            ScriptError: it will have none. PhysicsError: the numbers are none.
        """
        try:
            self._do(push)
        except PhysicsError:
            world = self._simulation.world
            if self._has_body(push.entity) or not all(map(math.isfinite, (*push.vector, *(push.point or ())))):
                raise
            if not (world.is_alive(Entity(push.entity)) and world.has(Entity(push.entity), RigidBody)):
                named = self._simulation.named(Entity(push.entity))
                raise ScriptError(f"{named} has no RigidBody, so nothing can push it: give it one") from None
            self.waiting.append(push)

    def do_waiting(self) -> None:
        """Call it when bodies have come. What has got none is said: it is switched off, or physics has left it out."""
        waiting, self.waiting = self.waiting, []
        for push in waiting:
            if self._has_body(push.entity):
                self._do(push)
            elif self._simulation.world.is_alive(Entity(push.entity)):
                named = self._simulation.named(Entity(push.entity))
                _log.warning("%s was pushed, and has no body: is it switched off, or has it no Transform?", named)

    def saved(self) -> tuple[Any, ...]:
        """For a state."""
        return tuple(map(tuple, self.waiting))

    def load(self, saved: tuple[Any, ...]) -> None:
        """What `saved` gave."""
        self.waiting = [
            Push(kind, entity, tuple(vector), point and tuple(point)) for kind, entity, vector, point in saved
        ]

    def _has_body(self, entity: int) -> bool:
        return bool(self._simulation.physics.has([entity])[0])

    def _do(self, push: Push) -> None:
        physics = self._simulation.physics
        point = None if push.point is None else [push.point]
        if push.kind == "torque":
            physics.apply_torque([push.entity], [push.vector])
        elif push.kind == "force":
            physics.apply_force([push.entity], [push.vector], point)
        else:
            physics.apply_impulse([push.entity], [push.vector], point)
