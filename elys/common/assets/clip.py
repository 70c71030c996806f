"""Clips of movement as arrays, and as the bytes by which all clips of a model are stored, hashed and sent.

    bytes     0  magic "ELYC", u16 version, u16 zero
              8  u32 length of the header, a JSON object with the clips and their channels
             12  header, padded with spaces to a multiple of 4 bytes
                 of each channel in order its times, then its values, as float32

All little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from elys.common.errors import AssetError

FloatArray = NDArray[np.float32]
Property = Literal["position", "rotation", "scale", "weights"]
Interpolation = Literal["step", "linear", "cubic"]

# Numbers a key has; of weights as many as the mesh has morph targets.
WIDTHS: Final = {"position": 3, "rotation": 4, "scale": 3}
_PROLOGUE: Final = struct.Struct("<4sHHI")
_MAGIC: Final = b"ELYC"
_VERSION: Final = 1
_MAX_HEADER: Final = 1 << 26


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel:
    """How one property of one entity goes through K keys.

    Attributes:
        target: names from below the entity that plays the clip down to the one that moves; empty for itself.
        times: [K] s, rising. values: [K, width], of a cubic spline [K, 3, width] with the tangent that comes in, the value and
            the tangent that goes out.
    """

    target: tuple[str, ...]
    property: Property
    interpolation: Interpolation
    times: FloatArray
    values: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clip:
    """Channels that run together."""

    name: str
    channels: tuple[Channel, ...]

    @property
    def duration(self) -> float:
        """Time of the last key [s]; 0 of a clip without keys."""
        return max((float(channel.times[-1]) for channel in self.channels), default=0.0)


Count = Annotated[int, Meta(ge=1, le=1 << 28)]


class _ChannelHeader(msgspec.Struct, forbid_unknown_fields=True):
    target: tuple[str, ...]
    property: Property
    interpolation: Interpolation
    keys: Count
    width: Count


class _ClipHeader(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    channels: list[_ChannelHeader]


class _Header(msgspec.Struct, forbid_unknown_fields=True):
    clips: list[_ClipHeader]


def encode_clips(clips: Sequence[Clip]) -> bytes:
    """The bytes of clips: the same arrays always give the same bytes."""
    header = msgspec.json.encode(_Header([_ClipHeader(clip.name, [_head(c) for c in clip.channels]) for clip in clips]))
    header += b" " * (-len(header) % 4)
    parts = [_PROLOGUE.pack(_MAGIC, _VERSION, 0, len(header)), header]
    for clip in clips:
        for channel in clip.channels:
            parts += [np.ascontiguousarray(array, "<f4").tobytes() for array in (channel.times, channel.values)]
    return b"".join(parts)


def decode_clips(data: bytes) -> tuple[Clip, ...]:
    """The clips in their bytes, arrays as read-only views; raises AssetError for anything that is not whole and sound."""
    header, offset = _decode_header(data)
    numbers = np.frombuffer(data, "<f4", offset=offset)
    if not np.isfinite(numbers).all():
        raise AssetError("clips have numbers that are not finite")
    clips, place = [], 0
    for clip in header.clips:
        channels = []
        for head in clip.channels:
            shape = _shape(head)
            times = numbers[place : place + head.keys]
            place += head.keys
            values = numbers[place : place + int(np.prod(shape))].reshape(shape)
            place += values.size
            if (np.diff(times) <= 0).any() or times[0] < 0:
                raise AssetError(f"clip '{clip.name}' has times that do not rise from 0 on")
            channels.append(
                Channel(
                    target=head.target,
                    property=head.property,
                    interpolation=head.interpolation,
                    times=times,
                    values=values,
                )
            )
        clips.append(Clip(name=clip.name, channels=tuple(channels)))
    return tuple(clips)


def _head(channel: Channel) -> _ChannelHeader:
    return _ChannelHeader(
        channel.target, channel.property, channel.interpolation, len(channel.times), channel.values.shape[-1]
    )


def _shape(head: _ChannelHeader) -> tuple[int, ...]:
    return (head.keys, 3, head.width) if head.interpolation == "cubic" else (head.keys, head.width)


def _decode_header(data: bytes) -> tuple[_Header, int]:
    if len(data) < _PROLOGUE.size:
        raise AssetError(f"no clips: {len(data)} bytes are too few")
    magic, version, zero, header_size = _PROLOGUE.unpack_from(data)
    if magic != _MAGIC:
        raise AssetError(f"no clips: they start with {magic!r}")
    if version != _VERSION or zero != 0:
        raise AssetError(f"clips of format {version}, this ELYS reads {_VERSION}")
    offset = _PROLOGUE.size + header_size
    if header_size > _MAX_HEADER or header_size % 4 or offset > len(data):
        raise AssetError("clips whose header does not fit")
    try:
        header = msgspec.json.decode(data[_PROLOGUE.size : offset], type=_Header)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise AssetError(f"clips whose header is wrong: {error}") from error
    count = 0
    for clip in header.clips:
        for head in clip.channels:
            if head.width != WIDTHS.get(head.property, head.width):
                raise AssetError(f"clip '{clip.name}' has a {head.property} of {head.width} numbers")
            count += head.keys * (1 + head.width * (3 if head.interpolation == "cubic" else 1))
    if offset + 4 * count != len(data):
        raise AssetError(f"clips have {len(data)} bytes where their header says {offset + 4 * count}")
    return header, offset
