"""A glTF 2.0 model put together piece by piece, and written as one .glb: the inverse of what `gltf.py` reads.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from __future__ import annotations

import struct
from typing import Any, BinaryIO, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh
from elys.common.errors import AssetError

VERTICES: Final = 34962  # what a buffer view is for, in GL's numbers
INDICES: Final = 34963
MAX_GLB: Final = (1 << 32) - 1  # [bytes] what its header can say
_TYPES: Final = {"f4": 5126, "u4": 5125, "u2": 5123, "u1": 5121}
_SHAPES: Final = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
_MODES: Final = {"points": 0, "lines": 1}  # triangles go without saying
_ATTRIBUTES: Final = {
    "positions": "POSITION",
    "normals": "NORMAL",
    "uvs": "TEXCOORD_0",
    "tangents": "TANGENT",
    "colors": "COLOR_0",
    "second_uvs": "TEXCOORD_1",
    "weights": "WEIGHTS_0",
}


class GltfModel:
    """What the model has so far: lists of the document by name, and bytes."""

    def __init__(self, generator: str) -> None:
        self.document: dict[str, Any] = {"asset": {"version": "2.0", "generator": generator}}
        self._parts: list[bytes] = []
        self.size = 0  # [bytes] of all arrays and images

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Appends to one of the document's lists ("nodes", "meshes", ...) and returns the number of the item."""
        items: list[Any] = self.document.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def use(self, extension: str, *, required: bool = False) -> None:
        """Says that the model has something of an extension, and whether a reader can do without."""
        for field in ("extensionsUsed", "extensionsRequired") if required else ("extensionsUsed",):
            named: list[str] = self.document.setdefault(field, [])
            if extension not in named:
                named.append(extension)

    def view(self, data: bytes, *, target: int = 0) -> int:
        """Adds bytes as a buffer view; AssetError where a .glb cannot hold that much."""
        if self.size + len(data) > MAX_GLB - (1 << 28):
            raise AssetError("the model would have more than the 4 GiB that a .glb can hold")
        view = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        if target:
            view["target"] = target
        padded = data + b"\0" * (-len(data) % 4)
        self._parts.append(padded)
        self.size += len(padded)
        return self.add("bufferViews", view)

    def accessor(self, array: NDArray[Any], *, target: int = 0, has_bounds: bool = False) -> int:
        """Adds an array [N], [N, 2], [N, 3], [N, 4] or [N, 4, 4], the last by columns."""
        kind = array.dtype.kind + str(array.dtype.itemsize)
        data = np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()
        item = {
            "bufferView": self.view(data, target=target),
            "componentType": _TYPES[kind],
            "count": len(array),
            "type": _SHAPES[array.shape[1:]],
        }
        if has_bounds:
            item["min"] = np.atleast_1d(array.min(axis=0)).tolist()
            item["max"] = np.atleast_1d(array.max(axis=0)).tolist()
        return self.add("accessors", item)

    def primitive(self, mesh: Mesh, *, has_tangents: bool = True, has_uvs: bool = True) -> dict[str, Any]:
        """Adds the arrays of a mesh; what names them goes into "meshes", with a material.

        Only a normal map needs tangents, and only images need uvs. Lines and points go without normals, which tells readers that
        they are unlit.
        """
        left_out = {"tangents"} if not has_tangents else set()
        left_out |= set() if has_uvs else {"uvs", "second_uvs"}
        left_out |= set() if mesh.is_surface else {"normals", "tangents"}
        attributes: dict[str, int] = {}
        for name, attribute in _ATTRIBUTES.items():
            array = getattr(mesh, name)
            if array is None or name in left_out:
                continue
            if name in ("normals", "tangents"):
                array = _with_unit_directions(array)
            if name == "colors":
                array = np.clip(array, 0.0, 1.0)
            attributes[attribute] = self.accessor(array, target=VERTICES, has_bounds=name == "positions")
        if mesh.joints is not None:
            attributes["JOINTS_0"] = self.accessor(mesh.joints.astype(np.uint16), target=VERTICES)
        indices = mesh.indices.astype(np.uint16) if mesh.vertex_count < 0xFFFF else mesh.indices
        made: dict[str, Any] = {"attributes": attributes, "indices": self.accessor(indices, target=INDICES)}
        if mesh.topology in _MODES:
            made["mode"] = _MODES[mesh.topology]
        if mesh.target_positions is not None:
            made["targets"] = [self._target(mesh, number) for number in range(mesh.target_count)]
        return made

    def write(self, file: BinaryIO) -> int:
        """Writes the .glb; returns its size [bytes]."""
        if self.size:
            self.document["buffers"] = [{"byteLength": self.size}]
        text = msgspec.json.encode(self.document)
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + (8 + self.size if self.size else 0)
        if size > MAX_GLB:
            raise AssetError("the model has more than the 4 GiB that a .glb can hold")
        file.write(struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") + text)
        if self.size:
            file.write(struct.pack("<I4s", self.size, b"BIN\0"))
            file.writelines(self._parts)
        return size

    def _target(self, mesh: Mesh, number: int) -> dict[str, int]:
        assert mesh.target_positions is not None
        target = {"POSITION": self.accessor(mesh.target_positions[number], target=VERTICES, has_bounds=True)}
        if mesh.target_normals is not None and mesh.is_surface:
            target["NORMAL"] = self.accessor(mesh.target_normals[number], target=VERTICES)
        return target


def _with_unit_directions(array: NDArray[np.float32]) -> NDArray[np.float32]:
    """The same with its first three numbers a row at length 1, as the format demands; what has no length points up."""
    made = array.copy()
    length = np.linalg.norm(made[:, :3], axis=1, keepdims=True)
    made[:, :3] = np.where(length > 1e-6, made[:, :3] / np.where(length > 0, length, 1), (0.0, 1.0, 0.0))
    if made.shape[1] == 4:
        made[:, 3] = np.where(made[:, 3] < 0.0, -1.0, 1.0)
    return made
