"""Small pictures of what is in no scene: what an asset looks like, for who chooses one."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import closing
from typing import Final

import numpy as np
import simplejpeg

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.messages.views import ThumbnailRequest
from elys.bus.mirror import SceneMirror
from elys.common.components import component_from, values_of
from elys.common.errors import AssetError, RequestError
from elys.common.ids import entity_of
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context
from elys.render_node.quality import interactive_quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneReader

MAX_SIZE: Final = 512  # [pixels] of an edge
MAX_RECORDS: Final = 20_000
SHADOW_SIZE: Final = 512  # [texels]
JPEG_QUALITY: Final = 90
PATIENCE: Final = 5.0  # [s] for meshes and images to be decoded, meanwhile no view is drawn


class ThumbnailPainter:
    """Draws with a renderer of its own: that of the views would give up the scene's meshes and images for those drawn here."""

    def __init__(self, context: Context) -> None:
        quality = interactive_quality(context)
        self._renderer = Renderer(
            context, quality=dataclasses.replace(quality, shadow_size=min(quality.shadow_size, SHADOW_SIZE))
        )

    def draw(self, request: ThumbnailRequest) -> bytes:
        """The picture as JPEG.

        Raises:
            RequestError: there are too many entities. ComponentError: one has what no component holds.
        """
        if len(request.records) > MAX_RECORDS:
            raise RequestError(f"a thumbnail shows at most {MAX_RECORDS} entities, not {len(request.records)}")
        size = min(max(request.size, 16), MAX_SIZE)
        assets = DrawableAssets(_fetch_from(request.contents))
        with closing(assets), closing(SceneReader(_mirror_of(request))) as reader:
            world = RenderWorld(assets)
            world.read_scene(reader)
            self._renderer.settle(world, timeout=PATIENCE)
            world.place()
            picture = self._renderer.draw(world, world.camera(1.0), size, size)
            rows = np.ascontiguousarray(picture.read()[::-1])
        return simplejpeg.encode_jpeg(rows, quality=JPEG_QUALITY, colorspace="RGBX", fastdct=True)


def _fetch_from(contents: dict[str, bytes]) -> Callable[[str], bytes]:
    def fetch(reference: str) -> bytes:
        if reference not in contents:
            raise AssetError(f"there is no asset {reference}: it was not sent along")
        return contents[reference]

    return fetch


def _mirror_of(request: ThumbnailRequest) -> SceneMirror:
    """A scene of the records alone: ids in their order."""
    ids = [entity_of(row + 1, 0) for row in range(len(request.records))]
    changes = []
    for entity, record in zip(ids, request.records, strict=True):
        if not -1 <= record.parent < len(ids) or any(not 0 <= row < len(ids) for row in record.references.values()):
            raise RequestError(f"'{record.name}' names an entity that is not among those sent")
        components = {name: values_of(component_from(name, values)) for name, values in record.components.items()}
        for key, row in record.references.items():
            component, _, field = key.partition(".")
            if component in components:
                components[component][field] = ids[row]
        parent = ids[record.parent] if record.parent >= 0 else 0
        changes.append(
            Spawned(entity=entity, name=record.name, parent=parent, enabled=record.enabled, components=components)
        )
    mirror = SceneMirror()
    mirror.epoch = 1
    mirror.apply_delta(SceneDelta(epoch=1, sequence=mirror.sequence + 1, tick=0, changes=tuple(changes)))
    mirror.settings = request.settings
    return mirror
