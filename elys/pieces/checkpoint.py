"""Checkpoints, and what comes back to them."""

from typing import Annotated

from elys.common.components import RigidBody
from elys.script import Behaviour, Entity, Vec3, Vector, about, seconds

from .events import CheckpointReached, Respawned, tell
from .signals import body_of, signal


class Checkpoint(Behaviour):
    """A trigger: who has a Respawn and comes here comes back here."""

    number: Annotated[int, about("Its place in the course; nobody goes back to a smaller one.", minimum=0)] = 0
    place: Annotated[Vec3, about("Where to come back, seen from it.", unit="m")] = (0.0, 0.5, 0.0)
    tells: Annotated[str, about("Name of the signal that it switches on.")] = ""

    def on_trigger_enter(self, other: Entity) -> None:
        body = body_of(other)
        back = self.entity.position + Vector(self.entity.rotation * self.place)
        reached = CheckpointReached(self.entity.id, body.id, self.number, *back)
        tell(self, reached)
        signal(self, self.tells, True)


class Respawn(Behaviour):
    """Brings its entity back to the last checkpoint, or to where it began, when it is killed or falls too deep."""

    floor: Annotated[float, about("Height below which it counts as fallen.", unit="m")] = -20.0
    delay: Annotated[float, about("Until it is back.", unit="s", minimum=0.0)] = 0.5

    def start(self):
        self.place, self.rotation = self.entity.position, self.entity.rotation
        self.number = -1
        self.count = 0
        self.is_waiting = False

    def on_event(self, event) -> None:
        told = event.values
        if event.kind == "checkpoint_reached" and told["by"] == self.entity.id and told["number"] >= self.number:
            self.number, self.place = told["number"], Vector(told["x"], told["y"], told["z"])
        elif event.kind == "killed" and told["entity"] == self.entity.id:
            self.respawn()

    def fixed_update(self, dt: float) -> None:
        if self.entity.position.y < self.floor:
            self.respawn()

    def respawn(self) -> None:
        """Brings it back, once however often it is asked for meanwhile."""
        if not self.is_waiting:
            self.is_waiting = True
            self.begin(self.come_back())

    async def come_back(self):
        if self.delay:
            await seconds(self.delay)
        self.entity.position, self.entity.rotation = self.place, self.rotation
        if self.entity.has(RigidBody):
            self.entity.velocity = self.entity.spin = (0.0, 0.0, 0.0)
        self.is_waiting = False
        self.count += 1
        tell(self, Respawned(self.entity.id, self.count))
