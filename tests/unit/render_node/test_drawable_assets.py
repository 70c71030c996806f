"""Meshes and images that arrive late, broken or never."""

from __future__ import annotations

import io
import struct
import threading
import zlib

import numpy as np
import pytest
import simplejpeg
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from elys.common.assets import AssetStore, encode_mesh, primitive
from elys.common.components import Material, MeshRenderer, Transform
from elys.common.errors import AssetError, DisplayError, RequestError
from elys.common.scene import SceneSettings
from elys.render_node.camera import framing_camera
from elys.render_node.drawable_assets import UNKNOWN_EXTENT, DrawableAssets
from elys.render_node.gpu import Context
from elys.render_node.images import decode_image, shrunk
from elys.render_node.quality import EXACT
from elys.render_node.renderer import Renderer
from elys.render_node.resources import Geometry

RED = np.full((4, 6, 3), (250, 10, 10), np.uint8)
RED_AND_BLUE = np.repeat(np.array([[(250, 10, 10, 255)], [(10, 10, 250, 255)]], np.uint8), 2, axis=0).repeat(4, axis=1)


def test_a_mesh_is_asked_for_once_and_comes() -> None:
    store = AssetStore()
    name = store.put(encode_mesh(primitive("cone")), kind="mesh")
    release, asked, ready = threading.Event(), [], threading.Event()

    def fetch(reference: str) -> bytes:
        asked.append(reference)
        release.wait(20)
        return store.get(reference)

    assets = DrawableAssets(fetch, on_ready=ready.set)
    assert assets.mesh(name) is None
    assert assets.mesh(name) is None
    assert assets.extent_of(name) is UNKNOWN_EXTENT
    release.set()
    assert ready.wait(20)
    assets.settle()
    mesh = assets.mesh(name)
    assert mesh is not None
    np.testing.assert_array_equal(mesh.positions, primitive("cone").positions)
    assert assets.extent_of(name).upper == pytest.approx((0.5, 0.5, 0.5))
    assert asked == [name]
    assert assets.version == 1
    assets.close()


def test_what_cannot_be_had_is_remembered_with_its_reason() -> None:
    store = AssetStore()
    garbage = store.put(b"no mesh at all", kind="mesh")
    assets = DrawableAssets(store.get)
    for name in (garbage, "blake2b:" + "0" * 32, "nonsense"):
        assert assets.mesh(name) is None
    assets.settle()
    assert set(assets.failed) == {garbage, "blake2b:" + "0" * 32, "nonsense"}
    assert "not a mesh" in assets.failed[garbage]
    assets.retry_failed()
    assert not assets.failed
    assets.close()


@pytest.mark.gl
def test_missing_things_are_drawn_around_and_failures_are_marked(stage, renderer) -> None:
    stage.add(Transform(), MeshRenderer(mesh="blake2b:" + "1" * 32))
    stage.add(Transform(position=(2.0, 0.0, 0.0)), MeshRenderer(), Material(base_color_texture="blake2b:" + "2" * 32))
    world = stage.world()
    camera = framing_camera((-1, -1, -1), (3, 1, 1), aspect=2.0, direction=(0, 0, -1))
    renderer.draw(world, camera, 60, 30)
    renderer.settle(world)
    world.place()
    picture = renderer.read_pixels(renderer.draw(world, camera, 60, 30))
    magenta = (picture[..., 0] > 150) & (picture[..., 1] < 60)
    assert magenta.sum() > 20
    assert renderer.pick(world, camera, 60, 30, 15, 15)[0] == 1


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP", "BMP"])
def test_images_are_decoded_upright(kind: str) -> None:
    pixels = RED.copy()
    pixels[2:] = (10, 10, 250)
    data = io.BytesIO()
    Image.fromarray(np.repeat(np.repeat(pixels, 8, 0), 8, 1)).save(data, format=kind)
    decoded = decode_image(data.getvalue())
    assert decoded.shape == (32, 48, 4)
    assert decoded[4, 4, 0] > 200
    assert decoded[28, 4, 2] > 200


def encoded(pixels: np.ndarray, mode: str, form: str = "PNG", **options: object) -> bytes:
    data = io.BytesIO()
    Image.fromarray(pixels).convert(mode).save(data, format=form, **options)
    return data.getvalue()


