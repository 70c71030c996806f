"""Signals: names that pieces switch on and off, and that other pieces listen to, so that a button opens a door."""

from typing import Annotated

from elys.common.components import RigidBody
from elys.script import Behaviour, Entity, about

from .events import Signal, tell


class Switched(Behaviour):
    """A piece that a signal switches. Derive from it; `is_on` says how it stands."""

    signal: Annotated[str, about("Name of the signal that switches it; without one it is always on.")] = ""
    is_on = True

    def start(self) -> None:
        """It stands off until its signal comes."""
        self.is_on = not self.signal

    def on_event(self, event) -> None:
        """Follows its signal."""
        if event.kind == "signal" and self.signal and event.values.get("name") == self.signal:
            was_on, self.is_on = self.is_on, bool(event.values.get("on"))
            if self.is_on != was_on:
                self.switched()

    def switched(self) -> None:
        """Its signal has just changed."""


def signal(teller: Behaviour, name: str, on: bool) -> None:
    """Switches a signal; without a name nothing."""
    if name:
        tell(teller, Signal(name, on))


def body_of(entity: Entity) -> Entity:
    """The body that a collider's entity is part of; itself if it is part of none."""
    found: Entity | None = entity
    while found is not None:
        if found.has(RigidBody):
            return found
        found = found.parent
    return entity


def is_part_of(entity: Entity, whole: Entity) -> bool:
    """Whether an entity is another or stands below it."""
    found: Entity | None = entity
    while found is not None:
        if found == whole:
            return True
        found = found.parent
    return False
