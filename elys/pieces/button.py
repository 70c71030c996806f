"""A button: a plate that goes down under a weight, or a switch that is used with a key."""

from typing import Annotated, Literal

from elys.common.components import RigidBody
from elys.script import Behaviour, Entity, Vector, about

from .events import ButtonPressed, ButtonReleased, tell
from .signals import body_of, is_part_of, signal


class Button(Behaviour):
    """Switches a signal. It needs a trigger: what is in there presses it, or stands near enough to use it."""

    mode: Annotated[Literal["plate", "use"], about("Pressed by what stands on it, or by a key of who is near.")] = (
        "plate"
    )
    latch: Annotated[
        Literal["hold", "toggle", "once"], about("Off again when let go, at the next press, or never.")
    ] = "hold"
    tells: Annotated[str, about("Name of the signal that it switches.")] = ""
    mass: Annotated[float, about("What has to stand on a plate, all together.", unit="kg", minimum=0.0)] = 0.1
    key: Annotated[str, about("Key or button with which it is used.")] = "e"
    cap: Annotated[str, about("Name of the part below it that goes down; without one nothing moves.")] = ""
    travel: Annotated[float, about("How far that goes down.", unit="m", minimum=0.0)] = 0.08

    def start(self):
        self.inside: list[Entity] = []
        self.is_down = False
        self.is_on = False
        self.part = self.entity.child(self.cap) if self.cap else self.entity
        self.home = self.part.position

    def on_trigger_enter(self, other: Entity) -> None:
        if not is_part_of(other, self.entity):
            self.inside.append(other)

    def on_trigger_exit(self, other: Entity) -> None:
        if other in self.inside:
            self.inside.remove(other)

    def fixed_update(self, dt: float) -> None:
        down = self._is_pushed()
        if down == self.is_down:
            return
        self.is_down = down
        if down:
            tell(self, ButtonPressed(self.entity.id, body_of(self.inside[0]).id))
        else:
            tell(self, ButtonReleased(self.entity.id))
        was_on = self.is_on
        if self.latch == "hold":
            self.is_on = down
        elif down:
            self.is_on = not self.is_on if self.latch == "toggle" else True
        if self.is_on != was_on:
            signal(self, self.tells, self.is_on)
        if self.cap:
            self.begin(self.go(self.is_down or (self.is_on and self.latch == "once")))

    def _is_pushed(self) -> bool:
        if not self.inside:
            return False
        if self.mode == "use":
            return any(self.world.input(player).is_down(self.key) for player in self.world.players)
        bodies = dict.fromkeys(body_of(one) for one in self.inside if one.is_alive)
        return sum(body.get(RigidBody).mass for body in bodies if body.has(RigidBody)) >= self.mass

    async def go(self, down):
        """Brings the cap down or up."""
        goal = self.home - Vector(0.0, self.travel if down else 0.0, 0.0)
        await self.part.move_to(goal, duration=0.1)
