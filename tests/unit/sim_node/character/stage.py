"""A world with a character in it, for tests: boxes, and ticks with wishes."""

from __future__ import annotations

import math

import numpy as np

from elys.common.components import Character, Collider, RigidBody, Transform
from elys.common.math import quaternion
from elys.sim_node.character.kernels.tables import SKIN
from elys.sim_node.simulation import Simulation

DT = 1.0 / 60.0
GRAVITY = 9.81


class Stage:
    """A simulation with a floor whose surface is at y = 0, and one character."""

    def __init__(self, *, floor: bool = True, at=(0.0, SKIN, 0.0), **sheet) -> None:
        self.simulation = Simulation()
        self.world = self.simulation.world
        if floor:
            self.box((200.0, 1.0, 200.0), (0.0, -0.5, 0.0))
        self.one = self.add(at, **sheet)

    def add(self, at=(0.0, SKIN, 0.0), **sheet) -> int:
        """Another character."""
        return self.world.spawn([Transform(position=tuple(at)), Character(**sheet)], name="Walker")

    def box(self, size, position, *, rotation=(0.0, 0.0, 0.0, 1.0), body: RigidBody | None = None, **collider) -> int:
        """A box, immovable without a body."""
        parts = [Transform(position=tuple(position), rotation=tuple(rotation)), Collider(size=tuple(size), **collider)]
        return self.world.spawn([*parts, body] if body else parts)

    def ramp(self, degrees: float, *, length: float = 40.0, width: float = 20.0) -> None:
        """A slope that rises along +x from the origin."""
        angle = math.radians(degrees)
        thickness = 1.0
        turn = quaternion.from_axis_angle((0.0, 0.0, 1.0), angle)
        along, normal = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
        middle = (
            0.5 * length * along[0] - 0.5 * thickness * normal[0],
            0.5 * length * along[1] - 0.5 * thickness * normal[1],
            0.0,
        )
        self.box((length, thickness, width), middle, rotation=turn.tolist())

    def step(self, ticks: int = 1, *, who: int | None = None, **wishes) -> None:
        """Ticks; wishes are fields of the character, and stay."""
        if wishes:
            self.simulation.settle()
            self.world.set_fields(who or self.one, Character, wishes)
        for _ in range(ticks):
            self.simulation.step()

    def walker(self, who: int | None = None) -> Character:
        """The character's values."""
        return self.world.get(who or self.one, Character)

    def place(self, who: int | None = None):
        """Where it is (3,) [m]."""
        return np.array(self.world.transforms.world_pose(who or self.one)[0])

    def path(self, ticks: int, **wishes):
        """Where it was at the ends of ticks (T, 3)."""
        places = []
        for _ in range(ticks):
            self.step(**wishes)
            wishes = {}
            places.append(self.place())
        return np.array(places)
