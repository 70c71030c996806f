"""Small pictures of what is in no scene, asked of a render node over the bus."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from elys.bus import topics
from elys.bus.messages.views import ThumbnailRequest
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError
from elys.common.scene import EntityRecord
from elys.editor_node.asset_folder import AssetFile, walk
from elys.editor_node.asset_pictures import thumbnail_request
from elys.editor_node.asset_reading import read_asset
from tests.unit.editor_node.asset_files import write_light, write_model
from tests.unit.render_node.test_view_service import Play, run

pytestmark = pytest.mark.gl


def request_for(path: Path) -> ThumbnailRequest:
    """What the editor asks for a file."""
    file: AssetFile = next(file for file in walk(path.parent).files if file.path == path)
    store = AssetStore()
    content, records = read_asset(file, store)
    assert content.error == ""
    return thumbnail_request(file, records, store)


async def drawn(scene: Play, request: ThumbnailRequest):
    reply = await scene.viewer.request(topics.THUMBNAIL, request, key=scene.node, timeout=20.0)
    return simplejpeg.decode_jpeg(reply.jpeg, colorspace="RGB").astype(int)


def test_a_model_is_seen_in_the_middle_of_its_thumbnail(context, tmp_path):
    write_model(tmp_path / "red.gltf", size=3.0, color=(0.9, 0.02, 0.02))
    write_model(tmp_path / "green.gltf", size=0.01, color=(0.02, 0.8, 0.02))

    async def act(scene: Play) -> None:
        await scene.picture()
        for name, channel in (("red", 0), ("green", 1)):
            pixels = await drawn(scene, request_for(tmp_path / f"{name}.gltf"))
            assert pixels.shape == (128, 128, 3)
            middle = pixels[56:72, 56:72].mean(axis=(0, 1))
            others = np.delete(middle, channel)
            assert middle[channel] > 90 and middle[channel] > 2 * others.max()
            corners = pixels[[0, 0, -1, -1], [0, -1, 0, -1]]
            assert np.ptp(corners) < 40 and corners.max() < 120  # nothing but the backdrop

    run(context, act)


def test_light_is_seen_in_a_mirror(context, tmp_path):
    write_light(tmp_path / "blue.hdr", (0.1, 0.1, 1.0))
    write_light(tmp_path / "red.hdr", (1.0, 0.1, 0.1))

    async def act(scene: Play) -> None:
        await scene.picture()
        blue = await drawn(scene, request_for(tmp_path / "blue.hdr"))
        red = await drawn(scene, request_for(tmp_path / "red.hdr"))
        for pixels, channel in ((blue, 2), (red, 0)):
            middle = pixels[50:78, 50:78].mean(axis=(0, 1))
            assert middle.argmax() == channel

    run(context, act)


def test_the_views_of_the_scene_stay_as_they_are(context, tmp_path):
    write_model(tmp_path / "green.gltf", color=(0.0, 1.0, 0.0))

    async def act(scene: Play) -> None:
        before = simplejpeg.decode_jpeg((await scene.picture()).jpeg)
        await drawn(scene, request_for(tmp_path / "green.gltf"))
        after = simplejpeg.decode_jpeg((await scene.picture()).jpeg)
        assert np.array_equal(before, after)
        assert before[15, 20].argmax() == 0  # the red box

    run(context, act)


def test_what_is_asked_wrongly_is_refused_in_a_sentence(context):
    async def act(scene: Play) -> None:
        await scene.picture()
        for records, words in (
            ((EntityRecord(name="Box", parent=5),), "not among those sent"),
            ((EntityRecord(name="Box", components={"Nonsense": {}}),), "Nonsense"),
            ((EntityRecord(name="Box", components={"Transform": {"position": [1]}}),), "position"),
            ((EntityRecord(name="Box"),) * 20_001, "at most 20000"),
        ):
            with pytest.raises(RequestError, match=words):
                await drawn(scene, ThumbnailRequest(records=records))
        # No content, no camera, an impossible size: a picture all the same.
        nothing = EntityRecord(name="Box", components={"MeshRenderer": {"mesh": "blake2b:" + "0" * 32}})
        assert (await drawn(scene, ThumbnailRequest(records=(nothing,), size=-5))).shape == (16, 16, 3)

    run(context, act)
