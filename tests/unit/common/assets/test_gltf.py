"""glTF models, made here piece by piece: what they become, and what is refused."""

from __future__ import annotations

import base64
import io
import json
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.common.assets import AssetStore, Mesh, decode_mesh, encode_mesh
from elys.common.assets.gltf import import_gltf
from elys.common.assets.gltf_accessors import Buffers
from elys.common.assets.gltf_schema import parse_gltf
from elys.common.assets.gltf_writing import GltfModel
from elys.common.errors import AssetError

PNG = b"\x89PNG\r\n\x1a\n" + bytes(16)
COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
QUAD = np.array(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), dtype=np.float32)


class Model:
    """A glTF document in the making, with all its data in one buffer."""

    def __init__(self) -> None:
        self.data = b""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"name": "Root", "mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {}}]}],
            "accessors": [],
            "bufferViews": [],
        }

    @property
    def primitive(self) -> dict[str, Any]:
        return self.document["meshes"][0]["primitives"][0]

    def view(self, data: bytes, **fields: Any) -> int:
        self.data += bytes(-len(self.data) % 4)
        self.document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **fields}
        )
        self.data += data
        return len(self.document["bufferViews"]) - 1

    def accessor(self, array: np.ndarray, **fields: Any) -> int:
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[1 if array.ndim == 1 else array.shape[1]]
        view = self.view(array.tobytes())
        entry = {
            "bufferView": view,
            "componentType": COMPONENT_TYPES[array.dtype.str[1:]],
            "count": len(array),
            "type": kind,
        }
        self.document["accessors"].append({**entry, **fields})
        return len(self.document["accessors"]) - 1

    def attribute(self, name: str, array: np.ndarray, **fields: Any) -> None:
        self.primitive["attributes"][name] = self.accessor(array, **fields)

    def indices(self, values: Any, dtype: str = "u2") -> None:
        self.primitive["indices"] = self.accessor(np.array(values, dtype=dtype))

    def embedded(self) -> bytes:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        return json.dumps({**self.document, "buffers": [{"byteLength": len(self.data), "uri": uri}]}).encode()

    def binary(self) -> bytes:
        text = json.dumps({**self.document, "buffers": [{"byteLength": len(self.data)}]}).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + bytes(-len(self.data) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def quad() -> Model:
    model = Model()
    model.attribute("POSITION", QUAD)
    model.attribute("NORMAL", np.tile(np.float32((0, 0, 1)), (4, 1)))
    model.indices((0, 1, 2, 0, 2, 3))
    return model


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., tuple[list[Any], AssetStore]]:
    def load(model: Model | bytes, name: str = "model.gltf") -> tuple[list[Any], AssetStore]:
        path = tmp_path / name
        path.write_bytes(model.embedded() if isinstance(model, Model) else model)
        assets = AssetStore()
        return import_gltf(path, assets), assets

    return load


def mesh_of(loaded: tuple[list[Any], AssetStore], row: int = 1) -> Mesh:
    records, assets = loaded
    return decode_mesh(assets.get(records[row].components["MeshRenderer"]["mesh"]))


def test_both_containers_give_the_same(load: Any) -> None:
    text, binary = load(quad()), load(quad().binary(), "model.glb")
    assert text[0] == binary[0]
    records, _ = text
    assert [(r.name, r.parent) for r in records] == [("model", -1), ("Root", 0)]
    mesh = mesh_of(text)
    assert np.array_equal(mesh.positions, QUAD)
    assert mesh.indices.tolist() == [0, 1, 2, 0, 2, 3]


def test_a_buffer_in_a_file_beside_the_model(load: Any, tmp_path: Path) -> None:
    model = quad()
    (tmp_path / "my data.bin").write_bytes(model.data)
    document = {**model.document, "buffers": [{"byteLength": len(model.data), "uri": "my%20data.bin"}]}
    assert np.array_equal(mesh_of(load(json.dumps(document).encode())).positions, QUAD)


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
def test_indices_of_all_types(load: Any, dtype: str) -> None:
    model = quad()
    model.indices((2, 1, 0), dtype)
    assert mesh_of(load(model)).indices.tolist() == [2, 1, 0]


