"""The OpenGL wrappers: what they make is released, and what goes wrong is said clearly."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import msgspec
import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components import Environment, Light, Material, MeshRenderer, Transform
from elys.common.errors import ContextLost, DisplayError, ElysError
from elys.common.scene import PictureSettings
from elys.render_node.gpu import (
    Buffer,
    Context,
    Framebuffer,
    Program,
    ProgramCache,
    Texture,
    VertexArray,
    offscreen_context,
)
from elys.render_node.gpu.program import expand
from elys.render_node.quality import FULL
from elys.render_node.renderer import Renderer


@pytest.mark.gl
def test_everything_is_released_with_its_owner(context: Context) -> None:
    gc.collect()
    before = context.live_object_count
    kept: list[Any] = [
        Buffer(context, np.arange(4, dtype=np.float32)),
        Texture(context, (8, 8), "rgba8", mipmaps=True),
        Framebuffer(context, 16, 16, ("rgba16f", "r32ui"), depth=True),
        Framebuffer(context, 16, 16, ("rgba16f",), depth=True, samples=4),
        Program(context, "screen.vert", "sky.frag"),
    ]
    assert context.live_object_count > before
    kept.clear()
    gc.collect()
    assert context.live_object_count == before


@pytest.mark.gl
def test_released_twice_is_released_once(context: Context) -> None:
    gc.collect()
    before = context.live_object_count
    framebuffer = Framebuffer(context, 4, 4, ("rgba8",), depth=True)
    framebuffer.release()
    framebuffer.release()
    del framebuffer
    gc.collect()
    assert context.live_object_count == before


@pytest.mark.gl
def test_a_framebuffer_holds_any_mix_of_attachments(context: Context) -> None:
    framebuffer = Framebuffer(context, 5, 3, ("rgba8", "r32ui", "rgba32f"), depth=True)
    framebuffer.clear()
    assert framebuffer.read(0).shape == (3, 5, 4)
    assert framebuffer.read(1).dtype == np.uint32
    assert not framebuffer.read(1).any()
    assert framebuffer.read(2).dtype == np.float32


@pytest.mark.gl
def test_a_multisampled_framebuffer_resolves(context: Context) -> None:
    many = Framebuffer(context, 4, 4, ("rgba16f",), depth=True, samples=4)
    one = Framebuffer(context, 4, 4, ("rgba16f",))
    many.use()
    many.clear((0.25, 0.5, 2.0, 1.0))
    many.resolve_into(one)
    np.testing.assert_allclose(one.read()[0, 0], (0.25, 0.5, 2.0, 1.0))


@pytest.mark.gl
def test_pixels_go_straight_into_memory(context: Context) -> None:
    framebuffer = Framebuffer(context, 6, 2, ("rgba8",))
    framebuffer.clear((1.0, 0.0, 0.0, 1.0))
    memory = bytearray(6 * 2 * 4)
    framebuffer.read_into(memoryview(memory))
    assert bytes(memory[:4]) == b"\xff\x00\x00\xff"


@pytest.mark.gl
def test_a_buffer_grows(context: Context) -> None:
    buffer = Buffer(context, size=16)
    data = np.arange(1000, dtype=np.float32)
    buffer.write(data)
    assert buffer.size >= data.nbytes
    assert np.frombuffer(buffer.raw.read(data.nbytes), np.float32).tolist() == data.tolist()


@pytest.mark.gl
def test_a_refused_shader_names_file_line_and_source(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    import elys.render_node.gpu.program as module

    def broken(name: str, defines: Any = ()) -> Any:
        source, places = expand(name, defines)
        return source.replace("vec3 direction = -direction_to_eye(", "vec3 direction = -direction_to_eyes("), places

    monkeypatch.setattr(module, "expand", broken)
    with pytest.raises(DisplayError) as caught:
        Program(context, "screen.vert", "sky.frag")
    assert "sky.frag, line" in str(caught.value)
    assert "direction_to_eyes(" in str(caught.value)


def test_includes_are_expanded_with_their_places() -> None:
    source, places = expand("sky.frag", ("FIRST", "SECOND 2"))
    lines = source.splitlines()
    assert lines[:3] == ["#version 330 core", "#define FIRST", "#define SECOND 2"]
    assert len(lines) == len(places)
    row = next(i for i, line in enumerate(lines) if "layout(std140) uniform Frame" in line)
    assert places[row][0] == "frame.glsl"


def test_a_missing_shader_is_one_sentence() -> None:
    with pytest.raises(DisplayError, match=r"no_such\.frag is missing"):
        expand("no_such.frag")


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("libEGL.so.1 not loaded", "apt install libegl1"),
        ("found 0 devices", "no vendor"),
        ("eglInitialize failed (0x3001)", "no driver"),
        ("requested OpenGL 3.3, got OpenGL 2.1", "no OpenGL 3.3"),
        ("something new", "elys doctor"),
    ],
)
def test_what_egl_says_is_translated(monkeypatch: pytest.MonkeyPatch, said: str, remedy: str) -> None:
    def refuse(**_: Any) -> Any:
        raise Exception(said)

    monkeypatch.setattr(moderngl, "create_context", refuse)
    with pytest.raises(DisplayError) as caught:
        offscreen_context()
    assert remedy in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.gl
def test_a_renderer_leaves_nothing_behind(context: Context) -> None:
    """After pictures of many sizes, scenes and marks."""
    from elys.bus.messages.views import ViewCamera
    from elys.common.components import Light, Material, MeshRenderer, Transform
    from elys.render_node.render_world import RenderWorld
    from elys.render_node.renderer import KEPT_SIZES, Renderer
    from elys.render_node.scene_tables import tables_of

    gc.collect()
    before = context.live_object_count
    renderer, world = Renderer(context), RenderWorld()
    camera = ViewCamera(position=(0.0, 0.0, 6.0), rotation=(0.0, 0.0, 0.0, 1.0))
    counts = []
    sizes = np.random.default_rng(1).integers(1, 200, (30, 2)).tolist()
    for turn, (width, height) in enumerate(sizes):
        mesh = ("box", "sphere", "cone")[turn % 3]
        glass = Material(alpha_mode="blend", opacity=0.5)
        components = [{"MeshRenderer": MeshRenderer(mesh=mesh)}, {"Light": Light(), "Transform": Transform()}]
        components.append({"MeshRenderer": MeshRenderer(mesh=mesh), "Material": glass})
        world.set_scene(tables_of([1, 2, 3], [0, 0, 0], components))
        renderer.draw(world, camera, width, height, selection=(1,), grid=True)
        renderer.pick(world, camera, width, height, width // 2, height // 2)
        gc.collect()
        counts.append(context.live_object_count)
    settled = counts[2 * KEPT_SIZES :]
    assert max(settled) - min(settled) < 12  # shadow, mask and one mesh come and go; nothing piles up
    del renderer, world
    gc.collect()
    assert context.live_object_count == before


@pytest.mark.gl
def test_what_is_larger_than_the_driver_takes_is_said(context: Context) -> None:
    for make in (lambda edge: Texture(context, (edge, 4), "rgba8"), lambda edge: Framebuffer(context, 4, edge)):
        with pytest.raises(DisplayError, match=f"takes edges from 1 to {context.max_size}"):
            make(context.max_size + 1)
    with pytest.raises(DisplayError, match="0 x 4"):
        Texture(context, (0, 4), "rgba8")


@pytest.mark.parametrize(
    ("error", "kind", "said"),
    [
        ("GL_OUT_OF_MEMORY", DisplayError, "no memory left"),
        ("GL_UNKNOWN_ERROR", ContextLost, "lost the context"),
    ],
)
def test_a_driver_that_gives_up_is_explained(error: str, kind: type[ElysError], said: str) -> None:
    class Driver:
        """As moderngl's context tells it."""

        info = {"GL_MAX_TEXTURE_SIZE": 64, "GL_RENDERER": "a card"}

        def __init__(self) -> None:
            self.error = "GL_NO_ERROR"

    driver = Driver()
    made = Context(driver)
    made.check("drawing")
    driver.error = error
    with pytest.raises(kind, match=f"drawing failed: .*{said}"):
        made.check("drawing")