def test_unusual_pixels_become_the_same_colours() -> None:
    grey = np.repeat(np.arange(0, 256, 5, dtype=np.uint8)[None], 8, axis=0)
    wanted = np.stack((grey, grey, grey, np.full_like(grey, 255)), axis=-1)
    deep = io.BytesIO()
    Image.fromarray(grey.astype(np.uint16) * 257).save(deep, format="PNG")
    for data in (encoded(grey, "L"), encoded(grey, "P"), encoded(grey, "LA"), deep.getvalue()):
        np.testing.assert_array_equal(decode_image(data), wanted)
    color = np.ascontiguousarray(np.broadcast_to(np.array((200, 60, 30), np.uint8), (16, 16, 3)))
    inks = decode_image(encoded(color, "CMYK", "JPEG", quality=95))
    assert np.abs(inks[..., :3].astype(int) - color).max() < 8
    bits = decode_image(encoded(grey, "1"))
    assert set(np.unique(bits[..., 0])) == {0, 255}


def test_an_image_of_absurd_size_is_refused_before_it_is_decoded() -> None:
    header = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBB", 13, b"IHDR", 60_000, 60_000, 8, 2, 0, 0, 0)
    header += struct.pack(">I", zlib.crc32(header[12:29]))
    with pytest.raises(AssetError, match=r"larger than|exceeds limit"):
        decode_image(header + struct.pack(">I4s", 0, b"IDAT") + bytes(4))


@given(st.binary(max_size=300), st.integers(0, 400))
def test_damaged_images_are_one_sentence(noise: bytes, cut: int) -> None:
    whole = simplejpeg.encode_jpeg(np.ascontiguousarray(RED), colorspace="RGB")
    png = io.BytesIO()
    Image.fromarray(RED).save(png, format="PNG")
    for data in (
        noise,
        b"\x89PNG\r\n\x1a\n" + noise,
        b"\xff\xd8\xff" + noise,
        whole[: cut % 100],
        png.getvalue()[: cut % 60],
    ):
        try:
            assert decode_image(data).shape[2] == 4  # decoders make something of files whose end alone is missing
        except AssetError as error:
            assert "\n" not in str(error)


def test_hdr_pictures_in_runs_are_read_and_damaged_ones_refused() -> None:
    """By hand: 8 pixels of one colour, each channel a run; 128 with the exponent 129 is 128 / 256 * 2."""
    from elys.render_node.radiance_files import decode_radiance, fitted

    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 8\n"
    row = bytes((2, 2, 0, 8, 136, 128, 136, 64, 8, 0, 1, 2, 3, 4, 5, 6, 7, 136, 129))
    radiance = decode_radiance(head + row)
    assert radiance.shape == (1, 8, 3)
    np.testing.assert_allclose(radiance[0, :, 0], 1.0)
    np.testing.assert_allclose(radiance[0, :, 1], 0.5)
    np.testing.assert_allclose(radiance[0, :, 2], np.arange(8) / 128)
    assert fitted(radiance, 4).shape == (1, 2, 3)
    for damaged in (
        head + row[:-3],
        head + row[:4] + bytes((255,)) + row[5:],
        head[:30],
        head.replace(b"-Y 1", b"-Y 999999"),
    ):
        with pytest.raises(AssetError, match=r"hdr"):
            decode_radiance(damaged)


@pytest.mark.gl
def test_an_image_that_is_sampled_in_two_ways_is_there_for_both(stage, renderer) -> None:
    """Also where each comes between the look for it and the wait, which then has nothing to wait for."""

    class Quick(DrawableAssets):
        def wait_for_one(self, timeout: float) -> bool:
            self.settle(timeout)
            return False

    store = AssetStore()
    data = io.BytesIO()
    Image.new("RGB", (4, 4), (0, 200, 0)).save(data, "PNG")
    name = store.put(data.getvalue(), kind="image")
    for place, options in enumerate(("", "?wrap=clamp,clamp", "?wrap=mirror,mirror")):
        plain = Material(base_color=(1.0, 1.0, 1.0), unlit=True, base_color_texture=name + options)
        stage.add(Transform(position=(2.0 * place - 2.0, 0.0, 0.0)), MeshRenderer(), plain)
    world = stage.world(Quick(store.get))
    renderer.settle(world)
    camera = framing_camera((-2.5, -0.5, -0.5), (2.5, 0.5, 0.5), aspect=3.0, direction=(0, 0, -1))
    row = renderer.read_pixels(renderer.draw(world, camera, 90, 30))[15, 10:80:35]
    assert (row[:, 1] > 150).all()
    assert (row[:, 0] < 60).all()