@pytest.mark.parametrize("dtype, largest", [("i1", 127), ("u1", 255), ("i2", 32767), ("u2", 65535)])
def test_normalised_integers_become_fractions(load: Any, dtype: str, largest: int) -> None:
    model = quad()
    values = np.array(((0, largest), (largest, 0), (largest // 2, 1), (0, 0)), dtype=dtype)
    if dtype[0] == "i":
        values[3] = (-largest - 1, -largest)
    model.attribute("TEXCOORD_0", values, normalized=True)
    uvs = mesh_of(load(model)).uvs
    assert np.allclose(uvs[:3], values[:3] / largest)
    assert np.allclose(uvs[3], (-1, -1) if dtype[0] == "i" else (0, 0))


def test_integers_that_are_not_normalised_stay(load: Any) -> None:
    model = Model()
    model.attribute("POSITION", (QUAD * 100).astype("i2"))
    model.indices((0, 1, 2))
    assert mesh_of(load(model)).positions.max() == 100.0


def test_interleaved_views(load: Any) -> None:
    model = Model()
    normals = np.tile(np.float32((0, 1, 0)), (4, 1))
    view = model.view(np.concatenate((QUAD, normals), axis=1).tobytes(), byteStride=24)
    for name, offset in (("POSITION", 0), ("NORMAL", 12)):
        entry = {"bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 4, "type": "VEC3"}
        model.document["accessors"].append(entry)
        model.primitive["attributes"][name] = len(model.document["accessors"]) - 1
    mesh = mesh_of(load(model))
    assert np.array_equal(mesh.positions, QUAD)
    assert np.array_equal(mesh.normals, normals)


def sparse(model: Model, rows: list[int], values: np.ndarray) -> dict[str, Any]:
    return {
        "count": len(rows),
        "indices": {"bufferView": model.view(np.array(rows, dtype="u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": model.view(values.astype(np.float32).tobytes())},
    }


@pytest.mark.parametrize("backed", [True, False])
def test_sparse_accessors(load: Any, backed: bool) -> None:
    model = quad()
    moved = np.array(((5, 5, 5), (7, 7, 7)))
    entry = model.document["accessors"][0]
    entry["sparse"] = sparse(model, [1, 3], moved)
    if not backed:
        del entry["bufferView"]
    expected = QUAD.copy() if backed else np.zeros((4, 3))
    expected[[1, 3]] = moved
    assert np.array_equal(mesh_of(load(model)).positions, expected)


@pytest.mark.parametrize(
    "mode, indices, triangles",
    [
        (4, [0, 1, 2, 3], [(0, 1, 2)]),
        (5, [0, 1, 3, 2], [(0, 1, 3), (1, 2, 3)]),
        (6, [0, 1, 2, 3], [(1, 2, 0), (2, 3, 0)]),
        (5, [0, 1], []),
    ],
)
def test_lists_strips_and_fans(load: Any, mode: int, indices: list[int], triangles: list[tuple[int, ...]]) -> None:
    model = quad()
    model.primitive["mode"] = mode
    model.indices(indices)
    assert [tuple(t) for t in mesh_of(load(model)).indices.reshape(-1, 3).tolist()] == triangles


@pytest.mark.parametrize(
    ("mode", "topology", "indices", "expected"),
    [
        (0, "points", [3, 1], [3, 1]),
        (0, "points", None, [0, 1, 2, 3]),
        (1, "lines", [3, 1, 0, 2, 1], [3, 1, 0, 2]),
        (1, "lines", None, [0, 1, 2, 3]),
        (2, "lines", [3, 1, 0], [3, 1, 1, 0, 0, 3]),
        (2, "lines", None, [0, 1, 1, 2, 2, 3, 3, 0]),
        (3, "lines", [3, 1, 0], [3, 1, 1, 0]),
        (3, "lines", None, [0, 1, 1, 2, 2, 3]),
        (1, "lines", [2], []),
        (2, "lines", [2], []),
        (3, "lines", [2], []),
    ],
)
def test_points_and_lines(
    load: Any,
    mode: int,
    topology: str,
    indices: list[int] | None,
    expected: list[int],
    caplog: pytest.LogCaptureFixture,
) -> None:
    model = Model()
    model.attribute("POSITION", QUAD)
    model.attribute("COLOR_0", np.tile(np.float32((1.0, 0.5, 0.25)), (4, 1)))
    model.attribute("TANGENT", np.tile(np.float32((1, 0, 0, 1)), (4, 1)))
    model.primitive["mode"] = mode
    if indices is not None:
        model.indices(indices)
    mesh = mesh_of(load(model))
    assert (mesh.topology, mesh.indices.tolist()) == (topology, expected)
    assert np.array_equal(mesh.positions, QUAD)  # as they are: shared and in their order
    assert np.array_equal(mesh.normals, np.tile((0, 1, 0), (4, 1)))
    assert mesh.tangents is None
    assert np.array_equal(mesh.colors, np.tile((1.0, 0.5, 0.25, 1.0), (4, 1)))
    assert not caplog.records


def test_lines_keep_normals_that_are_there_and_their_targets(load: Any) -> None:
    model = quad()
    model.primitive["mode"] = 3
    model.primitive["targets"] = [{"POSITION": model.accessor(QUAD)}]
    mesh = mesh_of(load(model))
    assert np.array_equal(mesh.normals, np.tile((0, 0, 1), (4, 1)))
    assert np.array_equal(mesh.target_positions, QUAD[None])


def test_a_mesh_of_triangles_and_lines_becomes_children_of_each(load: Any) -> None:
    model = quad()
    edges = {"attributes": {"POSITION": 0}, "mode": 2}
    model.document["meshes"][0]["primitives"] += [edges, {**edges, "mode": 0}]
    loaded = load(model)
    assert [record.name for record in loaded[0][2:]] == ["Root.0", "Root.1", "Root.2"]
    assert [mesh_of(loaded, row).topology for row in (2, 3, 4)] == ["triangles", "lines", "points"]


def test_lines_name_vertices_that_are_there(load: Any) -> None:
    model = quad()
    model.primitive["mode"] = 1
    model.indices((0, 4))
    with pytest.raises(AssetError, match="names vertex 4, there are 4"):
        load(model)


@pytest.mark.parametrize("topology", ["lines", "points"])
def test_lines_and_points_are_written_and_read_back(load: Any, topology: str) -> None:
    """Without normals: so other programs know that they are unlit."""
    up = np.tile(np.float32((0, 1, 0)), (4, 1))
    uvs, indices = np.zeros((4, 2), np.float32), np.array((0, 2, 1, 3), np.uint32)
    mesh = Mesh(
        positions=QUAD, normals=up, uvs=uvs, indices=indices, colors=np.ones((4, 4), np.float32), topology=topology
    )
    model = GltfModel("test")
    surface = model.primitive(mesh)
    assert "NORMAL" not in surface["attributes"]
    model.add("nodes", {"mesh": model.add("meshes", {"primitives": [surface]})})
    file = io.BytesIO()
    model.write(file)
    assert encode_mesh(mesh_of(load(file.getvalue(), "model.glb"))) == encode_mesh(mesh)


def test_missing_normals_are_those_of_the_faces(load: Any) -> None:
    model = Model()
    model.attribute("POSITION", np.array(((0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2)), dtype=np.float32))
    model.attribute("TEXCOORD_0", np.arange(8, dtype=np.float32).reshape(4, 2))
    model.indices((0, 2, 1, 0, 1, 3))
    mesh = mesh_of(load(model))
    assert mesh.vertex_count == 6
    assert np.array_equal(mesh.normals, [(0, 0, -1)] * 3 + [(0, -1, 0)] * 3)
    assert np.array_equal(mesh.uvs[1], (4, 5))


def test_vertex_colours_get_an_opacity(load: Any) -> None:
    model = quad()
    model.attribute("COLOR_0", np.full((4, 3), 128, dtype="u1"), normalized=True)
    assert np.allclose(mesh_of(load(model)).colors, (128 / 255, 128 / 255, 128 / 255, 1.0))


def test_a_mesh_of_several_primitives_becomes_children(load: Any) -> None:
    model = quad()
    model.document["materials"] = [{"name": "Red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}]
    model.document["meshes"][0]["primitives"].append({**model.primitive, "material": 0})
    model.document["nodes"][0]["children"] = [1]
    model.document["nodes"].append({"name": "Root.0"})
    records, _ = load(model)
    assert [(r.name, r.parent) for r in records] == [
        ("model", -1),
        ("Root", 0),
        ("Root.0", 1),
        ("Root.1", 1),
        ("Root.0 2", 1),
    ]
    assert "MeshRenderer" not in records[1].components
    assert records[3].components["Material"]["base_color"] == (1, 0, 0)


def test_nodes_keep_their_order_transforms_and_distinct_names(load: Any) -> None:
    model = quad()
    turn = [0.0, math.sin(0.5), 0.0, math.cos(0.5)]
    matrix = np.array(((0, -2, 0, 5), (2, 0, 0, 6), (0, 0, 2, 7), (0, 0, 0, 1)), dtype=float)
    model.document["nodes"] = [
        {"name": "A", "children": [2, 3, 1], "translation": [1, 2, 3], "rotation": turn, "scale": [2, 2, 2]},
        {"name": "B"},
        {"name": "B", "matrix": matrix.T.ravel().tolist()},
        {},
    ]
    records, _ = load(model)
    assert [(r.name, r.parent) for r in records] == [("model", -1), ("A", 0), ("B", 1), ("Node 3", 1), ("B 2", 1)]
    assert records[1].components["Transform"] == {"position": (1, 2, 3), "rotation": tuple(turn), "scale": (2, 2, 2)}
    transform = records[2].components["Transform"]
    assert np.allclose(transform["position"], (5, 6, 7))
    assert np.allclose(transform["scale"], 2)
    assert np.allclose(transform["rotation"], (0, 0, math.sqrt(0.5), math.sqrt(0.5)))


def test_without_a_scene_all_roots_are_taken(load: Any) -> None:
    model = quad()
    del model.document["scene"], model.document["scenes"]
    model.document["nodes"] = [{"name": "Child"}, {"name": "Top", "children": [0]}]
    assert [(r.name, r.parent) for r in load(model)[0]] == [("model", -1), ("Top", 0), ("Child", 1)]


def test_materials_and_images(load: Any, tmp_path: Path) -> None:
    (tmp_path / "red.png").write_bytes(PNG)
    model = quad()
    view = model.view(b"\xff\xd8\xff" + bytes(9))
    model.document |= {
        "images": [{"uri": "red.png"}, {"bufferView": view, "mimeType": "image/jpeg"}, {"uri": "never used.ktx2"}],
        "textures": [{"source": 0}, {"source": 1}],
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.5, 0.25, 0.125, 0.75],
                    "metallicFactor": 0.25,
                    "roughnessFactor": 0.5,
                    "baseColorTexture": {"index": 0},
                    "metallicRoughnessTexture": {"index": 1},
                },
                "normalTexture": {"index": 1},
                "occlusionTexture": {"index": 1},
                "emissiveTexture": {"index": 0},
                "emissiveFactor": [1, 0.5, 0],
                "alphaMode": "MASK",
                "alphaCutoff": 0.25,
                "doubleSided": True,
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
            }
        ],
    }
    model.primitive["material"] = 0
    records, assets = load(model)
    material = records[1].components["Material"]
    assert assets.get(material["base_color_texture"]) == PNG
    assert assets.source(material["base_color_texture"]) == str(tmp_path / "red.png")
    assert assets.get(material["normal_texture"])[:3] == b"\xff\xd8\xff"
    assert assets.source(material["normal_texture"]) == str(tmp_path / "model.gltf#image/1")
    assert material["metallic_roughness_texture"] == material["normal_texture"] == material["occlusion_texture"]
    assert material["emissive_texture"] == material["base_color_texture"]
    textures = {name for name in material if name.endswith("_texture")}
    assert {name: value for name, value in material.items() if name not in textures} == {
        "base_color": (0.5, 0.25, 0.125),
        "opacity": 0.75,
        "metallic": 0.25,
        "roughness": 0.5,
        "emissive": (4.0, 2.0, 0.0),
        "alpha_mode": "mask",
        "alpha_cutoff": 0.25,
        "double_sided": True,
    }


def test_no_material_is_the_one_of_the_standard(load: Any) -> None:
    assert load(quad())[0][1].components["Material"] == {
        "base_color": (1.0, 1.0, 1.0),
        "metallic": 1.0,
        "roughness": 1.0,
    }


@pytest.mark.parametrize(
    "diffuse, specular, base_color, metallic",
    [
        ((0.5, 0.4, 0.3), (0.04, 0.04, 0.04), (0.5, 0.4, 0.3), 0.0),  # a dielectric
        ((0.0, 0.0, 0.0), (0.9, 0.6, 0.3), (0.9, 0.6, 0.3), 1.0),  # a metal
    ],
)
def test_specular_glossiness_becomes_metallic_roughness(
    load: Any, diffuse: Any, specular: Any, base_color: Any, metallic: float
) -> None:
    model = quad()
    old = {"diffuseFactor": [*diffuse, 1.0], "specularFactor": specular, "glossinessFactor": 0.75}
    model.document["materials"] = [{"extensions": {"KHR_materials_pbrSpecularGlossiness": old}}]
    model.document["extensionsRequired"] = ["KHR_materials_pbrSpecularGlossiness"]
    model.primitive["material"] = 0
    material = load(model)[0][1].components["Material"]
    assert np.allclose(material["base_color"], base_color, atol=0.02)
    assert material.get("metallic", 0.0) == pytest.approx(metallic, abs=0.05)
    assert material["roughness"] == 0.25


def test_cameras_and_lights(load: Any) -> None:
    model = quad()
    model.document |= {
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25, "zfar": 80}},
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25}},
            {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1, "znear": 1, "zfar": 3}},
        ],
        "extensions": {
            "KHR_lights_punctual": {
                "lights": [
                    {"type": "directional", "color": [1, 0.5, 0.25], "intensity": 7},
                    {"type": "spot", "range": 9, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}},
                    {"type": "point"},
                ]
            }
        },
        "nodes": [
            {"children": [1, 2, 3, 4, 5]},
            *({"camera": index} for index in range(3)),
            *({"extensions": {"KHR_lights_punctual": {"light": index}}} for index in range(2)),
        ],
    }
    records, _ = load(model)
    cameras = [r.components["Camera"] for r in records if "Camera" in r.components]
    assert cameras[0] == {"field_of_view": 0.5, "near": 0.25, "far": 80.0}
    assert cameras[1]["far"] == 1000.0
    assert cameras[2] == {"projection": "orthographic", "ortho_height": 2.0, "near": 1.0, "far": 3.0}
    sun, spot = (r.components["Light"] for r in records if "Light" in r.components)
    assert sun == {"color": (1.0, 0.5, 0.25), "intensity": 7.0}
    assert spot == {"kind": "spot", "intensity": 1.0, "range": 9.0, "inner_cone_angle": 0.1, "outer_cone_angle": 0.2}


