"""What pieces tell: one class an event, told to all under its name in small letters, `DoorOpened` as "door_opened".

Entities are told by their ids, so that an event can go over the bus: `self.world.entity(event.values["by"])`.
"""

import re
from typing import NamedTuple

from elys.script import Behaviour, Entity


class Signal(NamedTuple):
    """A name that is on or off: what links pieces, see signals.py."""

    name: str
    on: bool


class ButtonPressed(NamedTuple):
    """A button went down under somebody."""

    button: int
    by: int


class ButtonReleased(NamedTuple):
    """It came up again."""

    button: int


class DoorOpened(NamedTuple):
    """A door stands open."""

    door: int


class DoorClosed(NamedTuple):
    """A door is shut."""

    door: int


class PlatformArrived(NamedTuple):
    """A platform is at a point of its path, counted from 0."""

    platform: int
    point: int


class RotatorTurned(NamedTuple):
    """A rotator that swings is at an end of its way, or one that turns has made another round."""

    rotator: int
    times: int


class Spawned(NamedTuple):
    """A spawner has made something, its `times`th from 1 on."""

    spawner: int
    entity: int
    times: int


class TimerRang(NamedTuple):
    """A timer is over, for the `times`th time from 1 on."""

    timer: int
    times: int


class CheckpointReached(NamedTuple):
    """Somebody came to a checkpoint: who has a Respawn comes back there."""

    checkpoint: int
    by: int
    number: int
    x: float  # [m] where to come back
    y: float
    z: float


class Killed(NamedTuple):
    """Somebody came into a zone that kills."""

    zone: int
    entity: int


class Respawned(NamedTuple):
    """Somebody is back, for the `times`th time."""

    entity: int
    times: int


class Collected(NamedTuple):
    """Somebody took a thing that is worth something."""

    collectible: int
    by: int
    kind: str
    value: int


class ZoneEntered(NamedTuple):
    """A body came into a force zone."""

    zone: int
    entity: int


class ZoneLeft(NamedTuple):
    """A body left a force zone."""

    zone: int
    entity: int


class Broken(NamedTuple):
    """Something broke under a blow."""

    entity: int
    by: int
    impulse: float  # [N s]


class GatePassed(NamedTuple):
    """Somebody went through a gate."""

    gate: int
    by: int
    number: int
    time: float  # [s] of the simulation


class GoalReached(NamedTuple):
    """Somebody came to the goal and had passed all gates."""

    goal: int
    by: int
    time: float  # [s] of the simulation


def kind_of(event: type[NamedTuple]) -> str:
    """What an event is called when it is told."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", event.__name__).lower()


def tell(teller: Behaviour, event: NamedTuple, to: Entity | None = None) -> None:
    """Tells an event: to all, or to one entity."""
    teller.world.emit(kind_of(type(event)), to, **event._asdict())
