"""Shaders that do not compile: what they should have drawn is magenta, said once, until the file is mended."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Light, Material, MeshRenderer, Transform, values_of
from elys.common.errors import ShaderError
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.gpu import Context
from elys.render_node.gpu.program import SHADERS
from elys.render_node.gpu.program_cache import RELOAD_VARIABLE
from elys.render_node.offline import OfflineRenderer
from elys.render_node.quality import EXACT, FAST, FULL, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer

pytestmark = pytest.mark.gl

SIZE = (60, 40)
CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
BOX, BEHIND = (slice(17, 23), slice(27, 33)), (slice(0, 6), slice(0, 60))  # rows and columns where they are seen
BREAK = "\nthis is no statement;\n"


class Files:
    """A copy of all shaders, to be broken and mended."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._times = 0

    def write(self, name: str, text: str) -> None:
        """Writes a file with a later time than it had, without waiting for the clock."""
        path = self.folder / name
        path.write_text(text)
        self._times += 1
        later = path.stat().st_mtime_ns + self._times * 1_000_000_000
        os.utime(path, ns=(later, later))

    def broken(self, name: str) -> str:
        """Adds what no compiler takes; returns what there was."""
        whole = (self.folder / name).read_text()
        self.write(name, whole + BREAK)
        return whole


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Files:
    folder = tmp_path / "shaders"
    shutil.copytree(str(resources.files(SHADERS)), folder)
    for module in ("program", "program_cache"):
        monkeypatch.setattr(f"elys.render_node.gpu.{module}.resources", SimpleNamespace(files=lambda _: folder))
    monkeypatch.setenv(RELOAD_VARIABLE, "1")
    return Files(folder)


@pytest.fixture
def world(stage: Any) -> RenderWorld:
    """A box before a sky, under a sun."""
    stage.settings = SceneSettings(background=(0.1, 0.3, 0.1), ambient=(0.3, 0.3, 0.3))
    stage.add(Transform(scale=(2.0, 2.0, 2.0)), MeshRenderer(), Material(base_color=(0.2, 0.7, 0.3)))
    stage.add(Transform(rotation=tuple(look_rotation((-0.5, -1.0, -0.4)).tolist())), Light())
    return stage.world()


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    return lambda: [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]


def drawn(renderer: Renderer, world: RenderWorld) -> NDArray[np.int64]:
    """RGB of a picture."""
    return renderer.read_pixels(renderer.draw(world, CAMERA, *SIZE))[..., :3].astype(np.int64)


def is_magenta(pixels: NDArray[np.int64]) -> bool:
    red, green, blue = (pixels[..., channel] for channel in range(3))
    return bool((red > 200).all() and (blue > 200).all() and (green < 150).all() and (red - green > 90).all())


@pytest.mark.parametrize("quality", [FULL, FAST])
@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("shaded.frag", "box"),
        ("shaded.vert", "box"),
        ("brdf.glsl", "box"),
        ("sky.frag", "sky"),
        ("tonemap.frag", "all"),
        ("depth.frag", "nothing"),
        ("instance_place.vert", "all"),
        ("frame.glsl", "all"),
    ],
)
def test_what_it_should_have_drawn_is_magenta_until_it_is_mended(
    context: Context,
    files: Files,
    world: RenderWorld,
    said: Callable[[], list[str]],
    quality: Quality,
    name: str,
    seen: str,
) -> None:
    if quality is FAST and name == "tonemap.frag":
        pytest.skip("nothing is tone-mapped by itself where passes write the screen's colours")
    expected = drawn(Renderer(context, quality=quality), world)
    assert not is_magenta(expected)
    whole = files.broken(name)
    line = len((whole + BREAK).splitlines())
    renderer = Renderer(context, quality=quality)
    for _ in range(3):
        picture = drawn(renderer, world)
        assert is_magenta(picture[BOX]) == (seen in ("box", "all"))
        assert is_magenta(picture[BEHIND]) == (seen in ("sky", "all"))
        if seen == "nothing":
            np.testing.assert_array_equal(picture, expected)
    of_it = [sentence for sentence in said() if name in sentence]
    assert of_it == said()
    assert len(of_it) == len({sentence.splitlines()[0] for sentence in of_it}) == 1, of_it
    assert f"the shader {name}, line {line}: " in of_it[0] or f"the shader {name}, line {line - 1}: " in of_it[0], of_it
    assert "this is no statement;" in of_it[0]
    files.write(name, whole)
    np.testing.assert_allclose(drawn(renderer, world), expected, atol=1)
    assert len(said()) == 1


