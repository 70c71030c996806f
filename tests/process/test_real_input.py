"""The real input: FlightHelmet falls onto a yard of 200 boxes and spheres, edited live, recorded, replayed, rendered."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from PIL import Image

from elys.bus.messages.commands import Despawn, SetComponent
from elys.bus.recording import Recording
from elys.common.assets.store import is_reference
from elys.common.scene import write_scene
from elys.samples.yard import yard_with_model
from tests.process.clients import client

pytestmark = pytest.mark.process


def test_flight_helmet_falls_onto_the_yard(elys, free_port, tmp_path, shared_assets):
    scene, recording, picture = (tmp_path / name for name in ("helmet.scene.json", "helmet.mcap", "helmet.png"))
    write_scene(yard_with_model(shared_assets / "FlightHelmet" / "FlightHelmet.gltf"), scene)
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", scene, "--headless", "--record", recording, "--listen", endpoint)
    run.wait_for("first tick", seconds=120)
    helmet, removed = asyncio.run(edit_live(endpoint))
    run.process.terminate()
    assert run.wait() == 0

    with Recording(recording) as recorded:
        # Whole in itself: every asset that the scene names is in the file.
        first, last = recorded.mirror_at(0), recorded.mirror_at(len(recorded) - 1)
        named = {
            value
            for entity in first.entities.values()
            for component in entity.components.values()
            for value in (getattr(component, name) for name in component.__struct_fields__)
            if isinstance(value, str) and is_reference(value)
        }
        assert len(named) > 15  # six meshes and their textures
        assert named <= set(recorded.asset_references())
        assert removed in first.entities
        assert removed not in last.entities
        # The helmet fell, was lifted by the edit, and fell again; it ends within the walls, on what lies there.
        heights = body_heights(recorded, helmet)
        lowest_before = heights[: int(heights.argmax())].min()
        assert heights.max() > 11.0 > lowest_before
        assert 0.0 < heights[-1] < 11.0

    run = elys("render", recording, "-o", picture, "--size", "320x180", "--time", "1")
    assert run.wait(seconds=120) == 0, run.output
    pixels = np.asarray(Image.open(picture).convert("RGB"), int)
    assert pixels.shape == (180, 320, 3)
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 2000  # a yard full of things, not an empty sky

    replay = elys("play", recording, "--listen", endpoint)
    replay.wait_for("playing")
    asyncio.run(watch_replay(endpoint, helmet))


async def edit_live(endpoint: str) -> tuple[int, int]:
    async with client(endpoint) as editor:
        helmet = editor.entity("Model")
        await editor.until(lambda: bool(editor.frames) and editor.frames[-1].tick > 60)
        place = {"position": [0.0, 12.0, 0.0]}
        reply = await editor.ask(SetComponent(entity=helmet, component="Transform", values=place))
        assert reply.accepted, reply.reason
        removed = editor.entity("Box 1")
        assert (await editor.ask(Despawn(entity=removed))).accepted
        await editor.until(lambda: removed not in editor.mirror.entities)
        tick = editor.frames[-1].tick
        await editor.until(lambda: editor.frames[-1].tick > tick + 120)
        assert removed not in editor.frames[-1].entity.tolist()
    return helmet, removed


def body_heights(recorded: Recording, entity: int) -> np.ndarray:
    heights = []
    for position in range(len(recorded)):
        frame = recorded.frame(position)
        heights.append(float(frame.position[frame.entity.tolist().index(entity), 1]))
    return np.array(heights)


async def watch_replay(endpoint: str, helmet: int) -> None:
    async with client(endpoint) as viewer:
        assert helmet in viewer.mirror.entities
        await viewer.until(lambda: len(viewer.frames) > 30)
        assert (np.diff([frame.tick for frame in viewer.frames]) >= 0).all()
