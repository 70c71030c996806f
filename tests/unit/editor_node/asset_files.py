"""A small project on the disk: an image, a model of one triangle pair, light, a prefab and a broken model."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image


def write_image(path: Path, color: tuple[int, int, int], size: tuple[int, int] = (64, 32)) -> None:
    """A PNG of one colour."""
    Image.new("RGB", size, color).save(path)


def write_model(path: Path, *, buffer: str = "", size: float = 1.0, color=(0.8, 0.1, 0.1)) -> None:
    """A glTF square of `size` that stands upright on the ground; its vertices in the file `buffer` beside it if one is named."""
    half = size / 2
    corners = np.array([(-half, 0, 0), (half, 0, 0), (half, size, 0), (-half, size, 0)], "<f4")
    data = corners.tobytes() + struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    uri = buffer or f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
    if buffer:
        (path.parent / buffer).write_bytes(data)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "Square"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"doubleSided": True, "pbrMetallicRoughness": {"baseColorFactor": [*color, 1.0]}}],
        "buffers": [{"byteLength": len(data), "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 4,
                "type": "VEC3",
                "min": corners.min(0).tolist(),
                "max": corners.max(0).tolist(),
            },
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    }
    path.write_text(json.dumps(document))


def write_cart(path: Path) -> None:
    """A glTF model of three meshes in a tree: a cart with two wheels that share one, and a cover."""
    write_model(path)
    document = json.loads(path.read_text())
    corners = document["accessors"][0]
    for size in (2.0, 3.0):
        points = np.array([(-size, 0, 0), (size, 0, 0), (size, size, 0), (-size, size, 0)], "<f4")
        uri = f"data:application/octet-stream;base64,{base64.b64encode(points.tobytes()).decode()}"
        document["buffers"].append({"byteLength": 48, "uri": uri})
        document["bufferViews"].append({"buffer": len(document["buffers"]) - 1, "byteLength": 48})
        view = len(document["bufferViews"]) - 1
        bounds = {"min": points.min(0).tolist(), "max": points.max(0).tolist()}
        document["accessors"].append({**corners, "bufferView": view, **bounds})
        place = len(document["accessors"]) - 1
        document["meshes"].append({"primitives": [{"attributes": {"POSITION": place}, "indices": 1, "material": 0}]})
    document["nodes"] = [
        {"name": "Cart", "mesh": 0, "children": [1, 2, 3]},
        {"name": "Wheel", "mesh": 1, "translation": [1, 0, 0]},
        {"name": "Wheel", "mesh": 1, "translation": [-1, 0, 0]},
        {"name": "Cover", "mesh": 2},
    ]
    path.write_text(json.dumps(document))


def write_light(path: Path, light=(1.0, 1.0, 2.0)) -> None:
    """A Radiance picture of linear light (H, W, 3), or of 8 x 16 pixels of one colour; it is not packed."""
    light = np.asarray(light, np.float64)
    light = np.broadcast_to(light, (8, 16, 3)) if light.ndim == 1 else light
    _, exponent = np.frexp(light.max(axis=-1, keepdims=True))
    rows = np.concatenate((light / np.ldexp(1.0, exponent) * 256.0, exponent + 128), axis=-1)
    height, width, _ = light.shape
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    path.write_bytes(head + np.clip(rows, 0, 255).astype(np.uint8).tobytes())


def write_prefab(path: Path, model: str) -> None:
    """A prefab that holds a model and a box."""
    entity = {"name": "Pair", "children": [{"prefab": model}, {"name": "Box", "components": {"MeshRenderer": {}}}]}
    path.write_text(json.dumps({"elys_scene": 1, "entities": [entity]}))


def write_project(folder: Path) -> None:
    """All of them."""
    (folder / "textures").mkdir()
    write_image(folder / "textures" / "brick.png", (200, 60, 40))
    write_image(folder / "grass.png", (40, 160, 50))
    write_model(folder / "square.gltf")
    write_light(folder / "sky.hdr")
    write_prefab(folder / "pair.prefab.json", "square.gltf")
    (folder / "broken.glb").write_bytes(b"no model")
    (folder / "notes.txt").write_text("nothing")
    (folder / ".hidden").mkdir()
    write_image(folder / ".hidden" / "secret.png", (0, 0, 0))
