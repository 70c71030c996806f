"""Broken and hostile glTF models: each fault is one sentence that names the file, and only errors of ELYS come out."""

from __future__ import annotations

import base64
import contextlib
import copy
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elys.common.assets import AssetStore
from elys.common.assets.gltf import import_gltf
from elys.common.assets.images import placeholder_image
from elys.common.errors import AssetError, ElysError

CORNERS = np.array(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), dtype="<f4")
NORMALS = np.tile(np.float32((0, 0, 1)), (4, 1))
DATA = CORNERS.tobytes() + NORMALS.tobytes() + np.array((0, 1, 2, 0, 2, 3), dtype="<u2").tobytes()
QUAD: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"name": "Root", "mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 48},
        {"buffer": 0, "byteOffset": 96, "byteLength": 12},
    ],
    "buffers": [{"byteLength": 108, "uri": "data:application/octet-stream;base64," + base64.b64encode(DATA).decode()}],
}


def binary() -> bytes:
    """The quad as a .glb."""
    text = json.dumps({**QUAD, "buffers": [{"byteLength": 108}]}).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(DATA), b"BIN\0") + DATA
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


BINARY = binary()


def changed(change: Callable[[dict[str, Any]], Any]) -> bytes:
    document = copy.deepcopy(QUAD)
    change(document)
    return json.dumps(document).encode()


def set_in(*path: Any) -> Callable[[dict[str, Any]], None]:
    *keys, last, value = path

    def change(document: dict[str, Any]) -> None:
        part: Any = document
        for key in keys:
            part = part[key]
        part[last] = value

    return change


def few_vertices(document: dict[str, Any]) -> None:
    for index in (0, 1):
        document["accessors"][index]["count"] = 2


