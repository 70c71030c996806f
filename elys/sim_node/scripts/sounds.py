"""What scripts let be heard: events of the kind "sound", which decide nothing in the simulation."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from elys.bus.messages.sounds import Sound, event_of
from elys.common.assets.sounds import read_sound
from elys.common.assets.store import is_reference
from elys.common.components.sound import BUILT_IN_SOUNDS
from elys.common.errors import AssetError, ScriptError

if TYPE_CHECKING:
    from elys.bus.messages.session import Event
    from elys.sim_node.simulation import Simulation

MOST: Final = 256  # in a tick; a script that plays more fails
_log = logging.getLogger(__name__)


class ScriptSounds:
    """Makes events of what scripts play. Files are read when they are first played, from beside the scene."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._references: dict[str, str] = {}
        self._tick, self._count = -1, 0
        self._told: list[Event] = []

    def take(self) -> list[Event]:
        """What was played since this was last asked."""
        told, self._told = self._told, []
        return told

    def play(self, name: str, entity: int, values: dict[str, Any]) -> None:
        """Lets a sound be heard by who watches; in the simulation nothing comes of it.

        Raises:
            ScriptError: there are too many in this tick. TypeError, ValueError: a value is none that a sound can have.
        """
        if not isinstance(name, str):
            raise TypeError(f"a sound is named by a text, not by {name!r}")
        try:
            sound = msgspec.convert({"sound": name, **values}, Sound)
        except msgspec.ValidationError as error:
            raise TypeError(f"the sound {name!r} cannot be played: {error}") from None
        if problem := sound.problem():
            raise ValueError(problem)
        if self._simulation.tick != self._tick:
            self._tick, self._count = self._simulation.tick, 0
        self._count += 1
        if self._count > MOST:
            raise ScriptError(f"more than {MOST} sounds were played in one tick")
        self._told.append(event_of(msgspec.structs.replace(sound, sound=self._reference(name)), entity))

    def _reference(self, name: str) -> str:
        """What others find the sound by; the name itself where there is none: whether there is a file changes no run."""
        if name in BUILT_IN_SOUNDS or is_reference(name):
            return name
        found = self._references.get(name)
        if found is None:
            folder = Path(self._simulation.path).parent
            try:
                found = read_sound(folder / name, self._simulation.assets)
            except (AssetError, ValueError, OSError) as error:
                _log.warning(
                    "a script plays %r, which is not heard: %s; built in are %s",
                    name,
                    error,
                    ", ".join(BUILT_IN_SOUNDS),
                )
                found = name
            self._references[name] = found
        return found
