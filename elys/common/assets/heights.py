"""Ground as a grid of heights, from a grayscale PNG or a .npy file, and as a mesh to be drawn.

Seen from above as the picture: columns run along x, rows along z. A picture's heights go from 0, black, to 1, white; those of a
.npy file are its numbers.
"""

from __future__ import annotations

import functools
import io
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gray_png import SIGNATURE, decode_gray_png
from elys.common.assets.images import read_asset_file
from elys.common.assets.mesh import Mesh, encode_mesh
from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError

HEIGHT_SUFFIXES: Final = (".png", ".npy")
MOST_HEIGHTS: Final = 1025 * 1025
_KNOWN: Final = 4  # fields that are kept decoded


def read_heights(path: Path, assets: AssetStore) -> str:
    """Puts a file of heights into the store and returns its reference; AssetError if it is missing or holds none."""
    data = _checked(path)
    return assets.put(data, kind="heights", source=str(path))


def read_height_mesh(path: Path, assets: AssetStore) -> str:
    """Puts the mesh of a file of heights into the store: 1 m along x and z about its middle, heights as they are."""
    return assets.put(encode_mesh(height_mesh(decode_heights(_checked(path)))), kind="mesh", source=str(path))


@functools.lru_cache(_KNOWN)
def decode_heights(data: bytes) -> NDArray[np.float64]:
    """The heights (rows along z, columns along x) in a file's bytes, read-only.

    Raises:
        AssetError: it is neither a grayscale PNG nor a .npy file of at least 2 x 2 finite numbers, or too large.
    """
    is_picture = data[: len(SIGNATURE)] == SIGNATURE
    heights = decode_gray_png(data, most_pixels=MOST_HEIGHTS) if is_picture else _decode_array(data)
    if min(heights.shape) < 2:
        raise AssetError(f"it has {heights.shape[0]} x {heights.shape[1]} heights; ground takes at least 2 x 2")
    heights.setflags(write=False)
    return heights


def height_mesh(heights: NDArray[np.float64]) -> Mesh:
    """Ground (M, N) as triangles, split as physics splits them, each corner's normal from its neighbours'."""
    rows, columns = heights.shape
    z, x = np.meshgrid(np.linspace(-0.5, 0.5, rows), np.linspace(-0.5, 0.5, columns), indexing="ij")
    down, right = np.gradient(heights, 1.0 / (rows - 1), 1.0 / (columns - 1))
    normals = np.stack([-right, np.ones_like(heights), -down], axis=-1).reshape(-1, 3)
    here = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    first = np.stack([here, here + columns, here + 1], axis=1)
    second = np.stack([here + 1, here + columns, here + columns + 1], axis=1)
    return Mesh(
        positions=np.stack([x, heights, z], axis=-1).reshape(-1, 3).astype(np.float32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        uvs=np.stack([x + 0.5, z + 0.5], axis=-1).reshape(-1, 2).astype(np.float32),
        indices=np.stack([first, second], axis=1).reshape(-1).astype(np.uint32),
    )


def _checked(path: Path) -> bytes:
    data = read_asset_file(path, what="height")
    try:
        decode_heights(data)
    except AssetError as error:
        raise AssetError(f"{path} holds no heights: {error}") from error
    return data


def _decode_array(data: bytes) -> NDArray[np.float64]:
    """The numbers in a .npy file. Its header is read first: it may claim any size."""
    file = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, is_fortran, dtype = read_header(file)
    except (ValueError, EOFError) as error:
        raise AssetError("it is neither a grayscale PNG nor a .npy file") from error
    if len(shape) != 2 or dtype.kind not in "fiu":
        raise AssetError(f"it is an array of shape {shape} and {dtype}; heights are numbers in rows and columns")
    count = shape[0] * shape[1]
    if count > MOST_HEIGHTS:
        raise AssetError(f"it has {shape[0]} x {shape[1]} heights; there may be {MOST_HEIGHTS} in all")
    if len(data) - file.tell() != count * dtype.itemsize:
        raise AssetError("it is damaged: its numbers end too early or go on too long")
    numbers = np.frombuffer(data, dtype, count, file.tell()).reshape(shape, order="F" if is_fortran else "C")
    heights = np.array(numbers, np.float64, order="C")
    if not np.isfinite(heights).all() or np.abs(heights).max(initial=0.0) > 1e9:
        raise AssetError("not all of its numbers are finite and within 1e9 of zero")
    return heights
