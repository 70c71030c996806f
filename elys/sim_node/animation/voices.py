"""Who plays what, and how much of it is heard: clips that come in, go on and fade out, as rows that a state holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from elys.sim_node.animation.clip_library import ClipKey

_COLUMNS: Final = {
    "entity": np.uint32,
    "time": np.float64,  # [s] in the clip, of a ping-pong there and back
    "rate": np.float64,  # [s/s] at which it goes on
    "loop": np.uint8,
    "weight": np.float64,
    "target": np.float64,  # what the weight becomes
    "left": np.float64,  # [s] until then
    "is_wanted": np.bool_,  # by the component; what is not fades out
}
_GONE: Final = 1e-12  # a weight of nothing


@dataclass(slots=True, kw_only=True)
class Voice:
    """One clip that an entity plays; as a row of `Voices`."""

    key: ClipKey
    entity: int
    time: float = 0.0
    rate: float = 0.0
    loop: int = 0
    weight: float = 0.0
    target: float = 0.0
    left: float = 0.0
    is_wanted: bool = True


class Voices:
    """Rows of [V] voices; those of one entity stand together, older ones first."""

    def __init__(self) -> None:
        self.keys: list[ClipKey] = []
        self.entity = np.zeros(0, np.uint32)
        self.time = np.zeros(0)
        self.rate = np.zeros(0)
        self.loop = np.zeros(0, np.uint8)
        self.weight = np.zeros(0)
        self.target = np.zeros(0)
        self.left = np.zeros(0)
        self.is_wanted = np.zeros(0, np.bool_)

    def __len__(self) -> int:
        return len(self.keys)

    def by_entity(self) -> dict[int, list[Voice]]:
        """All of them, to be changed and put back."""
        found: dict[int, list[Voice]] = {}
        columns = [getattr(self, name).tolist() for name in _COLUMNS]
        for key, *values in zip(self.keys, *columns, strict=True):
            voice = Voice(key=key, **dict(zip(_COLUMNS, values, strict=True)))
            found.setdefault(voice.entity, []).append(voice)
        return found

    def put(self, voices: list[Voice]) -> None:
        """Makes these all there are."""
        self.keys = [voice.key for voice in voices]
        for name, dtype in _COLUMNS.items():
            setattr(self, name, np.array([getattr(voice, name) for voice in voices], dtype))

    def fade(self, seconds: float) -> None:
        """Brings weights nearer to what they become: evenly, to be there when their time is up."""
        due = self.left <= seconds
        share = np.where(due, 1.0, seconds / np.where(due, 1.0, self.left))
        self.weight = np.where(due, self.target, self.weight + (self.target - self.weight) * share)
        self.left = np.where(due, 0.0, self.left - seconds)

    def drop_gone(self) -> bool:
        """Takes away what has faded out; returns whether anything had."""
        kept = self.is_wanted | (self.weight > _GONE)
        if kept.all():
            return False
        self.keys = [key for key, is_kept in zip(self.keys, kept.tolist(), strict=True) if is_kept]
        for name in _COLUMNS:
            setattr(self, name, getattr(self, name)[kept])
        return True


def changed(
    present: list[Voice], entity: int, wanted: Mapping[ClipKey, float], *, fade: float, loop: int
) -> list[Voice]:
    """The voices of an entity when it shall play `wanted`, clips with their weights, and plays `present`.

    What it plays already goes on; the rest comes in, and what is not wanted goes out, in `fade` seconds.
    """
    playing = {voice.key: voice for voice in present if voice.is_wanted}
    weights = {key: voice.target for key, voice in playing.items()}
    if list(weights) == list(wanted) and weights == wanted:
        return present
    if fade <= 0.0 or not present:
        kept = [playing.get(key, Voice(key=key, entity=entity, loop=loop)) for key in wanted]
        for voice, weight in zip(kept, wanted.values(), strict=True):
            voice.weight, voice.target, voice.left = weight, weight, 0.0
        return kept
    for voice in present:
        if voice.key not in wanted or not voice.is_wanted:
            voice.is_wanted, voice.target = False, 0.0
        voice.left = fade
    leaving = [voice for voice in present if not voice.is_wanted]
    coming = []
    for key, weight in wanted.items():
        voice = playing.get(key, Voice(key=key, entity=entity, loop=loop))
        voice.target, voice.left = weight, fade
        coming.append(voice)
    return leaving + coming