def test_matrices_are_padded_by_columns(tmp_path: Path) -> None:
    model = quad()
    columns = np.zeros((2, 3, 4), dtype="i1")
    columns[..., :3] = np.arange(18).reshape(2, 3, 3)
    view = model.view(columns.tobytes())
    model.document["accessors"].append({"bufferView": view, "componentType": 5120, "count": 2, "type": "MAT3"})
    document, _ = parse_gltf(model.embedded())
    array = Buffers(document, directory=tmp_path, binary=None).array(len(document.accessors) - 1, "here")
    assert array.tolist() == np.arange(18).reshape(2, 9).tolist()


def test_a_second_uv_set(load: Any) -> None:
    model = quad()
    uvs = np.arange(8, dtype=np.float32).reshape(4, 2)
    model.attribute("TEXCOORD_1", uvs)
    mesh = mesh_of(load(model))
    assert np.array_equal(mesh.second_uvs, uvs)
    assert not mesh.uvs.any()


def with_texture(info: dict[str, Any], **more: Any) -> Model:
    model = quad()
    view = model.view(PNG)
    model.document |= {"images": [{"bufferView": view}], "textures": [{"source": 0}]} | more
    model.document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **info}}}]
    model.primitive["material"] = 0
    return model


def test_a_texture_carries_its_set_transform_and_sampler(load: Any) -> None:
    moved = {"offset": [0.5, 0.25], "rotation": 0.1, "scale": [2, -1], "texCoord": 1}
    sampler = {"magFilter": 9728, "minFilter": 9984, "wrapS": 33071, "wrapT": 33648}
    model = with_texture(
        {"extensions": {"KHR_texture_transform": moved}}, textures=[{"source": 0, "sampler": 0}], samplers=[sampler]
    )
    text = load(model)[0][1].components["Material"]["base_color_texture"]
    assert text.partition("?")[2] == (
        "uv=1&offset=0.5,0.25&rotation=0.1&scale=2,-1&wrap=clamp,mirror&magnify=nearest&minify=nearest-mipmap-nearest"
    )
    plain = load(with_texture({}))[0][1].components["Material"]["base_color_texture"]
    assert plain == text.partition("?")[0]


