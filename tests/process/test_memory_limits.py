"""Processes from which memory is taken for real, on software OpenGL the graphics card's too: one sentence, and they live on."""

from __future__ import annotations

import asyncio
import io
import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
from PIL import Image

from elys.bus import topics
from elys.bus.messages.views import ViewCamera, ViewFrame, ViewRequest
from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context
from tests.process.clients import client
from tests.process.conftest import wait_until

pytestmark = [pytest.mark.process, pytest.mark.gl]
PROGRAM = Path(__file__).parent / "programs" / "small_memory.py"


@pytest.fixture(scope="module", autouse=True)
def _software() -> None:
    try:
        context = offscreen_context()
    except DisplayError as error:
        pytest.skip(str(error))
    is_software = context.is_software
    context.release()
    if not is_software:
        pytest.skip("a limit of the process is one of the card on software OpenGL only")


def what_came_of(stage: str) -> dict[str, Any]:
    ran = subprocess.run(
        [sys.executable, str(PROGRAM), stage], capture_output=True, text=True, timeout=120, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    return json.loads(ran.stdout.splitlines()[-1])


def test_an_image_for_which_the_card_has_no_room_is_a_checker_and_one_sentence() -> None:
    told = what_came_of("images")
    assert all(max(color) - min(color) < 8 for color in told["plain"])  # grey: not there yet
    for colors in told["limited"]:
        assert len(colors) > 1 and all(
            green < 20 and red > green for red, green, _ in colors
        )  # the checker, black and magenta
    assert all(green > 150 > red + blue for red, green, blue in told["freed"])
    (sentence,) = told["said"]
    assert "making a texture of 8192 x 8192 pixels failed: the graphics card has no memory left" in sentence


def test_what_is_too_large_is_refused_and_small_pictures_go_on() -> None:
    told = what_came_of("pictures")
    for name, sentence in told["refused"].items():
        assert "failed: the graphics card has no memory left" in sentence, name
        assert sentence.count("\n") == 0
    assert told["small"] == [64, 64, 4]


def test_a_render_node_without_memory_for_an_image_shows_a_checker_and_goes_on(elys, free_port, tmp_path: Path) -> None:
    file = io.BytesIO()
    Image.new("RGB", (8192, 8192), (0, 220, 0)).save(file, "PNG")
    (tmp_path / "huge.png").write_bytes(file.getvalue())
    box = {"Transform": {}, "MeshRenderer": {}, "Material": {"base_color_texture": "huge.png", "roughness": 1}}
    settings = {"background": [0, 0, 0], "ambient": [1, 1, 1]}
    document = {"elys_scene": 1, "settings": settings, "entities": [{"name": "Box", "components": box}]}
    (tmp_path / "huge.scene.json").write_text(json.dumps(document))
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "huge.scene.json", "--headless", "--paused", "--listen", endpoint).wait_for("simulating")
    node = elys("node", "render", "--connect", endpoint)
    node.wait_for("drawing views on")
    mapped = int(Path(f"/proc/{node.process.pid}/statm").read_text().split()[0]) * os.sysconf("SC_PAGESIZE")
    resource.prlimit(node.process.pid, resource.RLIMIT_AS, (mapped + (200 << 20),) * 2)

    async def look() -> None:
        async with client(endpoint) as viewer:
            frames: list[ViewFrame] = []
            viewer.session.subscribe(topics.VIEW_FRAME, lambda frame, _: frames.append(frame))
            await viewer.until(lambda: bool(viewer.session.nodes_of("render")))
            renderer = viewer.session.nodes_of("render")[0].id
            camera = ViewCamera(position=(0.0, 0.0, 3.0), rotation=(0.0, 0.0, 0.0, 1.0))
            sequence = 0

            async def colors() -> np.ndarray:
                nonlocal sequence
                sequence += 1
                asked = ViewRequest(view="eye", sequence=sequence, camera=camera, width=64, height=64, grid=False)
                viewer.session.publish(topics.VIEW_REQUEST, asked, key=renderer)
                await viewer.until(lambda: bool(frames) and frames[-1].sequence == sequence)
                pixels = simplejpeg.decode_jpeg(frames[-1].jpeg, colorspace="RGB").astype(int)
                return pixels[24:40, 24:40].reshape(-1, 3)

            async with asyncio.timeout(60):
                while True:
                    seen = await colors()
                    if (seen[:, 1] < 40).all() and seen[:, 0].max() > 100:  # the checker
                        break
            for _ in range(3):
                assert (await colors())[:, 1].max() < 40

    asyncio.run(look())
    assert "Traceback" not in node.output
    sentences = [line for line in node.lines if "drawn without" in line]
    assert len(sentences) == 1
    assert "memory" in sentences[0]
    node.process.terminate()
    assert node.wait() in (0, -15), node.output
    wait_until(lambda: node.process.poll() is not None)