def test_what_is_broken_anew_is_said_anew(
    context: Context, files: Files, world: RenderWorld, said: Callable[[], list[str]]
) -> None:
    whole = files.broken("shaded.frag")
    renderer = Renderer(context, quality=FULL)
    assert is_magenta(drawn(renderer, world)[BOX])
    files.write("shaded.frag", whole.replace("void main", "void mian"))  # another fault, of the linker
    assert is_magenta(drawn(renderer, world)[BOX])
    assert len(said()) == 2 and "shaded" in said()[1]
    files.write("shaded.frag", whole)
    assert not is_magenta(drawn(renderer, world)[BOX])


def test_a_missing_include_is_one_too(
    context: Context, files: Files, world: RenderWorld, said: Callable[[], list[str]]
) -> None:
    text = (files.folder / "brdf.glsl").read_text()
    (files.folder / "brdf.glsl").unlink()
    renderer = Renderer(context, quality=FULL)
    assert is_magenta(drawn(renderer, world)[BOX])
    assert ["brdf.glsl is missing" in sentence for sentence in said()] == [True]
    files.write("brdf.glsl", text)
    assert not is_magenta(drawn(renderer, world)[BOX])


def test_a_stand_in_is_seen_at_any_exposure(context: Context, files: Files, stage: Any) -> None:
    files.broken("shaded.frag")
    stage.settings = SceneSettings(picture=PictureSettings(camera_ev=15.0))
    stage.add(Transform(scale=(2.0, 2.0, 2.0)), MeshRenderer())
    world = stage.world()
    assert is_magenta(drawn(Renderer(context, quality=FULL), world)[BOX])


def test_numbers_are_refused_rather_than_made_up(
    context: Context, files: Files, world: RenderWorld, said: Callable[[], list[str]]
) -> None:
    wholes = {name: files.broken(name) for name in ("depth.frag", "shaded.frag")}
    renderer = Renderer(context, quality=FULL)
    drawn(renderer, world)
    count = len(said())
    for kind in ("entity", "depth", "normals", "albedo"):
        with pytest.raises(ShaderError, match="line "):
            renderer.draw_data(world, CAMERA, *SIZE, kind)  # type: ignore[arg-type]
    with pytest.raises(ShaderError, match=r"depth\.frag, line"):
        renderer.pick(world, CAMERA, *SIZE, 30, 20)
    with pytest.raises(ShaderError, match=r"line \d+: error"):
        Renderer(context, quality=EXACT).draw(world, CAMERA, *SIZE)
    assert is_magenta(drawn(renderer, world)[BOX])
    assert len(said()) == count == 2  # who is told by an error needs no log
    for name, whole in wholes.items():
        files.write(name, whole)
    assert (renderer.draw_data(world, CAMERA, *SIZE, "entity")[..., 0][BOX] == 1).all()
    assert renderer.pick(world, CAMERA, *SIZE, 30, 20)[0] == 1


def test_a_part_of_a_picture_is_magenta_too(context: Context, files: Files, world: RenderWorld) -> None:
    files.broken("frame.glsl")
    renderer = Renderer(context, quality=FULL)
    picture = renderer.draw(world, CAMERA, *SIZE, region=(10, 10, 20, 16))
    assert (picture.width, picture.height) == (20, 16)
    assert is_magenta(renderer.read_pixels(picture)[..., :3].astype(np.int64))


def test_what_is_written_to_files_is_never_magenta(context: Context, files: Files) -> None:
    files.broken("shaded.frag")
    mirror = SceneMirror()
    values = {name: values_of(value) for name, value in (("Transform", Transform()), ("MeshRenderer", MeshRenderer()))}
    box = Spawned(entity=1, name="Box", parent=0, enabled=True, components=values)
    mirror.apply_delta(SceneDelta(epoch=0, sequence=mirror.sequence + 1, tick=0, changes=(box,)))
    for size in (SIZE, (SIZE[0] * 2, SIZE[1] * 2)):
        renderer = OfflineRenderer(
            mirror, lambda _: b"", width=size[0], height=size[1], context=context, tile_edge=SIZE[0]
        )
        with pytest.raises(ShaderError, match=r"shaded\.frag"):
            renderer.picture()
        renderer.close()
