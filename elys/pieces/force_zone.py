"""A zone in which forces act: wind, other gravity, water, in which characters swim."""

from typing import Annotated

from elys.common.components import Character, RigidBody
from elys.script import Entity, Vec3, Vector, about

from .events import ZoneEntered, ZoneLeft, tell
from .signals import Switched, body_of


class ForceZone(Switched):
    """A trigger that pushes bodies inside: a = acceleration + drag (wind - v) + (gravity_scale - 1) g - lift depth g, with the
    depth of the body's middle below the zone's surface, from 0 to 1 over `shallows`. Where there is lift, a character swims that
    has more of its height under water than `wade`, and walks again where it has less.
    """

    acceleration: Annotated[Vec3, about("That all inside have, along the world's axes.", unit="m/s2")] = (0.0, 0.0, 0.0)
    wind: Annotated[Vec3, about("Velocity of the air or water inside.", unit="m/s")] = (0.0, 0.0, 0.0)
    drag: Annotated[float, about("How fast bodies take on that velocity.", unit="1/s", minimum=0.0, maximum=50.0)] = 0.0
    gravity_scale: Annotated[float, about("How much of gravity acts inside.")] = 1.0
    lift: Annotated[float, about("Weight of the water that a body displaces, as a share of its own.", minimum=0.0)] = (
        0.0
    )
    surface: Annotated[float, about("Height of the water above the zone's middle.", unit="m")] = 0.5
    shallows: Annotated[float, about("Depth from which the whole lift acts.", unit="m", minimum=0.01)] = 0.5

    wade: Annotated[
        float, about("Share of its height to which a character walks in water.", minimum=0.0, maximum=1.0)
    ] = 0.65

    def start(self):
        super().start()
        self.inside: dict[Entity, Entity] = {}  # bodies by the colliders that are inside

    def on_trigger_enter(self, other: Entity) -> None:
        body = body_of(other)
        if body not in self.inside.values():
            tell(self, ZoneEntered(self.entity.id, body.id))
        self.inside[other] = body

    def on_trigger_exit(self, other: Entity) -> None:
        body = self.inside.pop(other, None)
        if body is not None and body not in self.inside.values():
            tell(self, ZoneLeft(self.entity.id, body.id))
            if body.is_alive and body.has(Character) and body.legs.mode == "swim":
                body.legs.mode = "walk"

    def fixed_update(self, dt: float) -> None:
        if not self.is_on:
            return
        gravity = self.world.gravity
        top = self.entity.position.y + self.surface
        for body in dict.fromkeys(self.inside.values()):
            if self.lift and body.is_alive and body.has(Character):
                self._let_swim(body, top)
            if not (body.is_alive and body.has(RigidBody)) or (facts := body.get(RigidBody)).motion != "dynamic":
                continue
            depth = min(1.0, max(0.0, (top - body.position.y) / self.shallows))
            share = (self.gravity_scale - 1.0 - self.lift * depth) * facts.gravity_scale
            pull = Vector(self.acceleration) + (Vector(self.wind) - facts.linear_velocity) * self.drag + gravity * share
            body.apply_force(pull * facts.mass)

    def _let_swim(self, body: Entity, top: float) -> None:
        legs, under = body.legs, (top - body.position.y) / body.get(Character).height
        if legs.mode == "walk" and under > self.wade:
            legs.mode = "swim"
        elif legs.mode == "swim" and under < self.wade - 0.05:  # who is at the edge of it does not change to and fro
            legs.mode = "walk"
