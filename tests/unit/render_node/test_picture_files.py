"""Numbers in EXR and .npy files, read back by others: FFmpeg, and a plain reader after the description of the format."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import get_args

import av
import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from elys.bus.messages.views import Shows
from elys.common.components import Camera, Component, Material, MeshRenderer, Transform
from elys.common.errors import ElysError
from elys.render_node.offline import OfflineRenderer
from elys.render_node.picture_files import MEANINGS, holds_numbers, output_kind, save_values
from tests.unit.render_node.test_debug_drawing import scene

ROWS_PER_BLOCK = 16  # of ZIP compression
PIXEL_TYPES = {0: "<u4", 1: "<f2", 2: "<f4"}


def plain_exr(path: Path) -> dict[str, NDArray[np.generic]]:
    """Channels (H, W) of a scan line file. OpenEXR, "Technical Introduction" and "File Layout"."""
    data = path.read_bytes()
    assert data[:8] == bytes((0x76, 0x2F, 0x31, 0x01, 2, 0, 0, 0))
    header, place = {}, 8
    while data[place]:
        name, kind, _ = data[place:].split(b"\0", 2)
        place += len(name) + len(kind) + 2
        (size,) = struct.unpack_from("<i", data, place)
        header[name.decode()] = data[place + 4 : place + 4 + size]
        place += 4 + size
    assert header["compression"] == b"\x03"  # ZIP
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    channels, listed = [], header["channels"]
    while listed[0]:
        name, listed = listed.split(b"\0", 1)
        channels.append((name.decode(), np.dtype(PIXEL_TYPES[struct.unpack_from("<i", listed)[0]])))
        listed = listed[16:]
    found = {name: np.empty((height, width), kind) for name, kind in channels}
    row_size = sum(kind.itemsize for _, kind in channels) * width
    offsets = struct.unpack_from(f"<{-(-height // ROWS_PER_BLOCK)}Q", data, place + 1)
    for offset in offsets:
        y, size = struct.unpack_from("<ii", data, offset)
        rows = min(ROWS_PER_BLOCK, bottom - y + 1)
        block = unpacked(data[offset + 8 : offset + 8 + size], rows * row_size)
        at = 0
        for row in range(y - top, y - top + rows):
            for name, kind in channels:
                found[name][row] = np.frombuffer(block, kind, width, at)
                at += kind.itemsize * width
    return found


def unpacked(packed: bytes, size: int) -> bytes:
    """A block, which is stored as it is where packing would not make it smaller."""
    if len(packed) == size:
        return packed
    differences = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
    differences[1:] -= 128
    mixed = (np.cumsum(differences) & 255).astype(np.uint8)
    block = np.empty(size, np.uint8)
    block[0::2], block[1::2] = mixed[: (size + 1) // 2], mixed[(size + 1) // 2 :]
    return block.tobytes()


def values(kind: type, components: int) -> NDArray[np.generic]:
    """Numbers that no 8 bits hold: small, large, and those that are none."""
    made = np.random.default_rng(5).normal(size=(37, 53, components)) * np.logspace(-3, 4, 53)[None, :, None]
    return np.abs(made).astype(kind)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_colours_are_read_by_another_reader_as_they_were(tmp_path: Path, kind: type) -> None:
    path = tmp_path / "light.exr"
    light = values(kind, 3)
    save_values(path, light, view="shaded")
    found = plain_exr(path)
    assert set(found) == {"R", "G", "B"}
    for component, name in enumerate("RGB"):
        assert found[name].dtype == kind
        np.testing.assert_array_equal(found[name], light[..., component])
    with av.open(str(path)) as file:
        (frame,) = file.decode(video=0)
    assert frame.format.name in ("gbrpf16le", "gbrpf32le")
    form = np.float16 if "16" in frame.format.name else np.float32
    planes = [np.frombuffer(bytes(plane), form).reshape(37, -1)[:, :53] for plane in frame.planes[:3]]
    for plane, component in zip(planes, (1, 2, 0), strict=True):
        np.testing.assert_array_equal(plane, light[..., component])


@pytest.mark.parametrize(
    ("view", "kind", "name"),
    [
        ("depth", np.float32, "Z"),
        ("entity", np.uint32, "id"),
        ("segmentation", np.uint32, "class"),
        ("roughness", np.float32, "Y"),
        ("overdraw", np.float32, "Y"),
    ],
)
def test_single_numbers_are_kept_exactly(tmp_path: Path, view: str, kind: type, name: str) -> None:
    made = values(kind, 1)
    if kind is np.uint32:
        made[3, 4] = 4_294_967_295
    else:
        made[3, 4] = np.inf
    save_values(tmp_path / "it.exr", made, view=view)
    save_values(tmp_path / "it.npy", made, view=view)
    found = plain_exr(tmp_path / "it.exr")
    assert set(found) == {name}
    assert found[name].dtype == kind
    np.testing.assert_array_equal(found[name], made[..., 0])
    array = np.load(tmp_path / "it.npy", allow_pickle=False)
    assert array.dtype == kind
    np.testing.assert_array_equal(array, made[..., 0])


def test_what_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    for suffix in (".exr", ".npy"):
        assert holds_numbers(tmp_path / f"a{suffix}")
        assert output_kind(tmp_path / f"a{suffix.upper()}") == "picture"
        with pytest.raises(ElysError, match=f"gone/a{suffix} cannot be written"):
            save_values(tmp_path / "gone" / f"a{suffix}", values(np.float32, 3), view="shaded")
    assert not holds_numbers(Path("a.png"))
    with pytest.raises(ElysError, match=r"known|are \.png, \.exr, \.npy, \.mp4"):
        output_kind(tmp_path / "a.tiff")


def read_by_ffmpeg(path: Path) -> NDArray[np.float32]:
    """R, G, B (H, W, 3) as FFmpeg's own decoder finds them, which shares no code with OpenEXR."""
    with av.open(str(path)) as file:
        (frame,) = file.decode(video=0)
    assert frame.format.name == "gbrpf32le"
    width, height = frame.width, frame.height
    planes = [np.frombuffer(bytes(plane), np.float32).reshape(height, -1)[:, :width] for plane in frame.planes[:3]]
    return np.stack([planes[2], planes[0], planes[1]], axis=-1)


