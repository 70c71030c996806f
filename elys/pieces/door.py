"""A door that a signal opens, or whoever comes near its trigger."""

from typing import Annotated

from elys.script import Behaviour, Entity, Vec3, Vector, about, until

from .events import DoorClosed, DoorOpened, tell
from .signals import is_part_of


class Door(Behaviour):
    """Slides out of the way. Without a signal it opens for what comes into a trigger on it or below it."""

    signal: Annotated[str, about("Name of the signal that opens it; without one it opens by itself.")] = ""
    travel: Annotated[Vec3, about("How far it goes when it opens, along its own axes.", unit="m")] = (0.0, 2.0, 0.0)
    duration: Annotated[float, about("To open or to close.", unit="s", minimum=0.02)] = 0.6
    stays_open: Annotated[float, about("Before it closes again.", unit="s", minimum=0.0)] = 1.0
    panel: Annotated[str, about("Name of the part below it that moves; without one the whole.")] = ""

    def start(self):
        self.part = self.entity.child(self.panel) if self.panel else self.entity
        self.home = self.part.position
        self.away = self.home + Vector(self.part.rotation * self.travel)
        self.wanted = False
        self.is_open = False
        self.inside: list[Entity] = []
        self.since = -1e9
        self.begin(self.work())

    def on_trigger_enter(self, other: Entity) -> None:
        if not is_part_of(other, self.entity):
            self.inside.append(other)

    def on_trigger_exit(self, other: Entity) -> None:
        if other in self.inside:
            self.inside.remove(other)

    def on_event(self, event) -> None:
        if event.kind == "signal" and self.signal and event.values.get("name") == self.signal:
            self.wanted = bool(event.values.get("on"))

    def shall_open(self) -> bool:
        """Whether anything keeps it open; it goes on being wanted for as long as it stays open."""
        if self.wanted if self.signal else self.inside:
            self.since = self.world.time
            return True
        return self.world.time - self.since < self.stays_open

    async def work(self):
        while True:
            await until(self.shall_open)
            await self.part.move_to(self.away, duration=self.duration)
            self.is_open = True
            tell(self, DoorOpened(self.entity.id))
            await until(lambda: not self.shall_open())
            await self.part.move_to(self.home, duration=self.duration)
            self.is_open = False
            tell(self, DoorClosed(self.entity.id))
