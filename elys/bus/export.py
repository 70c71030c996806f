"""A recording for other programs: arrays of every body's motion, and the facts about it."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus import codec, topics
from elys.bus.messages.physics import Diagnostics
from elys.bus.recording import Recording
from elys.bus.recording_storage import StateStorage, state_storage
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import METADATA_NAME
from elys.common.errors import RecordingError

_COLUMNS: Final = {
    "position": (3, "f8"),
    "rotation": (4, "f4"),
    "linear_velocity": (3, "f4"),
    "angular_velocity": (3, "f4"),
}


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
    states: StateStorage


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
            states=state_storage(recording),
        )


def export_npz(source: Path, target: Path) -> dict[str, tuple[int, ...]]:
    """Writes every body's motion as arrays; returns their shapes.

    time [T] s, tick [T], name [N], entity [N], position [T, N, 3] m, rotation [T, N, 4] x y z w, linear_velocity [T, N, 3]
    m/s and angular_velocity [T, N, 3] rad/s. N are all bodies there ever were; NaN where one was not there. Where diagnostics
    were recorded: energy [T] J, momentum [T, 3] kg m/s, angular_momentum [T, 3] kg m^2/s, overlap [T] m, joint_error [T] m
    and residual [T] m/s.

    Raises:
        RecordingError: the source is no recording, or the target cannot be written.
    """
    with Recording(source) as recording:
        arrays = motion_arrays(recording)
    try:
        with target.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror}") from error
    return {name: array.shape for name, array in arrays.items()}


def motion_arrays(recording: Recording) -> dict[str, NDArray[Any]]:
    """The arrays that `export_npz` writes; of several frames of one tick the last."""
    is_last = np.append(recording.tick[1:] != recording.tick[:-1], True)
    positions = np.flatnonzero(is_last).tolist()
    entities = np.unique(np.concatenate([recording.frame(index).entity for index in positions]))
    shape = (len(positions), len(entities))
    try:
        arrays: dict[str, NDArray[Any]] = {
            name: np.full((*shape, width), np.nan, dtype) for name, (width, dtype) in _COLUMNS.items()
        }
    except MemoryError as error:
        raise RecordingError(f"{shape[0]} ticks of {shape[1]} bodies do not fit into the memory as arrays") from error
    for row, index in enumerate(positions):
        frame = recording.frame(index)
        bodies = np.searchsorted(entities, frame.entity)
        for name, array in arrays.items():
            array[row, bodies] = getattr(frame, name)
    return {
        "time": recording.time[positions],
        "tick": recording.tick[positions],
        "name": np.array(_names(recording, positions, entities)),
        "entity": entities,
        **arrays,
        **_diagnostics(recording, recording.tick[positions]),
    }


def _diagnostics(recording: Recording, ticks: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """What was measured in each tick [T], NaN where nothing was; no arrays where nothing was at all."""
    found: dict[int, Diagnostics] = {}
    for message in recording.reader.messages((topics.DIAGNOSTICS.name,)):
        if recording.is_within(message):
            measured = codec.decode_body(message.body, Diagnostics, Encoding.JSON)
            found[measured.tick] = measured
    if not found:
        return {}
    told = sorted(found)
    # What is not told is as it was.
    places = np.searchsorted(told, ticks, side="right").tolist()
    rows = [found[told[place - 1]] if place else None for place in places]
    nothing = (np.nan,) * 3
    return {
        "energy": np.array([np.nan if row is None else row.kinetic + row.potential for row in rows]),
        "momentum": np.array([nothing if row is None else row.momentum for row in rows]),
        "angular_momentum": np.array([nothing if row is None else row.angular_momentum for row in rows]),
        "overlap": np.array([np.nan if row is None else row.deepest_overlap for row in rows]),
        "joint_error": np.array([np.nan if row is None else row.joint_error for row in rows]),
        "residual": np.array([np.nan if row is None else row.residual for row in rows]),
    }


def _names(recording: Recording, positions: list[int], entities: NDArray[Any]) -> list[str]:
    """What each entity was called when it was last there."""
    names: dict[int, str] = {}
    mirror = recording.mirror_at(positions[0])
    names.update((entity.id, entity.name) for entity in mirror.entities.values())
    for index in positions[1:]:
        followed = recording.advance(mirror, index)
        if followed is None or followed:
            names.update((entity.id, entity.name) for entity in mirror.entities.values())
    return [names.get(entity, "") for entity in entities.tolist()]


def _channels(recording: Recording, duration: float) -> tuple[ChannelInfo, ...]:
    sizes: Counter[str] = Counter()
    within: Counter[str] = Counter()
    for message in recording.reader.stored_messages():
        sizes[message.channel] += len(message.body)
        within[message.channel] += recording.is_within(message)
    counts = recording.reader.message_counts()
    return tuple(
        ChannelInfo(name=name, count=count, bytes=sizes[name], rate=within[name] / duration if duration > 0.0 else 0.0)
        for name, count in counts.items()
    )


def _nanoseconds(text: str) -> int:
    return int(text) if text.isdigit() else 0
