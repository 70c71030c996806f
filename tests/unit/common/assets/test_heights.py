"""Ground from files: pictures as another library reads them, arrays as they were saved, anything else in one sentence."""

from __future__ import annotations

import io
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from elys.common.assets import AssetStore, decode_mesh
from elys.common.assets.gray_png import decode_gray_png
from elys.common.assets.heights import decode_heights, height_mesh
from elys.common.errors import AssetError, SceneError
from elys.common.scene import SceneSettings, collapse, open_scene

MANY = 1 << 20


def png(pixels: np.ndarray, *, color: int = 0, interlace: int = 0, filters: list[int] | None = None) -> bytes:
    """A grayscale PNG (H, W), each row with a filter of choice; written as the specification says, pixel by pixel."""
    step = pixels.dtype.itemsize
    rows = pixels.astype(pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(len(pixels), -1).astype(int)
    lines = []
    above = np.zeros(rows.shape[1], int)
    for row, kind in zip(rows, filters or [0] * len(rows), strict=True):
        line = [kind]
        for k in range(len(row)):
            a, c = (row[k - step], above[k - step]) if k >= step else (0, 0)
            b = above[k]
            nearest = min((a, b, c), key=lambda x, a=a, b=b, c=c: abs(a + b - c - x))
            line.append((row[k] - (0, a, b, (a + b) // 2, nearest)[kind]) % 256)
        lines.append(bytes(line))
        above = row
    height, width = pixels.shape
    header = struct.pack(">IIBBBBB", width, height, 8 * step, color, 0, 0, interlace)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in ((b"IHDR", header), (b"IDAT", zlib.compress(b"".join(lines))), (b"IEND", b""))
    )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_pixels_are_those_that_another_library_reads(dtype) -> None:
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, np.iinfo(dtype).max + 1, (20, 13)).astype(dtype)
    data = png(pixels, filters=rng.permutation(np.arange(20) % 5).tolist())
    read = np.asarray(Image.open(io.BytesIO(data))).astype(np.float64)
    assert np.array_equal(read, pixels)
    np.testing.assert_array_equal(decode_gray_png(data, most_pixels=MANY) * np.iinfo(dtype).max, read)


def test_what_another_library_writes_is_read() -> None:
    pixels = (np.add.outer(np.arange(300), np.arange(200)) * 100).astype(np.uint16)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    np.testing.assert_allclose(decode_heights(file.getvalue()), pixels / 65535.0, rtol=1e-15)


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.mark.parametrize(
    "array", [np.arange(12.0).reshape(3, 4), np.arange(12).reshape(3, 4).T, np.ones((2, 2), ">f4")]
)
def test_an_array_comes_as_it_was_saved(array) -> None:
    assert np.array_equal(decode_heights(npy(array)), array)


GOOD = png(np.zeros((4, 4), np.uint16))


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "it is neither a grayscale PNG nor a .npy file"),
        (b"\x93NUMPY\x01\x00\xff\xff{", "it is neither a grayscale PNG nor a .npy file"),
        (png(np.zeros((4, 12), np.uint8), color=2), "it is a PNG in colour"),
        (png(np.zeros((4, 4), np.uint8), interlace=1), "it is interlaced"),
        (png(np.zeros((1, 4), np.uint8)), "it has 1 x 4 heights; ground takes at least 2 x 2"),
        (GOOD[:40], "it is damaged"),
        (GOOD[:20], "it has no header"),
        (GOOD.replace(b"IDAT", b"IDOT"), "its pixels end too early"),
        (GOOD.replace(struct.pack(">II", 4, 4), struct.pack(">II", 9, 9)), "its pixels end too early"),
        (GOOD.replace(struct.pack(">II", 4, 4), struct.pack(">II", 40_000, 40_000)), "it has 40000 x 40000 pixels"),
        (npy(np.zeros(4)), r"it is an array of shape \(4,\)"),
        (npy(np.zeros((2, 2), complex)), "complex128; heights are numbers in rows and columns"),
        (npy(np.array([[0.0, np.nan], [0.0, 0.0]])), "finite"),
        (npy(np.full((2, 2), 1e12)), "finite and within"),
        (npy(np.zeros((4, 4)))[:-1], "its numbers end too early"),
        (npy(np.zeros((2, 2))).replace(b"(2, 2), }          ", b"(9999, 9999), }    "), "it has 9999 x 9999 heights"),
        (b"\x93NUMPY", "it is neither"),
    ],
)  # fmt: skip
def test_what_holds_no_heights_is_said_in_a_sentence(data: bytes, sentence: str) -> None:
    with pytest.raises(AssetError, match=sentence):
        decode_heights(data)


def test_a_mesh_of_ground_has_its_heights_and_faces_up() -> None:
    heights = np.array([[0.0, 1.0, 0.0], [2.0, 0.0, 0.0]])
    mesh = height_mesh(heights)
    corner = dict(zip(map(tuple, mesh.positions[:, [0, 2]].tolist()), mesh.positions[:, 1].tolist(), strict=True))
    assert corner[0.0, -0.5] == 1.0  # in the middle of the upper row
    assert corner[-0.5, 0.5] == 2.0
    triangles = mesh.positions[mesh.indices.reshape(-1, 3)]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert (normals[:, 1] > 0.0).all()
    assert (mesh.normals[:, 1] > 0.0).all()
    assert mesh.triangle_count == 4
    slope = height_mesh(np.tile(np.linspace(0.0, 1.0, 5), (4, 1)))  # 45 degrees up along x
    np.testing.assert_allclose(slope.normals, np.tile([-np.sqrt(0.5), np.sqrt(0.5), 0.0], (20, 1)), atol=1e-6)


def test_a_scene_names_a_file_of_heights_to_collide_with_and_to_draw(tmp_path: Path) -> None:
    np.save(tmp_path / "hills.npy", np.arange(6.0).reshape(2, 3))
    components = {"Collider": {"shape": "height_field", "heights": "hills.npy"}, "MeshRenderer": {"mesh": "hills.npy"}}
    path = write(tmp_path, components)
    scene = open_scene(path, assets := AssetStore())
    (record,) = scene.records
    reference = record.components["Collider"]["heights"]
    assert np.array_equal(decode_heights(assets.get(reference)), np.arange(6.0).reshape(2, 3))
    assert decode_mesh(assets.get(record.components["MeshRenderer"]["mesh"])).vertex_count == 6
    written = collapse([record], name="", settings=SceneSettings(), directory=tmp_path, assets=assets)
    assert written.entities[0].components == components


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("gone.png", r"entities\[0\].components.Collider.heights: the height file .*gone\.png does not exist"),
        (
            "words.npy",
            r"Collider.heights: .*words\.npy holds no heights: it is neither a grayscale PNG nor a \.npy file",
        ),
        ("hills.tif", r"Collider.heights: 'hills.tif' is no file of heights; those are .png and .npy files"),
        ("box", r"Collider.heights: 'box' is no file of heights"),
    ],
)
def test_a_file_that_is_none_is_named_with_its_place(tmp_path: Path, name: str, sentence: str) -> None:
    (tmp_path / "words.npy").write_text("once upon a time")
    path = write(tmp_path, {"Collider": {"shape": "height_field", "heights": name}})
    with pytest.raises(SceneError, match=sentence):
        open_scene(path, AssetStore())


def write(folder: Path, components: dict[str, Any]) -> Path:
    path = folder / "ground.scene.json"
    path.write_text(json.dumps({"elys_scene": 1, "entities": [{"components": components}]}))
    return path
