"""Buffers, views and accessors of a glTF model as numpy arrays, without copies where the layout allows it."""

from __future__ import annotations

import base64
import binascii
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_compression import can_unpack, unpack_view
from elys.common.assets.gltf_schema import Accessor, BufferView, Document, PackedView
from elys.common.assets.images import read_asset_file
from elys.common.errors import AssetError

COMPONENT_TYPES: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
# Columns and rows of an element.
SHAPES: Final = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
# Accessors need no data behind them (they are zeros then), so a few bytes could ask for any amount of memory.
MAX_ZEROS: Final = 1 << 20  # elements of one
MAX_ZERO_NUMBERS: Final = 1 << 25  # numbers of all of a model


class Buffers:
    """A model's binary data, read when it is first asked for."""

    def __init__(self, document: Document, *, directory: Path, binary: bytes | None) -> None:
        self._document = document
        self._directory = directory
        self._binary = binary
        self._contents: dict[int, bytes | memoryview] = {}
        self._unpacked: dict[int, memoryview] = {}
        self._zero_count = 0

    def view(self, index: int, where: str) -> memoryview:
        """The bytes of buffer view `index`; raises AssetError if they are not all there."""
        view: BufferView = pick(self._document.buffer_views, index, where, "buffer view")
        packed = view.extensions.packed
        if packed is not None and self.unpacks(_meshopt_of(view), "meshoptimizer"):
            return self._unpacked_view(index, packed)
        data = self._buffer(view.buffer, f"bufferViews[{index}]")
        end = view.byte_offset + view.byte_length
        if end > len(data):
            raise AssetError(
                f"bufferViews[{index}] reaches to byte {end} of a buffer that has {len(data)}; the file may be cut off"
            )
        return memoryview(data)[view.byte_offset : end]

    def unpacks(self, extension: str, library: str) -> bool:
        """Whether packed data is to be used: always where the model says it has no other, else where the library is there."""
        return extension in self._document.extensions_required or can_unpack(library)

    def array(self, index: int, where: str) -> NDArray[Any]:
        """Accessor `index` as (count,) or (count, width) in its own component type, matrices by columns; raises AssetError."""
        accessor: Accessor = pick(self._document.accessors, index, where, "accessor")
        place = f"accessors[{index}]"
        shape = SHAPES.get(accessor.type)
        if shape is None:
            raise AssetError(f"{place}.type is {accessor.type[:20]!r}, expected one of {', '.join(SHAPES)}")
        dtype = _dtype(accessor.component_type, place)
        if accessor.buffer_view is None:
            self._zero_count += accessor.count * shape[0] * shape[1]
            if self._zero_count > MAX_ZERO_NUMBERS or accessor.count > MAX_ZEROS:
                raise AssetError(f"{place} has {accessor.count} elements and no data")
            array = np.zeros((accessor.count, shape[0] * shape[1]), dtype=dtype)
        else:
            data = self.view(accessor.buffer_view, place)
            stride = self._document.buffer_views[accessor.buffer_view].byte_stride
            array = _strided(data, accessor.byte_offset, accessor.count, shape, dtype, stride, place)
        if accessor.sparse is not None:
            array = self._with_sparse(array, accessor, shape, dtype, place)
        return array[:, 0] if shape == (1, 1) else array

    def floats(self, index: int, where: str) -> NDArray[np.float32]:
        """Accessor `index` as float32, integers divided by their largest value if it says so; raises AssetError."""
        return self.as_floats(self.array(index, where), index, where)

    def as_floats(self, array: NDArray[Any], index: int, where: str) -> NDArray[np.float32]:
        """Values that stand for those of accessor `index`, as `floats` gives them; raises AssetError."""
        normalized = pick(self._document.accessors, index, where, "accessor").normalized
        floats = np.ascontiguousarray(array, dtype=np.float32)
        if normalized and array.dtype.kind in "iu":
            floats = np.maximum(floats / np.float32(np.iinfo(array.dtype).max), np.float32(-1.0))
        if not np.isfinite(floats).all():
            raise AssetError(f"accessors[{index}] holds numbers that are not finite")
        return floats

    def _with_sparse(
        self, array: NDArray[Any], accessor: Accessor, shape: tuple[int, int], dtype: np.dtype[Any], where: str
    ) -> NDArray[Any]:
        sparse = accessor.sparse
        assert sparse is not None
        place = f"{where}.sparse"
        index_type = _dtype(sparse.indices.component_type, f"{place}.indices")
        if index_type.kind != "u":
            raise AssetError(f"{place}.indices must be unsigned whole numbers")
        rows = _strided(
            self.view(sparse.indices.buffer_view, f"{place}.indices"),
            sparse.indices.byte_offset,
            sparse.count,
            (1, 1),
            index_type,
            None,
            f"{place}.indices",
        )[:, 0]
        values = _strided(
            self.view(sparse.values.buffer_view, f"{place}.values"),
            sparse.values.byte_offset,
            sparse.count,
            shape,
            dtype,
            None,
            f"{place}.values",
        )
        if int(rows.max()) >= accessor.count:
            raise AssetError(f"{place} replaces element {int(rows.max())} of {accessor.count}")
        replaced = array.copy()
        replaced[rows] = values
        return replaced

    def _unpacked_view(self, index: int, packed: PackedView) -> memoryview:
        place = f"bufferViews[{index}]"
        if index not in self._unpacked:
            data = self._buffer(packed.buffer, place)
            end = packed.byte_offset + packed.byte_length
            if end > len(data):
                raise AssetError(f"{place} reaches to byte {end} of a buffer that has {len(data)}")
            unpacked = unpack_view(bytes(data[packed.byte_offset : end]), packed, place)
            self._unpacked[index] = unpacked.data
        return self._unpacked[index]

    def _buffer(self, index: int, where: str) -> bytes | memoryview:
        if index not in self._contents:
            buffer = pick(self._document.buffers, index, where, "buffer")
            place = f"buffers[{index}]"
            if buffer.uri is not None:
                data: bytes | memoryview = read_uri(buffer.uri, directory=self._directory, where=place, what="buffer")
            elif index == 0 and self._binary is not None:
                data = self._binary
            else:
                raise AssetError(f"{place} has no data: neither a uri nor a binary chunk")
            if len(data) < buffer.byte_length:
                raise AssetError(
                    f"{place} has {len(data)} bytes, {buffer.byte_length} were promised; the file may be cut off"
                )
            self._contents[index] = data
        return self._contents[index]


