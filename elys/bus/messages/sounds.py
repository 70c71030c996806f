"""Single sounds, as events of the kind "sound" tell them: played once, where the camera of who watches hears them."""

from __future__ import annotations

import math
from typing import Final

import msgspec

from elys.bus.messages.session import Event
from elys.common.components import Vec3
from elys.common.components.sound import FASTEST_PITCH, LOUDEST, SLOWEST_PITCH

SOUND: Final = "sound"  # the kind of the events
NAME_LENGTH: Final = 256  # characters


class Sound(msgspec.Struct, frozen=True, kw_only=True):
    """What is played: a built in sound or the reference of a file; without a position on both sides alike."""

    sound: str
    volume: float = 1.0
    pitch: float = 1.0
    position: Vec3 | None = None  # [m]
    reference_distance: float = 2.0  # [m] up to which it is as loud as it is
    max_distance: float = 0.0  # [m] from which on it is not heard; 0: heard from anywhere

    def problem(self) -> str:
        """What is wrong with it, in words; "" if nothing is."""
        if not self.sound or len(self.sound) > NAME_LENGTH:
            return f"a sound is named by 1 to {NAME_LENGTH} characters"
        if not 0.0 <= self.volume <= LOUDEST:
            return f"the volume of a sound lies between 0 and {LOUDEST:g}, not at {self.volume:g}"
        if not SLOWEST_PITCH <= self.pitch <= FASTEST_PITCH:
            return f"the pitch of a sound lies between {SLOWEST_PITCH:g} and {FASTEST_PITCH:g}, not at {self.pitch:g}"
        if not (0.01 <= self.reference_distance < math.inf and 0.0 <= self.max_distance < math.inf):
            return "the reference_distance of a sound is at least 0.01 m, its max_distance 0 or more"
        if self.position is not None and not all(map(math.isfinite, self.position)):
            return "the position of a sound is three finite numbers"
        return ""


def event_of(sound: Sound, entity: int = 0) -> Event:
    """The event that tells a sound, of an entity or of none."""
    values = {name: value for name, value in msgspec.structs.asdict(sound).items() if value is not None}
    return Event(kind=SOUND, entity=entity, values=values)


def sound_of(event: Event) -> Sound | None:
    """The sound that an event tells; None for another event, and for what is no sound that can be played."""
    if event.kind != SOUND:
        return None
    try:
        sound = msgspec.convert(event.values, Sound)
    except msgspec.ValidationError:
        return None
    return None if sound.problem() else sound
