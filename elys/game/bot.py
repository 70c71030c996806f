"""A driver at the wheel of a simulation of this process: it sees what a state tells, and its hands are part of the recording."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

from elys.bus.messages.commands import CommandRequest
from elys.common.components import RigidBody
from elys.common.ids import NO_ENTITY, Entity
from elys.game.driver import Driver, Style
from elys.samples.game.levels import Layout

if TYPE_CHECKING:
    from elys.sim_node.simulation import Simulation


class Bot:
    """One of `SimulationNode.players`."""

    def __init__(self, simulation: Simulation, layout: Layout, *, player: int = 1, style: Style | None = None) -> None:
        self._simulation = simulation
        self._style = style
        self.player = player
        self.drive(layout)

    def drive(self, layout: Layout) -> None:
        """From now on along the line of a level, from its beginning."""
        self._layout = layout
        self._driver = Driver(layout.line, ferries=layout.ferries, player=self.player, style=self._style)
        self._ball = self._camera = NO_ENTITY  # until they are found

    def __call__(self) -> list[CommandRequest]:
        """What it does before the next step."""
        world = self._simulation.world
        if not (world.is_alive(self._ball) and world.is_alive(self._camera)):
            self._ball, self._camera = self._named(f"Ball {self.player}"), self._named(f"Camera {self.player}")
            if NO_ENTITY in (self._ball, self._camera):
                return []
        x, y, z, w = world.transforms.world_pose(self._camera)[1]
        heading = math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
        position = world.transforms.world_pose(self._ball)[0]
        velocity = world.get(self._ball, RigidBody).linear_velocity
        ferries = {one.name: world.transforms.world_pose(self._named(one.name))[0] for one in self._layout.ferries}
        command = self._driver.input(position, velocity, heading, ferries=ferries)
        name = f"bot-{self.player}"
        return [CommandRequest(origin=name, command=msgspec.structs.replace(command, source=name))]

    def _named(self, name: str) -> Entity:
        return Entity(next(iter(self._simulation.scripts.named(name)), NO_ENTITY))
