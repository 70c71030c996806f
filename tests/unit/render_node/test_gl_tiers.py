"""The OpenGL of macOS, 4.1 without what came later, draws the same pictures: in a process whose driver offers no more."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

DRAWER = """
import sys
import msgspec, numpy as np
from elys.bus.messages.views import ViewCamera
from elys.common.components import Environment, Light, Material, MeshRenderer, Transform
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.gpu import offscreen_context
from elys.render_node.quality import FAST, FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of

context = offscreen_context()
things = [
    (Transform(), MeshRenderer(), Material(base_color=(0.8, 0.3, 0.1))),
    (Transform(position=(0.0, -1.0, 0.0), scale=(6.0, 0.2, 6.0)), MeshRenderer(), Material()),
    (Transform(position=(1.0, 0.0, 0.6)), MeshRenderer(mesh="sphere"), Material(metallic=1.0, roughness=0.3)),
    (Transform(position=(-1.0, 0.0, 1.0)), MeshRenderer(), Material(opacity=0.5, alpha_mode="blend")),
    (Transform(rotation=(-0.5, 0.2, 0.0, 0.84)), Light()),
    (Transform(), Environment(kind="sky")),
]
picture = PictureSettings(
    bloom=0.1, ambient_occlusion=1.0, fxaa=True, fog_density=0.02, multiple_scattering=True, specular_antialiasing=True,
    tone_mapping="agx",
)
world = RenderWorld()
components = [{type(value).__name__: value for value in found} for found in things]
count = len(things)
world.set_scene(tables_of(range(1, count + 1), [0] * count, components, settings=SceneSettings(picture=picture)))
camera = ViewCamera(position=(0.0, 1.0, 5.0), rotation=(-0.1, 0.0, 0.0, 0.995))
pictures = []
for quality in (FULL, FAST):
    renderer = Renderer(context, quality=quality)
    pictures.append(renderer.read_pixels(renderer.draw(world, camera, 96, 64, selection=(1,), grid=True)))
assert renderer.pick(world, camera, 96, 64, 48, 32)[0] > 0
np.save(sys.argv[1], np.stack(pictures))
print(context.version_code)
"""
LATER = (
    "shader_storage_buffer_object compute_shader buffer_storage multi_draw_indirect base_instance shader_image_load_store "
    "shading_language_420pack"
)


def drawn(path: Path, **variables: str) -> tuple[np.ndarray, int]:
    """Pictures of a process with these variables, and the version of OpenGL that it had."""
    done = subprocess.run(
        [sys.executable, "-c", DRAWER, str(path)],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    if "nothing can be drawn offscreen" in done.stderr:
        pytest.skip("no OpenGL here")
    assert done.returncode == 0, done.stderr
    return np.load(path), int(done.stdout)


@pytest.mark.gl
@pytest.mark.process
def test_the_tier_of_macos_draws_the_same(context, tmp_path: Path) -> None:
    if "llvmpipe" not in context.info["GL_RENDERER"]:
        pytest.skip("only Mesa can be told to offer less")
    plain, _ = drawn(tmp_path / "plain.npy")
    less, version = drawn(
        tmp_path / "less.npy",
        MESA_GL_VERSION_OVERRIDE="4.1FC",
        MESA_GLSL_VERSION_OVERRIDE="410",
        MESA_EXTENSION_OVERRIDE=" ".join(f"-GL_ARB_{name}" for name in LATER.split()),
    )
    assert version == 410
    np.testing.assert_array_equal(less, plain)
    assert plain[..., :3].std() > 10