@pytest.mark.gl
def test_a_scene_is_read_by_others_the_right_way_round(context, tmp_path: Path) -> None:
    """Red stands in the upper left of it, green in the lower right, both far brighter than white."""

    def glowing(place: tuple[float, float, float], color: tuple[float, float, float]) -> tuple[Component, ...]:
        return (Transform(position=place), MeshRenderer(), Material(base_color=(0.0, 0.0, 0.0), emissive=color))

    mirror = scene(
        ("Red", 0, glowing((-1.5, 1.0, 0.0), (40.0, 0.0, 0.0))),
        ("Green", 0, glowing((1.5, -1.0, 0.0), (0.0, 0.125, 0.0))),
        ("Eye", 0, (Transform(position=(0.0, 0.0, 6.0)), Camera())),
    )
    with OfflineRenderer(mirror, width=60, height=40, environment=False, context=context) as renderer:
        renderer.write_picture(tmp_path / "light.exr")
        renderer.write_picture(tmp_path / "light.npy")
    light = read_by_ffmpeg(tmp_path / "light.exr")
    assert light.shape == (40, 60, 3)
    np.testing.assert_array_equal(light, np.load(tmp_path / "light.npy"))
    for color, value, rows, columns in (
        (0, 40.0, slice(0, 20), slice(0, 30)),
        (1, 0.125, slice(20, 40), slice(30, 60)),
    ):
        assert light[..., color].max() == pytest.approx(value, abs=0.05)
        outside = light[..., color].copy()
        outside[rows, columns] = 0.0
        assert outside.max() < 0.05
    with OpenEXR.File(str(tmp_path / "light.exr"), separate_channels=True) as file:
        header, channels = dict(file.header()), file.channels()
        assert sorted(channels) == ["B", "G", "R"]
        for component, name in enumerate("RGB"):
            np.testing.assert_array_equal(channels[name].pixels, light[..., component])
    assert header["comments"] == "ELYS: linear radiance, before exposure and tone mapping"
    np.testing.assert_allclose(header["chromaticities"], (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), atol=1e-6)
    for window in ("dataWindow", "displayWindow"):
        corners = [tuple(map(int, corner)) for corner in header[window]]
        assert corners == [(0, 0), (59, 39)]
    assert header["lineOrder"] == OpenEXR.INCREASING_Y
    assert float(header["pixelAspectRatio"]) == 1.0


def test_numbers_that_are_no_colours_claim_no_primaries(tmp_path: Path) -> None:
    for view, components, said in (("depth", 1, "metres along the camera's axis"), ("normals", 3, "unit normals")):
        save_values(tmp_path / "it.exr", values(np.float32, components), view=view)
        with OpenEXR.File(str(tmp_path / "it.exr")) as file:
            assert said in file.header()["comments"]
            assert "chromaticities" not in file.header()


def test_every_view_says_what_its_numbers_are() -> None:
    assert set(MEANINGS) == set(get_args(Shows))