def with_material(more: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        document.update(more, materials=[{"normalTexture": {"index": 0}}])
        document["meshes"][0]["primitives"][0]["material"] = 0

    return change


ATTRIBUTES = ("meshes", 0, "primitives", 0, "attributes")
BAD_MODELS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "not a glTF model"),
    "garbage": (b"\x00\xff\x00", "not a glTF model"),
    "cut off": (changed(lambda d: None)[:-20], "not a glTF model"),
    "bomb": (b'{"asset": {"version": "2.0"}, "extras": ' + b"[" * 100_000, "brackets are nested too deeply"),
    "a list": (b"[]", "expected `object`, got `array`|Expected"),
    "no asset": (b"{}", "missing required field `asset`"),
    "version 1": (changed(set_in("asset", "version", "1.0")), "asset.version is '1.0'; ELYS reads glTF 2.0"),
    "wrong type": (
        changed(set_in("nodes", 0, "mesh", "x")),
        r"nodes\[...\].mesh: expected `int`, got `str`|nodes\[0\].mesh",
    ),
    "basisu": (
        changed(set_in("extensionsRequired", ["KHR_texture_basisu"])),
        "export its textures as PNG, JPEG or WebP",
    ),
    "unknown extension": (changed(set_in("extensionsRequired", ["ACME_magic"])), "requires the extension ACME_magic"),
    "no such mesh": (changed(set_in("nodes", 0, "mesh", 5)), r"nodes\[0\] names mesh 5, there are 1"),
    "no such node": (changed(set_in("scenes", 0, "nodes", [9])), "names node 9, there are 1"),
    "no such scene": (changed(set_in("scene", 4)), "scene names scene 4, there are 1"),
    "no such camera": (changed(set_in("nodes", 0, "camera", 0)), r"nodes\[0\] names camera 0, there are 0"),
    "no such light": (
        changed(set_in("nodes", 0, "extensions", {"KHR_lights_punctual": {"light": 0}})),
        "names light 0",
    ),
    "no such material": (
        changed(set_in("meshes", 0, "primitives", 0, "material", 3)),
        r"meshes\[0\].primitives\[0\] names material 3",
    ),
    "no such accessor": (changed(set_in(*ATTRIBUTES, "POSITION", 77)), "POSITION names accessor 77, there are 3"),
    "no such view": (changed(set_in("accessors", 0, "bufferView", 50)), "names buffer view 50"),
    "no such buffer": (changed(set_in("bufferViews", 0, "buffer", 50)), "names buffer 50"),
    "no position": (changed(set_in(*ATTRIBUTES[:-1], "attributes", {"NORMAL": 1})), "has no POSITION"),
    "own ancestor": (
        changed(set_in("nodes", 0, "children", [0])),
        r"nodes\[0\] has two parents or is its own ancestor",
    ),
    "ring without scene": (
        changed(lambda d: d.update(scenes=[], nodes=[{"children": [1]}, {"children": [0]}])),
        "every node is its own ancestor",
    ),
    "ring": (changed(lambda d: d.update(nodes=[{"children": [1]}, {"children": [0]}])), "its own ancestor"),
    "negative": (changed(set_in("bufferViews", 0, "byteOffset", -4)), "expected `int` >= 0"),
    "view too long": (
        changed(set_in("bufferViews", 0, "byteLength", 10**6)),
        r"bufferViews\[0\] reaches to byte \d+ of a buffer that has",
    ),
    "accessor too long": (
        changed(set_in("accessors", 0, "count", 99)),
        r"accessors\[0\] reaches to byte \d+ of a view",
    ),
    "accessor offset": (changed(set_in("accessors", 0, "byteOffset", 8)), r"accessors\[0\] reaches to byte"),
    "huge count": (changed(set_in("accessors", 0, "count", 10**30)), "count: "),
    "many zeros": (
        changed(set_in("accessors", 0, {"componentType": 5126, "count": 2**31, "type": "VEC4"})),
        "elements and no data",
    ),
    "count zero": (changed(set_in("accessors", 0, "count", 0)), "expected `int` >= 1"),
    "component type": (changed(set_in("accessors", 0, "componentType", 5124)), "componentType is 5124"),
    "type": (changed(set_in("accessors", 0, "type", "MAT5")), "type is 'MAT5'"),
    "stride": (changed(set_in("bufferViews", 0, "byteStride", 4)), "elements of 12 bytes, 4 bytes apart"),
    "positions of two": (changed(set_in("accessors", 0, "type", "VEC2")), "POSITION must be vectors of 3"),
    "normals too few": (changed(set_in("accessors", 1, "count", 3)), "NORMAL has 3 elements for 4 vertices"),
    "index too large": (changed(few_vertices), "indices names vertex 3, there are 2"),
    "float indices": (
        changed(set_in("meshes", 0, "primitives", 0, "indices", 0)),
        "indices must be unsigned whole numbers",
    ),
    "mode": (changed(set_in("meshes", 0, "primitives", 0, "mode", 7)), "mode: expected `int` <= 6"),
    "zero rotation": (
        changed(set_in("nodes", 0, "rotation", [0, 0, 0, 0])),
        r"nodes\[0\]: Transform.rotation must be a rotation",
    ),
    "short matrix": (changed(set_in("nodes", 0, "matrix", [1, 0])), "matrix: expected `array` of length"),
    "no data": (changed(lambda d: d["buffers"][0].pop("uri")), r"buffers\[0\] has no data"),
    "buffer shorter": (
        changed(set_in("buffers", 0, "byteLength", 10**6)),
        r"buffers\[0\] has \d+ bytes, 1000000 were promised",
    ),
    "missing file": (changed(set_in("buffers", 0, "uri", "gone.bin")), "the buffer file .*gone.bin does not exist"),
    "escape": (changed(set_in("buffers", 0, "uri", "../../etc/passwd")), "leaves the model's directory"),
    "hidden escape": (changed(set_in("buffers", 0, "uri", "a/%2e%2e/%2e%2e/b")), "leaves the model's directory"),
    "absolute": (changed(set_in("buffers", 0, "uri", "/etc/passwd")), "leaves the model's directory"),
    "web": (
        changed(set_in("buffers", 0, "uri", "https://example.org/a.bin")),
        "only files beside the model and data: are read",
    ),
    "file uri": (changed(set_in("buffers", 0, "uri", "file:///etc/passwd")), "only files beside the model"),
    "bad base64": (changed(set_in("buffers", 0, "uri", "data:;base64,@@@")), "is not base64"),
    "no comma": (changed(set_in("buffers", 0, "uri", "data:xyz")), "data: uri without data"),
    "nul": (changed(set_in("buffers", 0, "uri", "a%00b")), "is not a path|cannot be read"),
    "texture": (changed(with_material({})), "normal_texture names texture 0"),
    "no image": (changed(with_material({"textures": [{}]})), "texture 0 has no image"),
    "image index": (changed(lambda d: d.update(textures=[{"source": 3}])), r"textures\[0\] names image 3"),
    "camera without values": (
        changed(lambda d: d.update(cameras=[{"type": "perspective"}], nodes=[{"camera": 0}])),
        "without its values",
    ),
    "glb header": (b"glTF\x02\0\0\0", "a .glb of 8 bytes was cut off"),
    "glb version": (struct.pack("<4sII", b"glTF", 1, 12), "a .glb of version 1"),
    "glb empty": (struct.pack("<4sII", b"glTF", 2, 12), "first chunk is not JSON"),
    "glb cut": (BINARY[:-30], "was cut off: it says it has"),
    "glb chunk": (struct.pack("<4sIII4s", b"glTF", 2, 20, 99, b"JSON"), "reaches past its end"),
}


