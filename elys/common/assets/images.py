"""Images as the bytes of their files: decoded where they are drawn, not here."""

from __future__ import annotations

import struct
import zlib
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError

IMAGE_SUFFIXES: Final = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".hdr", ".exr")
MAX_FILE_SIZE: Final = 1 << 30  # [B]


def image_format(data: bytes) -> str:
    """What kind of image file the bytes are, by their first ones: "png", "jpeg", "webp", "bmp", "hdr", "exr", or "" for none."""
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return "png"
    if data[:3] == b"\xff\xd8\xff":
        return "jpeg"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "webp"
    if data[:2] == b"BM":
        return "bmp"
    if data[:10] == b"#?RADIANCE" or data[:6] == b"#?RGBE":
        return "hdr"
    if data[:4] == b"\x76\x2f\x31\x01":
        return "exr"
    return ""


@lru_cache(maxsize=1)
def placeholder_image() -> bytes:
    """A PNG of 64 x 64 pixels in a magenta checker: what is seen where an image cannot be had."""
    size, cell = 64, 8
    odd = np.add.outer(np.arange(size) // cell, np.arange(size) // cell) % 2
    pixels = np.where(odd[..., None] == 0, (255, 0, 200), (20, 0, 16)).astype(np.uint8)
    rows = np.concatenate((np.zeros((size, 1), np.uint8), pixels.reshape(size, -1)), axis=1)
    header = struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def read_image(path: Path, assets: AssetStore) -> str:
    """Puts an image file into the store and returns its reference; raises AssetError if it is missing or no image."""
    data = read_asset_file(path, what="image")
    if not image_format(data):
        raise AssetError(f"{path} is not an image that ELYS knows ({', '.join(IMAGE_SUFFIXES)})")
    return assets.put(data, kind="image", source=str(path))


def read_asset_file(path: Path, *, what: str) -> bytes:
    """The bytes of a file; raises AssetError with one sentence about why not."""
    try:
        if path.is_dir():
            raise AssetError(f"{path} is a directory, not {what} data")
        if path.stat().st_size > MAX_FILE_SIZE:
            raise AssetError(f"{path} is larger than {MAX_FILE_SIZE >> 30} GiB")
        return path.read_bytes()
    except FileNotFoundError:
        raise AssetError(f"the {what} file {path} does not exist") from None
    except OSError as error:
        raise AssetError(f"the {what} file {path} cannot be read: {error.strerror}") from error
    except ValueError as error:  # a NUL byte in the path
        raise AssetError(f"{str(path)!r} is not a path: {error}") from error
