"""A belt that carries what lies on it."""

from typing import Annotated

from elys.common.components import RigidBody
from elys.script import Vec3, Vector, about

from .signals import Switched


class Conveyor(Switched):
    """A kinematic body that moves for those who touch it and stays where it is."""

    velocity: Annotated[Vec3, about("Of the belt's surface, along its own axes.", unit="m/s")] = (1.0, 0.0, 0.0)

    def start(self):
        super().start()
        self.home = self.entity.position
        if not self.entity.has(RigidBody) or self.entity.get(RigidBody).motion != "kinematic":
            raise ValueError("a conveyor needs a RigidBody whose motion is kinematic")

    def fixed_update(self, dt: float) -> None:
        # It goes a step and is put back: friction knows velocities alone.
        self.entity.velocity = self.entity.rotation * Vector(self.velocity) if self.is_on else (0.0, 0.0, 0.0)

    def update(self, dt: float) -> None:
        if self.is_on:
            self.entity.position = self.home
