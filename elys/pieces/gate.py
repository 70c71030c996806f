"""Gates of a course, and its goal."""

from typing import Annotated

from elys.common.components import RigidBody
from elys.script import Behaviour, Entity, Vector, about

from .events import GatePassed, GoalReached, tell
from .signals import body_of, signal


class Gate(Behaviour):
    """A trigger that tells who goes through."""

    number: Annotated[int, about("Its place in the course, from 1 on.", minimum=0)] = 1
    is_one_way: Annotated[bool, about("Whether only going the way of its -z counts.")] = False
    tells: Annotated[str, about("Name of the signal that it switches on.")] = ""

    def on_trigger_enter(self, other: Entity) -> None:
        body = body_of(other)
        if self.is_one_way and body.has(RigidBody) and Vector(body.velocity).dot(self.entity.forward()) <= 0.0:
            return
        tell(self, GatePassed(self.entity.id, body.id, self.number, self.world.time))
        signal(self, self.tells, True)


class Goal(Behaviour):
    """A trigger that ends a course for who has passed gates 1 to `gates`, in that order."""

    gates: Annotated[int, about("How many have to be passed before.", minimum=0)] = 0
    tells: Annotated[str, about("Name of the signal that it switches on.")] = ""

    def start(self):
        self.passed: dict[int, int] = {}
        self.arrived: list[int] = []

    def on_event(self, event) -> None:
        if event.kind == "gate_passed":
            by, number = event.values["by"], event.values["number"]
            if number == self.passed.get(by, 0) + 1:
                self.passed[by] = number

    def on_trigger_enter(self, other: Entity) -> None:
        body = body_of(other)
        if self.passed.get(body.id, 0) >= self.gates and body.id not in self.arrived:
            self.arrived.append(body.id)
            tell(self, GoalReached(self.entity.id, body.id, self.world.time))
            signal(self, self.tells, True)
