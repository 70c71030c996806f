"""Clips of movement as arrays, and as the bytes by which all clips of a model are stored, hashed and sent.

The bytes are a `container` with the magic "ELYC". Its header has the clips and their channels; of each channel its times,
then its values, follow as float32.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from elys.common.assets.container import Container
from elys.common.errors import AssetError

FloatArray = NDArray[np.float32]
Property = Literal["position", "rotation", "scale", "weights"]
Interpolation = Literal["step", "linear", "cubic"]

# Numbers a key has; of weights as many as the mesh has morph targets.
WIDTHS: Final = {"position": 3, "rotation": 4, "scale": 3}


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


_BYTES: Final = Container(magic=b"ELYC", version=1, header=_Header, noun="clips", largest_header=1 << 26)


def encode_clips(clips: Sequence[Clip]) -> bytes:
    """The bytes of clips: the same arrays always give the same bytes."""
    header = _Header([_ClipHeader(clip.name, [_head(channel) for channel in clip.channels]) for clip in clips])
    arrays = [array for clip in clips for channel in clip.channels for array in (channel.times, channel.values)]
    return _BYTES.encode(header, [np.asarray(array, np.float32) for array in arrays])


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


def clip_names(data: bytes) -> tuple[str, ...]:
    """The names of the clips in their bytes, in order, for who needs no more; AssetError where the header is not sound."""
    header, _ = _decode_header(data)
    return tuple(dict.fromkeys(clip.name for clip in header.clips))


def _head(channel: Channel) -> _ChannelHeader:
    return _ChannelHeader(
        channel.target, channel.property, channel.interpolation, len(channel.times), channel.values.shape[-1]
    )


def _shape(head: _ChannelHeader) -> tuple[int, ...]:
    return (head.keys, 3, head.width) if head.interpolation == "cubic" else (head.keys, head.width)


def _decode_header(data: bytes) -> tuple[_Header, int]:
    header, offset = _BYTES.decode(data)
    count = 0
    for clip in header.clips:
        for head in clip.channels:
            if head.width != WIDTHS.get(head.property, head.width):
                raise AssetError(f"clip '{clip.name}' has a {head.property} of {head.width} numbers")
            count += head.keys * (1 + head.width * (3 if head.interpolation == "cubic" else 1))
    if offset + 4 * count != len(data):
        raise AssetError(f"clips have {len(data)} bytes where their header says {offset + 4 * count}")
    return header, offset
