"""The form that meshes, clips and skins share as bytes: what they are, a header in JSON, then arrays.

    bytes     0  magic (4 bytes), u16 version, u16 zero
              8  u32 length of the header
             12  header, a JSON object, padded with spaces to a multiple of 4 bytes
                 arrays of 4-byte numbers, as the header says

All little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.errors import AssetError

H = TypeVar("H")
_PROLOGUE: Final = struct.Struct("<4sHHI")


@dataclass(frozen=True, slots=True, kw_only=True)
class Container(Generic[H]):
    """One kind of asset in this form."""

    magic: bytes  # 4
    version: int
    header: type[H]
    noun: str  # what error sentences call it: "a mesh"
    largest_header: int  # [bytes]

    def encode(self, header: H, arrays: Iterable[NDArray[Any]]) -> bytes:
        """The bytes: the same header and arrays always give the same."""
        text = msgspec.json.encode(header)
        text += b" " * (-len(text) % 4)
        prologue = _PROLOGUE.pack(self.magic, self.version, 0, len(text))
        return b"".join(
            (prologue, text, *(np.ascontiguousarray(a, a.dtype.newbyteorder("<")).tobytes() for a in arrays))
        )

    def decode(self, data: bytes) -> tuple[H, int]:
        """The header, and where the arrays begin; raises AssetError for what is not of this kind and version."""
        noun = self.noun
        if len(data) < _PROLOGUE.size:
            raise AssetError(f"not {noun}: {len(data)} bytes are too few")
        magic, version, zero, size = _PROLOGUE.unpack_from(data)
        if magic != self.magic:
            raise AssetError(f"not {noun}: it starts with {magic!r}")
        if version != self.version or zero != 0:
            raise AssetError(f"{noun} of format {version}, this ELYS reads {self.version}")
        offset = _PROLOGUE.size + size
        if size > self.largest_header or size % 4 or offset > len(data):
            raise AssetError(f"{noun} whose header does not fit")
        try:
            return msgspec.json.decode(data[_PROLOGUE.size : offset], type=self.header), offset
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
            raise AssetError(f"{noun} whose header is wrong: {error}") from error
