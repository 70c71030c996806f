"""Something that turns, or swings like a gate."""

import math
from typing import Annotated

from elys.common.components import RigidBody
from elys.script import Rotation, Vec3, Vector, about, seconds, until

from .events import RotatorTurned, tell
from .signals import Switched


class Rotator(Switched):
    """Turns about an axis of its own; a kinematic body takes along what lies on it. With an angle it swings there and back."""

    axis: Annotated[Vec3, about("About which it turns, in its own space.")] = (0.0, 1.0, 0.0)
    speed: Annotated[float, about("How fast it turns.", unit="rad/s")] = 1.0
    angle: Annotated[float, about("How far it swings; 0: on and on.", unit="rad", minimum=0.0, maximum=math.pi)] = 0.0
    pause: Annotated[float, about("At each end of a swing.", unit="s", minimum=0.0)] = 0.5

    def start(self):
        super().start()
        self.home = self.entity.rotation
        self.turned = 0.0
        self.is_kinematic = self.entity.has(RigidBody) and self.entity.get(RigidBody).motion == "kinematic"
        if self.angle:
            self.begin(self.swing())

    def fixed_update(self, dt: float) -> None:
        if self.angle:
            return
        speed = self.speed if self.is_on else 0.0
        if self.is_kinematic:
            self.entity.spin = self.entity.rotation * (Vector(self.axis).normalized() * speed)
        elif speed:
            self.entity.rotation = self.entity.rotation * Rotation.about(self.axis, speed * dt)
        rounds = int(abs(self.turned) / (2.0 * math.pi))
        self.turned += speed * dt
        if int(abs(self.turned) / (2.0 * math.pi)) > rounds:
            tell(self, RotatorTurned(self.entity.id, rounds + 1))

    async def swing(self):
        ends = (self.home * Rotation.about(self.axis, math.copysign(self.angle, self.speed)), self.home)
        duration = self.angle / max(abs(self.speed), 1e-3)
        count = 0
        while True:
            await until(lambda: self.is_on)
            await self.entity.rotate_to(ends[count % 2], duration=duration)
            count += 1
            tell(self, RotatorTurned(self.entity.id, count))
            if self.pause:
                await seconds(self.pause)