def test_a_third_uv_set_is_not_there(load: Any, caplog: pytest.LogCaptureFixture) -> None:
    text = load(with_texture({"texCoord": 2}))[0][1].components["Material"]["base_color_texture"]
    assert "?" not in text
    assert "TEXCOORD_2" in caplog.text


def test_extensions_of_materials(load: Any) -> None:
    model = with_texture({})
    model.document["materials"] = [
        {
            "normalTexture": {"index": 0, "scale": 0.5},
            "occlusionTexture": {"index": 0, "strength": 0.25},
            "extensions": {
                "KHR_materials_unlit": {},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 2, 3]},
                "KHR_materials_clearcoat": {
                    "clearcoatFactor": 0.75,
                    "clearcoatRoughnessFactor": 0.25,
                    "clearcoatNormalTexture": {"index": 0},
                },
            },
        }
    ]
    material = load(model)[0][1].components["Material"]
    expected = {"normal_scale": 0.5, "occlusion_strength": 0.25, "unlit": True, "ior": 1.33, "specular": 0.5}
    expected |= {"specular_color": (1.0, 2.0, 3.0), "clearcoat": 0.75, "clearcoat_roughness": 0.25}
    assert {key: material[key] for key in expected} == expected
    assert material["clearcoat_normal_texture"] == material["normal_texture"]