class Host:
    """Serves a store, or nothing; and a clock that is set by hand."""

    def __init__(self, store: AssetStore) -> None:
        self.store, self.serves, self.asked_at, self.now = store, False, [], 0.0

    def fetch(self, reference: str) -> bytes:
        self.asked_at.append(self.now)
        if not self.serves:
            raise RequestError("nobody answers")
        return self.store.get(reference)

    def assets(self) -> DrawableAssets:
        return DrawableAssets(self.fetch, clock=lambda: self.now)


def test_what_could_not_be_had_is_asked_for_again_ever_more_seldom_until_it_comes(caplog) -> None:
    store = AssetStore()
    name = store.put(encode_mesh(primitive("cone")), kind="mesh")
    host = Host(store)
    assets = host.assets()
    assert assets.retry_pause is None
    assets.mesh(name)
    assets.settle()
    version = assets.version
    for _ in range(9):
        pause = assets.retry_pause
        assert pause is not None
        host.now += 0.99 * pause
        assets.retry_due()  # too early
        assets.settle()
        host.now += 0.011 * pause
        assets.retry_due()
        assets.settle()
        assert assets.mesh(name) is None and name in assets.failed  # and drawing asks for nothing besides
    assert np.diff(host.asked_at) == pytest.approx([1, 2, 4, 8, 16, 32, 60, 60, 60], rel=2e-3)
    assert assets.version == version  # nothing is built anew for failing again
    assert [record.message for record in caplog.records] == [f"drawn without {name}, until it comes: nobody answers"]
    host.serves = True
    host.now += 61.0
    assets.retry_due()
    assets.settle()
    assert assets.mesh(name) is not None
    assert not assets.failed and assets.version > version
    assert assets.retry_pause is None
    assets.close()


def test_what_came_and_is_no_good_is_not_asked_for_again() -> None:
    store = AssetStore()
    garbage = store.put(b"no mesh at all", kind="mesh")
    host = Host(store)
    assets = host.assets()
    assets.mesh(garbage)
    assets.settle()
    host.serves, host.now = True, 2.0
    assets.retry_due()
    assets.settle()
    assert "not a mesh" in assets.failed[garbage]
    assert assets.retry_pause is None
    assets.close()


@pytest.mark.gl
def test_meshes_and_images_that_come_late_take_the_place_of_what_stood_for_them(stage, renderer) -> None:
    store = AssetStore()
    buffer = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), (0, 200, 0), np.uint8)).save(buffer, "PNG")
    image = store.put(buffer.getvalue(), kind="image")
    mesh = store.put(encode_mesh(primitive("sphere")), kind="mesh")
    glow = Material(base_color=(0.0, 0.0, 0.0), emissive=(0.0, 0.0, 1.0))
    stage.add(Transform(), MeshRenderer(mesh=mesh), glow)
    lit = Material(base_color=(0.0, 0.0, 0.0), emissive=(1.0, 1.0, 1.0), base_color_texture=image)
    stage.add(Transform(position=(2.0, 0.0, 0.0)), MeshRenderer(), lit)
    stage.settings = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))
    host = Host(store)
    world = stage.world(host.assets())
    camera = framing_camera((-1, -1, -1), (3, 1, 1), aspect=2.0, direction=(0, 0, -1))

    def seen() -> np.ndarray:
        renderer.draw(world, camera, 60, 30)
        renderer.settle(world)
        world.place()
        return renderer.read_pixels(renderer.draw(world, camera, 60, 30)).astype(int)

    for turn in range(2):
        before = seen()
        is_magenta = (before[..., 0] > 150) & (before[..., 1] < 60)
        assert is_magenta[:, :30].sum() > 20, turn
        host.now += 1.5
        world.assets.retry_due()
    host.serves, host.now = True, 10.0
    world.assets.retry_due()
    after = seen()
    assert not ((after[..., 0] > 150) & (after[..., 1] < 60)).any()
    assert ((after[..., 2] > 200) & (after[..., 0] < 60))[:, :30].sum() > 20  # the ball
    world.assets.close()


