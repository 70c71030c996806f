"""How a recording keeps its state frames: to the last bit or in steps, what that may be off by, and what it saves."""

from __future__ import annotations

from typing import Final

import msgspec

from elys.bus.messages.state_frame import BODY_SIZE, HEADER
from elys.bus.rate_budget import THINNED
from elys.bus.recording import Recording
from elys.bus.state_packing import compact
from elys.bus.state_packing.frames import STATE_ENCODING
from elys.bus.topics import STATE
from elys.bus.transports.mcap import METADATA_NAME

_UNPACKED: Final = "elys.state.v1"


class StateStorage(msgspec.Struct, frozen=True, kw_only=True):
    """What there is to say of stored frames."""

    encoding: str
    compact: bool
    position_error: float = 0.0  # [m] at most
    rotation_error: float = 0.0  # [degrees] at most
    linear_velocity_error: float = 0.0  # [m/s] at most
    angular_velocity_error: float = 0.0  # [rad/s] at most
    stored: int  # [bytes] of all frames before the file's own compression
    as_said: int  # [bytes] as they were on the bus
    limit_rate: int = 0  # [bytes/s] below which the recording was to stay, where something was left out for it


def state_storage(recording: Recording) -> StateStorage:
    """How the frames of a recording are stored; RecordingError if a chunk is damaged."""
    stored = as_said = 0
    for message in recording.reader.stored_messages((STATE.name,)):
        stored += len(message.body)
        if len(message.body) < HEADER.size:
            continue  # damaged: readers say so where they need it
        as_said += HEADER.size + HEADER.unpack_from(message.body)[6] * BODY_SIZE
    is_compact = recording.reader.metadata[METADATA_NAME].get("state") == "compact"
    errors = {
        "position_error": compact.POSITION_ERROR,
        "rotation_error": compact.ROTATION_ERROR,
        "linear_velocity_error": compact.LINEAR_ERROR,
        "angular_velocity_error": compact.ANGULAR_ERROR,
    }
    return StateStorage(
        encoding=STATE_ENCODING if recording.reader.packs_frames else _UNPACKED,
        compact=is_compact,
        stored=stored,
        as_said=as_said,
        limit_rate=_limit_of(recording),
        **(errors if is_compact else {}),
    )


def describe(storage: StateStorage) -> str:
    """A line about it."""
    how = "lossless"
    if storage.compact:
        how = (
            f"compact: positions within {1e3 * storage.position_error:.2g} mm, rotations {storage.rotation_error:.2g} degrees, "
            f"velocities {1e3 * storage.linear_velocity_error:.2g} mm/s and {1e3 * storage.angular_velocity_error:.2g} mrad/s"
        )
    line = (
        f"states {storage.encoding}, {how}; {100.0 * storage.stored / max(storage.as_said, 1):.1f} % of what was said"
    )
    if storage.limit_rate:
        line += f"; thinned to stay below {storage.limit_rate / 1e6:g} MB/s"
    return line


def _limit_of(recording: Recording) -> int:
    text = recording.reader.metadata.get(THINNED, {}).get("limit_rate", "")
    return int(text) if text.isdecimal() and len(text) < 20 else 0
