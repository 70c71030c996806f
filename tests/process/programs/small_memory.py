"""Draws things for which a process has no memory, which is taken from it for real; prints what came of it as JSON.

python small_memory.py images      an image that is decoded before and put on the card after the limit
python small_memory.py pictures    a picture, and a mesh
"""

from __future__ import annotations

import io
import json
import logging
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore
from elys.common.components import Material, MeshRenderer, Transform
from elys.common.errors import DisplayError
from elys.common.scene import SceneSettings
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Buffer, Context, Framebuffer, Texture, offscreen_context
from elys.render_node.quality import FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of

EDGE = 8192  # [pixels]; 256 MiB as RGBA
CAMERA = ViewCamera(position=(0.0, 0.0, 3.0), rotation=(0.0, 0.0, 0.0, 1.0))


class Said(logging.Handler):
    """Keeps what is logged."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


def allow_only(more: int) -> None:
    """Lets this process map so many bytes more, and no others."""
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + more, resource.RLIM_INFINITY))


def images(context: Context) -> dict[str, Any]:
    """A box with an image far too large, before and after there is room for it."""
    file = io.BytesIO()
    Image.new("RGB", (EDGE, EDGE), (0, 220, 0)).save(file, "PNG")
    store = AssetStore()
    image = store.put(file.getvalue(), kind="image")
    material = Material(base_color_texture=image, roughness=1.0)
    world = RenderWorld(DrawableAssets(store.get))
    settings = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))
    parts = [{"Transform": Transform(), "MeshRenderer": MeshRenderer(), "Material": material}]
    world.set_scene(tables_of([1], [0], parts, settings=settings))
    world.place()
    renderer = Renderer(context, quality=FULL)

    def seen() -> list[list[int]]:
        """The colours of the middle of a picture."""
        picture = renderer.read_pixels(renderer.draw(world, CAMERA, 64, 64))
        return np.unique(picture[24:40, 24:40, :3].reshape(-1, 3), axis=0).tolist()

    plain = seen()
    world.assets.settle()  # decoded: what is left to do is the card's
    allow_only(200 << 20)
    limited = [seen() for _ in range(3)]
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    world.assets.retry_failed()
    seen()
    world.assets.settle()
    return {"plain": plain, "limited": limited, "freed": seen()}


def pictures(context: Context) -> dict[str, Any]:
    """What is made of memory of the card, far too much of each; then a small picture."""
    renderer, world = Renderer(context, quality=FULL), RenderWorld()
    renderer.draw(world, CAMERA, 64, 64)
    allow_only(300 << 20)
    refused: dict[str, str] = {}
    for name, make in {
        "picture": lambda: renderer.draw(world, CAMERA, EDGE, EDGE),
        "framebuffer": lambda: Framebuffer(context, EDGE, EDGE, ("rgba32f",), depth=True),
        "texture": lambda: Texture(context, (EDGE, EDGE), "rgba32f"),
        "buffer": lambda: Buffer(context, size=900 << 20),
    }.items():
        try:
            make()
            refused[name] = ""
        except DisplayError as error:
            refused[name] = str(error)
    small = renderer.read_pixels(renderer.draw(world, CAMERA, 64, 64))
    return {"refused": refused, "small": list(small.shape), "objects": context.live_object_count}


if __name__ == "__main__":
    said = Said()
    logging.getLogger().addHandler(said)
    made = offscreen_context()
    result = {"images": images, "pictures": pictures}[sys.argv[1]](made)
    print(json.dumps({**result, "said": said.lines}))