@pytest.mark.gl
def test_what_the_card_has_no_room_for_is_marked_and_said_once(stage, renderer, monkeypatch, caplog) -> None:
    """As the driver says it; `tests/process/test_memory_limits.py` takes the memory away for real."""
    store = AssetStore()
    buffer = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), (0, 190, 10), np.uint8)).save(buffer, "PNG")
    image = store.put(buffer.getvalue(), kind="image")
    stage.add(Transform(), MeshRenderer(mesh=store.put(encode_mesh(primitive("cone")), kind="mesh")))
    stage.add(Transform(position=(2.0, 0.0, 0.0)), MeshRenderer(), Material(base_color_texture=image))
    world = stage.world(DrawableAssets(store.get))
    camera = framing_camera((-1, -1, -1), (3, 1, 1), aspect=2.0, direction=(0, 0, -1))
    full = DisplayError("making it failed: the graphics card has no memory left")

    def refuse(*_: object, **__: object) -> None:
        raise full

    cones = primitive("cone").vertex_count
    with monkeypatch.context() as patched:
        patched.setattr(
            "elys.render_node.resources.Geometry",
            lambda context, mesh: refuse() if mesh.vertex_count == cones else Geometry(context, mesh),
        )
        patched.setattr("elys.render_node.resources.Texture.sample", refuse)
        for _ in range(2):  # the first asks for them
            renderer.draw(world, camera, 60, 30)
            world.assets.settle()
            world.place()
    for _ in range(3):
        world.place()
        picture = renderer.read_pixels(renderer.draw(world, camera, 60, 30)).astype(int)
    is_magenta = (picture[..., 0] > 150) & (picture[..., 1] < 60)
    assert is_magenta[:, :30].sum() > 20
    told = [record.message for record in caplog.records]
    assert len(told) == len({*told}) == 2 and all(message.endswith("no memory left") for message in told)
    world.assets.close()


def test_images_are_shrunk_by_means_and_colours_as_light() -> None:
    """5 by 3 of stripes in twos: the last column and row have fewer to average."""
    pixels = np.zeros((3, 5, 4), np.uint8)
    pixels[:, ::2], pixels[..., 3] = 255, (0, 100, 200, 250, 7)
    linear, color = shrunk(pixels, 3, is_color=False), shrunk(pixels, 3, is_color=True)
    assert linear.shape == color.shape == (2, 3, 4)
    assert linear[..., 0].tolist() == [[128, 128, 255]] * 2
    assert color[..., 1].tolist() == [[188, 188, 255]] * 2  # of sRGB, half the light
    assert linear[..., 3].tolist() == color[..., 3].tolist() == [[50, 225, 7]] * 2
    assert shrunk(pixels, 5, is_color=True) is pixels
    assert shrunk(RED_AND_BLUE, 2, is_color=True)[:, 0].tolist() == [[250, 10, 10, 255], [10, 10, 250, 255]]


@pytest.mark.gl
def test_an_image_larger_than_the_card_takes_is_drawn_coarser_and_named(stage, context, monkeypatch, caplog) -> None:
    """A checker of single pixels, which texels that are left out would make black or white."""
    checker = np.add.outer(np.arange(40), np.arange(64)) % 2
    store = AssetStore()
    image = store.put(
        encoded((checker[..., None] * np.full(3, 255)).astype(np.uint8), "RGB"), kind="image", source="wall.png"
    )
    stage.add(Transform())
    material = Material(base_color=(0.0, 0.0, 0.0), emissive=(1.0, 1.0, 1.0), emissive_texture=image)
    stage.add(Transform(), MeshRenderer(), material)
    monkeypatch.setattr(Context, "max_size", 16)
    for source_of, name in ((store.source, f"wall.png ({image})"), (lambda _: "", image)):
        world = stage.world(DrawableAssets(store.get, source_of=source_of))
        renderer = Renderer(context, quality=EXACT)
        renderer.settle(world)
        for _ in range(2):
            renderer.draw(world, framing_camera((-1, -1, -1), (1, 1, 1), direction=(0, 0, -1)), 32, 32)
        np.testing.assert_allclose(renderer.read_light(32, 32)[16, 16, :3], 0.5029, atol=2e-3)
        (record,) = caplog.records
        assert record.message == (
            f"{name}, the emissive_texture of entity 2, of 64 x 40 pixels is drawn with 16 x 10: this card takes edges up to 16"
        )
        caplog.clear()
        world.assets.close()
