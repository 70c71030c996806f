"""`elys render` without a scene: what another process simulates right now, or does not."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import av
import numpy as np
import pytest
from mcap.reader import make_reader

from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context

pytestmark = [pytest.mark.process, pytest.mark.gl]
SIZE = ("--size", "96x64")


@pytest.fixture(scope="module", autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


def test_a_session_is_drawn_paused_and_filmed_playing(elys, free_port, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    paused = elys("run", "stack", "--headless", "--paused", "--listen", endpoint)
    paused.wait_for("simulating")
    drawing = elys("render", "--connect", endpoint, "-o", str(tmp_path / "ids.npy"), "--view", "entity", *SIZE)
    assert drawing.wait() == 0, drawing.output
    alone = elys("render", "stack", "-o", str(tmp_path / "same.npy"), "--view", "entity", *SIZE)
    assert alone.wait() == 0, alone.output
    ids, same = np.load(tmp_path / "ids.npy"), np.load(tmp_path / "same.npy")
    assert len(np.unique(ids)) > 3
    assert (ids != same).mean() < 0.01  # a session that has not begun is the scene
    paused.end()

    elys("run", "stack", "--headless", "--realtime", "--listen", endpoint).wait_for("simulating")
    film = tmp_path / "film.mp4"
    filming = elys("render", "--connect", endpoint, "-o", str(film), "--duration", "0.5", "--fps", "20", *SIZE)
    assert filming.wait() == 0, filming.output
    assert "10 pictures of 96x64" in filming.output
    with av.open(str(film)) as opened:
        assert sum(1 for _ in opened.decode(video=0)) == 10


def test_a_session_is_recorded_with_pictures_of_a_render_node_of_its_own(elys, free_port, tmp_path: Path) -> None:
    endpoint, path = f"tcp/127.0.0.1:{free_port}", tmp_path / "seen.mcap"
    elys("run", "stack", "--headless", "--realtime", "--listen", endpoint).wait_for("simulating")
    words = (
        "record",
        "--connect",
        endpoint,
        "-o",
        str(path),
        "--view",
        "Camera",
        "--view-size",
        "96x64",
        "--seconds",
        "8",
    )
    recording = elys(*words)
    assert recording.wait() == 0, recording.output
    assert "drawing views" in recording.output
    with path.open("rb") as file:
        found = [message for _, _, message in make_reader(file).iter_messages(topics=["video/Camera"])]
    decoder = av.CodecContext.create("h264", "r")
    for message in found:
        (frame,) = decoder.decode(av.Packet(base64.b64decode(json.loads(message.data)["data"])))
        assert (frame.width, frame.height) == (96, 64)
    assert len(found) >= 2
    vain = elys("record", "--connect", endpoint, "-o", str(tmp_path / "vain.mcap"), "--view", "Nope")
    assert vain.wait() == 1
    assert "there is no camera 'Nope'" in vain.lines[-1]
    assert not (tmp_path / "vain.mcap").exists()


def test_what_is_asked_of_a_session_in_vain_is_one_line(elys, free_port, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "stack", "--headless", "--paused", "--listen", endpoint).wait_for("simulating")
    for name, said in (("a.png", "there is no camera 'Nope'"), ("a.mp4", "there is no camera 'Nope'")):
        drawing = elys("render", "--connect", endpoint, "-o", str(tmp_path / name), "--camera", "Nope", *SIZE)
        assert drawing.wait() == 1
        assert said in drawing.lines[-1]
        assert not (tmp_path / name).exists()