def read_uri(uri: str, *, directory: Path, where: str, what: str) -> bytes:
    """What a uri of a model holds: data within it, or a file in the model's directory or below. Raises AssetError."""
    if uri.startswith("data:"):
        return _data_uri(uri, where)
    return read_asset_file(uri_path(uri, directory=directory, where=where), what=what)


def uri_path(uri: str, *, directory: Path, where: str) -> Path:
    """The file that a relative uri names; raises AssetError if it is not within the model's directory."""
    if ":" in uri.split("/")[0]:
        raise AssetError(f"{where}.uri is {_short(uri)}; only files beside the model and data: are read")
    relative = Path(unquote(uri))
    path = directory / relative
    # A model from a stranger must not publish files of this machine.
    if relative.is_absolute() or ".." in relative.parts:
        raise AssetError(
            f"{where}.uri is {_short(uri)}, which leaves the model's directory; move the file beside the model"
        )
    return path


def pick(parts: list[Any], index: int, where: str, what: str) -> Any:
    """`parts[index]`, or AssetError that `where` names a `what` which does not exist."""
    if index >= len(parts):
        raise AssetError(f"{where} names {what} {index}, there are {len(parts)}")
    return parts[index]


def _dtype(component_type: int, where: str) -> np.dtype[Any]:
    name = COMPONENT_TYPES.get(component_type)
    if name is None:
        raise AssetError(
            f"{where}.componentType is {component_type}, expected one of {', '.join(map(str, COMPONENT_TYPES))}"
        )
    return np.dtype(name)


def _meshopt_of(view: BufferView) -> str:
    return "EXT_meshopt_compression" if view.extensions.meshopt is not None else "KHR_meshopt_compression"


def _strided(
    data: memoryview,
    offset: int,
    count: int,
    shape: tuple[int, int],
    dtype: np.dtype[Any],
    stride: int | None,
    where: str,
) -> NDArray[Any]:
    """(count, columns * rows) over the bytes, or AssetError where they end too early."""
    columns, rows = shape
    # Columns of a matrix start at multiples of 4 bytes: glTF 2.0, 3.6.2.4.
    column = dtype.itemsize * rows if columns == 1 else -(-dtype.itemsize * rows // 4) * 4
    element = column * columns
    step = element if stride is None else stride
    if step < element:
        raise AssetError(f"{where} has elements of {element} bytes, {step} bytes apart")
    end = offset + step * (count - 1) + element
    if end > len(data):
        raise AssetError(f"{where} reaches to byte {end} of a view that has {len(data)}")
    strides = (step, column, dtype.itemsize)
    array: NDArray[Any] = np.ndarray((count, columns, rows), dtype=dtype, buffer=data, offset=offset, strides=strides)
    return array[:, 0] if columns == 1 else array.reshape(count, columns * rows)


def _data_uri(uri: str, where: str) -> bytes:
    header, comma, payload = uri.partition(",")
    if not comma:
        raise AssetError(f"{where}.uri is a data: uri without data")
    if not header.endswith(";base64"):
        return unquote_to_bytes(payload)
    try:
        return base64.b64decode(payload, validate=True)
    except (binascii.Error, ValueError) as error:
        raise AssetError(f"{where}.uri is not base64: {error}") from None


def _short(uri: str) -> str:
    return repr(uri if len(uri) <= 60 else f"{uri[:57]}...")