@pytest.mark.gl
def test_changed_shaders_are_compiled_anew_and_broken_ones_are_not_taken(
    context: Context, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("whole.vert", "half.glsl", "whole.frag"):
        (tmp_path / name).touch()
    (tmp_path / "whole.vert").write_text(
        "#version 330 core\n"
        "void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0, 1); }\n"
    )
    (tmp_path / "half.glsl").write_text("float level() { return 0.25; }\n")
    (tmp_path / "whole.frag").write_text(
        '#version 330 core\n#include "half.glsl"\nout vec4 color;\nvoid main() { color = vec4(level()); }\n'
    )
    monkeypatch.setattr("elys.render_node.gpu.program.resources", SimpleNamespace(files=lambda _: tmp_path))
    monkeypatch.setattr("elys.render_node.gpu.program_cache.resources", SimpleNamespace(files=lambda _: tmp_path))
    cache, target = ProgramCache(context, reload=True), Framebuffer(context, 2, 2, ("rgba32f",))

    def level() -> float:
        target.use()
        context.set_state()
        VertexArray(context, cache.program("whole.vert", "whole.frag"), {}, None, 3).draw()
        return float(target.read()[0, 0, 0])

    assert level() == 0.25
    assert cache.reload_changed() == []
    _write_later(tmp_path / "half.glsl", "float level() { return 0.75; }\n")
    assert cache.reload_changed() == ["half.glsl"]
    assert level() == 0.75
    _write_later(tmp_path / "half.glsl", "float level() { return nothing; }\n")
    assert cache.reload_changed() == ["half.glsl"]
    assert level() == 0.75
    assert "half.glsl, line 1" in caplog.text and "return nothing" in caplog.text
    _write_later(tmp_path / "half.glsl", "float level() { return 0.5; }\n")
    cache.reload_changed()
    assert level() == 0.5


def _write_later(path: Path, text: str) -> None:
    """Writes a file with a later time than it had, without waiting for the clock."""
    later = path.stat().st_mtime_ns + 1_000_000_000
    path.write_text(text)
    os.utime(path, ns=(later, later))


@pytest.mark.gl
def test_a_renderer_with_all_effects_leaves_nothing_behind(context: Context, stage: Any) -> None:
    stage.add(Transform(), MeshRenderer(), Material())
    stage.add(Transform(rotation=(-0.5, 0.0, 0.0, 0.866)), Light())
    stage.add(Transform(), Environment(kind="sky"))
    picture = PictureSettings(bloom=0.1, ambient_occlusion=1.0, fxaa=True, fog_density=0.1, multiple_scattering=True)
    stage.settings = msgspec.structs.replace(stage.settings, picture=picture)
    camera = ViewCamera(position=(0.0, 1.0, 4.0), rotation=(0.0, 0.0, 0.0, 1.0))
    gc.collect()
    before = context.live_object_count
    renderer, world = Renderer(context, quality=FULL), stage.world()
    for size in (32, 48, 32):
        renderer.draw(world, camera, size, size, selection=(1,), grid=True)
    renderer.pick(world, camera, 32, 32, 16, 16)
    assert context.live_object_count > before
    del renderer
    gc.collect()
    assert context.live_object_count == before
