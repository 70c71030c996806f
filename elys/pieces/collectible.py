"""Something to be collected."""

from typing import Annotated

from elys.script import Behaviour, Entity, Rotation, Vector, about, seconds

from .events import Collected, tell
from .signals import body_of, signal


class Collectible(Behaviour):
    """A trigger that is taken by the first who comes. What is seen of it stands below it, turns and floats."""

    kind: Annotated[str, about("What it is.")] = "coin"
    value: Annotated[int, about("What it is worth.")] = 1
    returns: Annotated[float, about("After which it is there again; 0: never.", unit="s", minimum=0.0)] = 0.0
    turn: Annotated[float, about("How fast what is seen of it turns.", unit="rad/s")] = 2.0
    tells: Annotated[str, about("Name of the signal that it switches on.")] = ""

    def start(self):
        self.is_there = True

    def on_trigger_enter(self, other: Entity) -> None:
        if not self.is_there:
            return
        self.is_there = False
        tell(self, Collected(self.entity.id, body_of(other).id, self.kind, self.value))
        signal(self, self.tells, True)
        self.begin(self.go())

    def update(self, dt: float) -> None:
        if self.is_there and self.turn:
            step = Rotation.about(Vector(0.0, 1.0, 0.0), self.turn * dt)
            for part in self.entity.children:
                part.rotation = step * part.rotation

    async def go(self):
        for part in self.entity.children:
            part.enabled = False
        if not self.returns:
            self.entity.destroy()
            return
        await seconds(self.returns)
        self.is_there = True
        for part in self.entity.children:
            part.enabled = True
