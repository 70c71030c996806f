"""The facts about a recording: what is in it, where it came from, and what it lacks."""

from __future__ import annotations

import contextlib
from collections import Counter
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from elys.bus.lineage import lineage_of
from elys.bus.recording import Recording
from elys.bus.recording_parts import gaps_in
from elys.bus.recording_sources import Sources, read_sources, seconds_of
from elys.bus.recording_storage import StateStorage, state_storage
from elys.bus.transports.mcap import METADATA_NAME
from elys.bus.transports.mcap_index import DELTA_CHANNEL, STATE_CHANNEL

GAPS_TOLD: Final = 20


class ChannelInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One channel of a recording."""

    name: str
    count: int
    bytes: int
    rate: float  # [Hz] of simulation time


class Health(msgspec.Struct, frozen=True, kw_only=True):
    """What a recording lacks, and what is not in its order."""

    complete: bool  # False: it was never finished, or is damaged, and is read as far as it goes
    damage: tuple[str, ...]  # which parts cannot be read, and which ticks are missing for them
    gaps: tuple[tuple[int, int], ...]  # ticks between which there are none; the first GAPS_TOLD
    missing_ticks: int
    missing_deltas: int  # changes of the scene that no delta tells of; a snapshot may
    out_of_order: int  # messages that were recorded after one with a later time
    other_frames: int  # frames of other runs, or told again: they are not on the timeline

    @property
    def sentence(self) -> str:
        """The same for a person; "" where there is nothing to say."""
        told = []
        if self.damage:
            parts = f", and {len(self.damage) - 1} more parts" * (len(self.damage) > 1)
            told.append(f"{self.damage[0]}{parts}: `elys recover` writes a whole file of the rest")
        elif not self.complete:
            told.append("it was cut off and is read as far as it goes: `elys recover` mends it")
        if self.missing_ticks:
            (before, after), more = self.gaps[0], len(self.gaps) - 1
            told.append(
                f"{_are(self.missing_ticks, 'tick', 'ticks')} missing, first between {before} and {after}"
                + (f" and in {more} more place{'s' if more > 1 else ''}" if more else "")
            )
        if self.missing_deltas:
            told.append(f"{_are(self.missing_deltas, 'change of the scene', 'changes of the scene')} missing")
        if self.out_of_order:
            told.append(f"{_are(self.out_of_order, 'message', 'messages')} out of order")
        if self.other_frames:
            told.append(
                f"{_are(self.other_frames, 'frame', 'frames')} of another run or of a past that was shown again"
            )
        return "; ".join(told)


def _are(count: int, one: str, many: str) -> str:
    return f"1 {one} is" if count == 1 else f"{count} {many} are"


class RecordingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What there is to say of a recording."""

    path: str
    size: int  # [bytes]
    complete: bool  # False: it was never finished, or is damaged, and is read as far as it goes
    scene: str
    session: str
    elys_version: str
    protocol: int
    started: float  # [s] since 1970
    duration: float  # [s] of simulation
    ticks: int
    first_tick: int
    last_tick: int
    tick_rate: int  # [Hz]
    body_count: int
    entity_count: int
    asset_count: int
    channels: tuple[ChannelInfo, ...]
    states: StateStorage
    health: Health
    sources: Sources | None = None  # what it was made of, where it was not recorded as it is
    lineage: dict[str, str] = {}  # of which recording the session was a fork, and at which instant


def recording_info(path: Path) -> RecordingInfo:
    """The facts about a recording; RecordingError if it is none."""
    with Recording(path, checked=True) as recording:
        mirror = recording.mirror_at(0)
        made = recording.reader.metadata[METADATA_NAME]
        duration = float(recording.time[-1] - recording.time[0])
        found = _Reading(recording)
        return RecordingInfo(
            path=str(path),
            size=recording.reader.size,
            complete=_is_complete(recording),
            scene=mirror.scene,
            session=made.get("session", ""),
            elys_version=made.get("elys", ""),
            protocol=int(made["protocol"]),
            started=seconds_of(made.get("started_ns", "")),
            duration=duration,
            ticks=len(np.unique(recording.tick)),
            first_tick=int(recording.tick[0]),
            last_tick=int(recording.tick[-1]),
            tick_rate=mirror.settings.tick_rate,
            body_count=int(recording.body_count.max()),
            entity_count=len(mirror.entities),
            asset_count=len(recording.asset_references()),
            channels=found.channels(duration),
            states=state_storage(recording),
            health=found.health(),
            sources=read_sources(recording.reader),
            lineage=lineage_of(recording),
        )


def _is_complete(recording: Recording) -> bool:
    return not (recording.reader.mended or recording.lost)


class _Head(msgspec.Struct):
    epoch: int
    sequence: int


class _Reading:
    """Reads all messages of a recording once."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._sizes: Counter[str] = Counter()
        self._within: Counter[str] = Counter()
        self._out_of_order = 0
        self._deltas: set[int] = set()
        self._frames = 0
        heads = msgspec.json.Decoder(_Head)
        latest = 0
        for message in recording.reader.stored_messages():
            is_within = recording.is_within(message)
            self._sizes[message.channel] += len(message.body)
            self._within[message.channel] += is_within
            self._out_of_order += message.log_time < latest
            latest = max(latest, message.log_time)
            self._frames += message.channel == STATE_CHANNEL
            if message.channel == DELTA_CHANNEL and is_within:
                with contextlib.suppress(msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                    self._deltas.add(heads.decode(message.body).sequence)

    def channels(self, duration: float) -> tuple[ChannelInfo, ...]:
        """What each channel has."""
        return tuple(
            ChannelInfo(
                name=name,
                count=count,
                bytes=self._sizes[name],
                rate=self._within[name] / duration if duration > 0.0 else 0.0,
            )
            for name, count in self._recording.reader.message_counts().items()
        )

    def health(self) -> Health:
        """What is not there, or not in order."""
        ticks = self._recording.tick
        gaps = gaps_in(ticks[np.append(True, ticks[1:] != ticks[:-1])].tolist())
        missing_deltas = max(self._deltas) - min(self._deltas) + 1 - len(self._deltas) if self._deltas else 0
        return Health(
            complete=_is_complete(self._recording),
            damage=tuple(lost.sentence for lost in self._recording.lost),
            gaps=gaps[:GAPS_TOLD],
            missing_ticks=sum(after - before - 1 for before, after in gaps),
            missing_deltas=missing_deltas,
            out_of_order=self._out_of_order,
            other_frames=self._frames - len(self._recording),
        )
