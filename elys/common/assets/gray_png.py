"""Grayscale PNG files as arrays, of 8 or 16 bits, without an imaging library: a simulation needs none.

Portable Network Graphics Specification, third edition (W3C 2025): chunks in section 5, filters in section 9.
"""

from __future__ import annotations

import struct
import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import AssetError

SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_HEADER: Final = struct.Struct(">IIBBBBB")
_GRAY: Final = 0  # colour type


def decode_gray_png(data: bytes, *, most_pixels: int) -> NDArray[np.float64]:
    """The pixels (H, W) from 0, black, to 1, white; H * W at most `most_pixels`.

    Raises:
        AssetError: it is no PNG, damaged, coloured, interlaced or too large.
    """
    chunks = _chunks(data)
    if len(chunks.get(b"IHDR", b"")) != _HEADER.size:
        raise AssetError("it is no PNG, or damaged: it has no header")
    width, height, depth, color, _, _, interlace = _HEADER.unpack(chunks[b"IHDR"])
    if color != _GRAY:
        raise AssetError(
            "it is a PNG in colour or with transparency; save it as grayscale, of 16 bits for smooth ground"
        )
    if depth not in (8, 16):
        raise AssetError(f"it has {depth} bits a pixel; save it with 16")
    if interlace:
        raise AssetError("it is interlaced; save it without")
    if not 0 < width * height <= most_pixels:
        raise AssetError(f"it has {width} x {height} pixels; there may be {most_pixels} in all")
    rows = _unfiltered(_inflated(chunks.get(b"IDAT", b""), height * (1 + width * depth // 8)), height, depth // 8)
    values = rows.view(">u2" if depth == 16 else np.uint8)
    return values / np.float64(2**depth - 1)


def _chunks(data: bytes) -> dict[bytes, bytes]:
    """The content of a file by the names of its chunks; several of one name are put together."""
    if data[: len(SIGNATURE)] != SIGNATURE:
        raise AssetError("it is no PNG")
    parts: dict[bytes, list[bytes]] = {}
    at = len(SIGNATURE)
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        parts.setdefault(data[at + 4 : at + 8], []).append(data[at + 8 : at + 8 + size])
        at += 12 + size
    return {name: b"".join(pieces) for name, pieces in parts.items()}


def _inflated(packed: bytes, size: int) -> bytes:
    """`size` bytes and no more, whatever the file claims to hold."""
    try:
        data = zlib.decompressobj().decompress(packed, size)
    except zlib.error as error:
        raise AssetError(f"it is damaged: {error}") from error
    if len(data) != size:
        raise AssetError("it is damaged: its pixels end too early")
    return data


def _unfiltered(data: bytes, height: int, step: int) -> NDArray[np.uint8]:
    """Rows (H, bytes a row) of pixels of `step` bytes, each row's filter undone."""
    packed = np.frombuffer(data, np.uint8).reshape(height, -1)
    rows = np.zeros((height, packed.shape[1] - 1), np.uint8)
    above = np.zeros(rows.shape[1], np.uint8)
    for place, (kind, *_) in enumerate(packed[:, :1].tolist()):
        row = packed[place, 1:]
        match kind:
            case 0:
                rows[place] = row
            case 1:
                rows[place] = np.add.accumulate(row.reshape(-1, step), axis=0, dtype=np.uint8).reshape(-1)
            case 2:
                rows[place] = row + above
            case 3:
                rows[place] = _averaged(row.tolist(), above.tolist(), step)
            case 4:
                rows[place] = _paeth(row.tolist(), above.tolist(), step)
            case _:
                raise AssetError(f"it is damaged: row {place} has the filter {kind}")
        above = rows[place]
    return rows


def _averaged(row: list[int], above: list[int], step: int) -> list[int]:
    for k, up in enumerate(above):
        left = row[k - step] if k >= step else 0
        row[k] = (row[k] + (left + up) // 2) & 255
    return row


def _paeth(row: list[int], above: list[int], step: int) -> list[int]:
    for k, up in enumerate(above):
        left, corner = (row[k - step], above[k - step]) if k >= step else (0, 0)
        by_left, by_up, by_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
        if by_left <= by_up and by_left <= by_corner:
            guess = left
        else:
            guess = up if by_up <= by_corner else corner
        row[k] = (row[k] + guess) & 255
    return row
