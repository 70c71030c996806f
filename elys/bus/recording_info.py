"""The facts about a recording: what is in it, where it came from, and what it lacks."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import msgspec
import numpy as np

from elys.bus.recording import Recording
from elys.bus.transports.mcap import METADATA_NAME


class ChannelInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One channel of a recording."""

    name: str
    count: int
    bytes: int
    rate: float  # [Hz] of simulation time


class RecordingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What there is to say of a recording."""

    path: str
    size: int  # [bytes]
    complete: bool  # False: it was never finished, and is read as far as it goes
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


def recording_info(path: Path) -> RecordingInfo:
    """The facts about a recording; RecordingError if it is none."""
    with Recording(path) as recording:
        mirror = recording.mirror_at(0)
        made = recording.reader.metadata[METADATA_NAME]
        duration = float(recording.time[-1] - recording.time[0])
        return RecordingInfo(
            path=str(path),
            size=recording.reader.size,
            complete=not recording.reader.mended,
            scene=mirror.scene,
            session=made.get("session", ""),
            elys_version=made.get("elys", ""),
            protocol=int(made["protocol"]),
            started=_nanoseconds(made.get("started_ns", "")) / 1e9,
            duration=duration,
            ticks=len(np.unique(recording.tick)),
            first_tick=int(recording.tick[0]),
            last_tick=int(recording.tick[-1]),
            tick_rate=mirror.settings.tick_rate,
            body_count=int(recording.body_count.max()),
            entity_count=len(mirror.entities),
            asset_count=len(recording.asset_references()),
            channels=_channels(recording, duration),
        )


def _channels(recording: Recording, duration: float) -> tuple[ChannelInfo, ...]:
    sizes: Counter[str] = Counter()
    within: Counter[str] = Counter()
    for message in recording.reader.messages():
        sizes[message.channel] += len(message.body)
        within[message.channel] += recording.is_within(message)
    counts = recording.reader.message_counts()
    return tuple(
        ChannelInfo(name=name, count=count, bytes=sizes[name], rate=within[name] / duration if duration > 0.0 else 0.0)
        for name, count in counts.items()
    )


def _nanoseconds(text: str) -> int:
    return int(text) if text.isdigit() else 0