def test_instances_become_children_and_hidden_nodes_are_switched_off(load: Any) -> None:
    model = quad()
    places = np.float32(((0, 0, 0), (5, 0, 0), (0, 7, 0)))
    turns = np.array(((0, 0, 0, 127), (127, 0, 0, 0), (0, 127, 0, 0)), "i1")
    model.document["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {
            "attributes": {
                "TRANSLATION": model.accessor(places),
                "ROTATION": model.accessor(turns, normalized=True),
            }
        },
        "KHR_node_visibility": {"visible": False},
    }
    records, _ = load(model)
    assert [(r.name, r.parent, r.enabled) for r in records[1:]] == [
        ("Root", 0, False),
        ("Root instance", 1, True),
        ("Root instance 2", 1, True),
        ("Root instance 3", 1, True),
    ]
    assert "MeshRenderer" not in records[1].components
    assert records[3].components["Transform"] == {"position": (5.0, 0.0, 0.0), "rotation": (1.0, 0.0, 0.0, 0.0)}
    assert len({r.components["MeshRenderer"]["mesh"] for r in records[2:]}) == 1


def test_positions_that_are_not_finite(load: Any) -> None:
    model = Model()
    model.attribute("POSITION", np.full((3, 3), np.inf, dtype=np.float32))
    with pytest.raises(AssetError, match=r"accessors\[0\] holds numbers that are not finite"):
        load(model)