@pytest.mark.parametrize("data, expected", BAD_MODELS.values(), ids=BAD_MODELS.keys())
def test_each_fault_is_one_sentence_that_names_the_file(tmp_path: Path, data: bytes, expected: str) -> None:
    (tmp_path / "model.gltf").write_bytes(data)
    with pytest.raises(AssetError, match=expected) as caught:
        import_gltf(tmp_path / "model.gltf", AssetStore())
    assert str(caught.value).startswith(str(tmp_path / "model.gltf"))
    assert "\n" not in str(caught.value)


def test_a_missing_model_and_a_directory(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"the model file .*a\.glb does not exist"):
        import_gltf(tmp_path / "a.glb", AssetStore())
    with pytest.raises(AssetError, match="is a directory"):
        import_gltf(tmp_path, AssetStore())


@pytest.mark.parametrize(
    "image, expected",
    [
        ({}, "images[0] has no data"),
        ({"uri": "data:,hello"}, "images[0] is not an image"),
        ({"uri": "lost.png"}, "lost.png does not exist"),
        ({"uri": "../secret.png"}, "leaves the model's directory"),
        ({"bufferView": 9}, "images[0] names buffer view 9"),
    ],
)
def test_an_image_that_cannot_be_had_is_told_of_and_becomes_a_checker(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, image: Any, expected: str
) -> None:
    (tmp_path / "model.gltf").write_bytes(changed(with_material({"textures": [{"source": 0}], "images": [image]})))
    assets = AssetStore()
    records = import_gltf(tmp_path / "model.gltf", assets)
    assert assets.get(records[1].components["Material"]["normal_texture"]) == placeholder_image()
    assert expected in caplog.text
    assert str(tmp_path / "model.gltf") in caplog.text


def test_many_entities_of_few_bytes_are_refused(tmp_path: Path) -> None:
    def change(document: dict[str, Any]) -> None:
        document["meshes"][0]["primitives"] *= 1000
        document["nodes"] = [{"mesh": 0}] * 300
        document["scenes"] = [{"nodes": list(range(300))}]

    (tmp_path / "model.gltf").write_bytes(changed(change))
    with pytest.raises(AssetError, match="more than 262144 entities"):
        import_gltf(tmp_path / "model.gltf", AssetStore())


def test_many_siblings_of_one_name_are_told_apart(tmp_path: Path) -> None:
    def change(document: dict[str, Any]) -> None:
        document["nodes"] = [{"name": "same"}] * 20_000
        document["scenes"] = [{"nodes": list(range(20_000))}]

    (tmp_path / "model.gltf").write_bytes(changed(change))
    names = [record.name for record in import_gltf(tmp_path / "model.gltf", AssetStore())]
    assert len(set(names)) == 20_001
    assert names[-1] == "same 20000"


def attempt(data: bytes, directory: Path) -> None:
    path = directory / "fuzz.glb"
    path.write_bytes(data)
    with contextlib.suppress(ElysError):
        import_gltf(path, AssetStore())


@given(
    st.lists(st.tuples(st.integers(0, len(BINARY) - 1), st.integers(0, 255)), min_size=1, max_size=4),
    st.integers(0, 40),
)
@settings(max_examples=200)
def test_a_damaged_glb_is_imported_or_refused(tmp_path_factory: pytest.TempPathFactory, changes: Any, cut: int) -> None:
    data = bytearray(BINARY)
    for place, value in changes:
        data[place] = value
    attempt(bytes(data[: len(data) - cut]), tmp_path_factory.getbasetemp())


DOCUMENT = json.loads(changed(lambda d: None))
NUMBERS = st.integers(-2, 8) | st.sampled_from([2**31, 2**40, 2**63, 5121, 5123, 5126]) | st.floats()


def places(part: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths to all numbers of the document."""
    if isinstance(part, dict):
        return [p for key, value in part.items() for p in places(value, (*path, key))]
    if isinstance(part, list):
        return [p for index, value in enumerate(part) for p in places(value, (*path, index))]
    return [path] if isinstance(part, int | float) else []


@given(st.lists(st.tuples(st.sampled_from(places(DOCUMENT)), NUMBERS), min_size=1, max_size=3))
@settings(max_examples=200)
def test_wrong_numbers_anywhere_are_imported_or_refused(tmp_path_factory: pytest.TempPathFactory, changes: Any) -> None:
    document = copy.deepcopy(DOCUMENT)
    for path, value in changes:
        set_in(*path, value)(document)
    attempt(json.dumps(document).encode(), tmp_path_factory.getbasetemp())
