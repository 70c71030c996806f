"""Models packed here by the libraries that ELYS unpacks them with, and what is said where those are missing."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.common.assets import AssetStore, Mesh, decode_mesh
from elys.common.assets.gltf import import_gltf
from elys.common.assets.primitives import primitive
from elys.common.errors import AssetError

SPHERE = primitive("sphere")
DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"


class Packed:
    """A model of one mesh in the making, whose parts stand in one file of bytes."""

    def __init__(self, folder: Path, extension: str) -> None:
        self.path = folder / "packed.gltf"
        self.data = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.primitive: dict[str, Any] = {"attributes": {}}
        self.extension = extension

    def add(self, data: bytes) -> dict[str, int]:
        self.data += bytes(-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.data += data
        return place

    def load(self) -> Mesh:
        document = {
            "asset": {"version": "2.0"},
            "extensionsUsed": [self.extension],
            "extensionsRequired": [self.extension],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [self.primitive]}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data), "uri": "packed.bin"}],
        }
        self.path.write_text(json.dumps(document))
        self.path.with_name("packed.bin").write_bytes(self.data)
        assets = AssetStore()
        records = import_gltf(self.path, assets)
        return decode_mesh(assets.get(records[1].components["MeshRenderer"]["mesh"]))


def draco(folder: Path) -> Packed:
    library = pytest.importorskip("DracoPy")
    data = library.encode(
        SPHERE.positions,
        SPHERE.indices.reshape(-1, 3),
        quantization_bits=14,
        preserve_order=True,
        tex_coord=SPHERE.uvs.astype(np.float64),
        normals=SPHERE.normals.astype(np.float64),
    )
    ids = {part["attribute_type"]: part["unique_id"] for part in library.decode(data).attributes}
    model = Packed(folder, DRACO)
    model.views.append(model.add(data))
    for name, kind, draco_type in (("POSITION", "VEC3", 0), ("NORMAL", "VEC3", 1), ("TEXCOORD_0", "VEC2", 3)):
        model.primitive["attributes"][name] = len(model.accessors)
        model.accessors.append({"componentType": 5126, "count": SPHERE.vertex_count, "type": kind})
        part = model.primitive.setdefault("extensions", {}).setdefault(DRACO, {"bufferView": 0, "attributes": {}})
        part["attributes"][name] = ids[draco_type]
    model.primitive["indices"] = len(model.accessors)
    model.accessors.append({"componentType": 5125, "count": len(SPHERE.indices), "type": "SCALAR"})
    return model


def meshopt(folder: Path) -> Packed:
    library = pytest.importorskip("meshoptimizer")
    model = Packed(folder, MESHOPT)

    def view(packed: bytes, count: int, stride: int, mode: str, **more: str) -> int:
        meshopt = {**model.add(packed), "byteStride": stride, "count": count, "mode": mode, **more}
        fallback = {"buffer": 0, "byteOffset": 0, "byteLength": count * stride}
        spacing = {"byteStride": stride} if mode == "ATTRIBUTES" else {}
        model.views.append({**fallback, **spacing, "extensions": {MESHOPT: meshopt}})
        return len(model.views) - 1

    def accessor(view: int, component: int, count: int, kind: str, **more: Any) -> int:
        model.accessors.append({"bufferView": view, "componentType": component, "count": count, "type": kind, **more})
        return len(model.accessors) - 1

    count = SPHERE.vertex_count
    positions = library.encode_vertex_buffer(SPHERE.positions, count, 12)
    octahedral = np.zeros((count, 4), "i1")  # x and y of the octahedron, its scale, and nothing
    octahedral[:, :2] = np.round(127 * SPHERE.normals[:, :2] / np.abs(SPHERE.normals).sum(1, keepdims=True))
    octahedral[:, 2] = 127
    below = SPHERE.normals[:, 2] < 0  # folds the lower half over the upper one's corners
    folded = (1 - np.abs(octahedral[:, 1::-1] / 127)) * np.where(octahedral[:, :2] >= 0, 1, -1)
    octahedral[below, :2] = np.round(127 * folded[below])
    normals = library.encode_vertex_buffer(octahedral.view(np.float32), count, 4)
    indices = library.encode_index_buffer(SPHERE.indices, len(SPHERE.indices), count)
    model.primitive["attributes"] = {
        "POSITION": accessor(view(bytes(positions), count, 12, "ATTRIBUTES"), 5126, count, "VEC3"),
        "NORMAL": accessor(
            view(bytes(normals), count, 4, "ATTRIBUTES", filter="OCTAHEDRAL"), 5120, count, "VEC3", normalized=True
        ),
    }
    model.primitive["indices"] = accessor(
        view(bytes(indices), len(SPHERE.indices), 2, "TRIANGLES"), 5123, len(SPHERE.indices), "SCALAR"
    )
    return model


def same_triangles(mesh: Mesh, within: float) -> None:
    """Both hold the same triangles, in any order and from any of their corners."""

    def corners(of: Mesh) -> np.ndarray:
        triangles = of.positions[of.indices].astype(np.float64).reshape(-1, 3, 3)
        middles = triangles.mean(axis=1)
        return middles[np.lexsort(np.round(middles, 4).T)]

    np.testing.assert_allclose(corners(mesh), corners(SPHERE), atol=within)


@pytest.mark.parametrize(("mode", "held"), [(0, "points or lines"), (3, "points or lines"), (6, "a fan")])
def test_draco_knows_triangles_alone(tmp_path: Path, mode: int, held: str) -> None:
    model = draco(tmp_path)
    model.primitive["mode"] = mode
    with pytest.raises(AssetError, match=f"holds {held}; Draco knows triangles"):
        model.load()


def test_draco_gives_back_what_was_packed(tmp_path: Path) -> None:
    mesh = draco(tmp_path).load()
    assert mesh.triangle_count == SPHERE.triangle_count
    np.testing.assert_allclose(mesh.positions, SPHERE.positions, atol=1e-4)  # 14 bits of a metre
    np.testing.assert_allclose(mesh.uvs, SPHERE.uvs, atol=1e-3)
    np.testing.assert_allclose(mesh.normals, SPHERE.normals, atol=2e-2)


def test_meshopt_gives_back_what_was_packed(tmp_path: Path) -> None:
    mesh = meshopt(tmp_path).load()
    np.testing.assert_array_equal(mesh.positions, SPHERE.positions)
    np.testing.assert_allclose(mesh.normals, SPHERE.normals, atol=2e-2)  # 8 bits
    same_triangles(mesh, 1e-6)


@pytest.mark.parametrize("make, library", [(draco, "DracoPy"), (meshopt, "meshoptimizer")])
def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch, make: Any, library: str) -> None:
    model = make(tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(AssetError, match=r"is packed with .*pip install 'elys\[compressed\]'"):
        model.load()


@pytest.mark.parametrize("make", [draco, meshopt])
@pytest.mark.parametrize("seed", range(20))
def test_damaged_bytes_are_refused_or_read(tmp_path: Path, make: Any, seed: int) -> None:
    model = make(tmp_path)
    rng = np.random.default_rng(seed)
    data = np.frombuffer(model.data, np.uint8).copy()
    data[rng.integers(0, len(data), 8)] = rng.integers(0, 256, 8)
    model.data = data.tobytes()
    try:
        assert model.load().vertex_count > 0
    except AssetError as error:
        assert "\n" not in str(error)
