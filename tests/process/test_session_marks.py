"""`elys render --debug` of a session that runs: what is drawn over its picture is of the same instant, and of whom was asked."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pytest

from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context
from elys.render_node.marks import IMPULSE
from elys.render_node.offline import load_picture

pytestmark = [pytest.mark.process, pytest.mark.gl]
SIZE = 160
SPEED = 60.0  # [m/s]: a metre a tick, so that what is a tick late is a metre away
RADIUS = 0.5


@pytest.fixture(scope="module", autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


def flying_ball(path: Path) -> None:
    """A ball that flies off, a camera that flies along with it, and far below a floor with a block on it."""
    ball = {
        "Transform": {"position": [0, 0, 0]},
        "MeshRenderer": {"mesh": "sphere"},
        "Material": {"base_color": [0, 0, 0], "emissive": [1, 0, 0]},
        "RigidBody": {"linear_velocity": [SPEED, 0, 0], "gravity_scale": 0, "linear_damping": 0},
        "Collider": {"shape": "sphere", "radius": RADIUS},
    }
    eye = {"Transform": {"position": [0, 0, 6]}, "Camera": {"projection": "orthographic", "ortho_height": 4.0}}
    settings = {"background": [0, 0, 0], "ambient": [0, 0, 0], "gravity": [0, 0, 0]}
    entities = [{"name": "Ball", "components": ball, "children": [{"name": "Eye", "components": eye}]}]
    path.write_text(json.dumps({"elys_scene": 1, "settings": settings, "entities": entities}))


def spans(pixels: np.ndarray) -> np.ndarray:
    """First and last column and row of the pixels (H, W)."""
    rows, columns = np.nonzero(pixels)
    return np.array((columns.min(), columns.max(), rows.min(), rows.max()))


def is_ball(pixels: np.ndarray) -> np.ndarray:
    return (pixels[..., 0] > 90) & (pixels[..., 2] < 60)


def is_marked(pixels: np.ndarray) -> np.ndarray:
    return (pixels[..., 2] > 90) & (pixels[..., 1] > 60)


def test_boxes_lie_around_what_is_seen_of_a_session_in_flight(elys, free_port, tmp_path: Path) -> None:
    flying_ball(tmp_path / "ball.scene.json")
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "ball.scene.json", "--headless", "--realtime", "--listen", endpoint).wait_for("first tick")
    asked = ("--size", f"{SIZE}x{SIZE}", "--debug", "aabb")
    for name, more in (
        ("all.png", ()),
        ("of.png", ("--debug-of", "Ball")),
        ("film.mp4", ("--duration", "0.5", "--fps", "10")),
    ):
        drawing = elys("render", "--connect", endpoint, "-o", name, *asked, *more)
        assert drawing.wait() == 0, drawing.output
    plain = elys("render", "--connect", endpoint, "-o", "plain.png", "--size", f"{SIZE}x{SIZE}")
    assert plain.wait() == 0, plain.output
    with av.open(str(tmp_path / "film.mp4")) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(pictures) == 5
    pictures += [load_picture(tmp_path / name) for name in ("all.png", "of.png")]
    pixel = 4.0 / SIZE
    expected = SIZE / 2 + np.array((-RADIUS, RADIUS, -RADIUS, RADIUS)) / pixel
    assert not is_marked(load_picture(tmp_path / "plain.png")).any()
    for picture in pictures:
        np.testing.assert_allclose(spans(is_ball(picture)), expected, atol=2.0)
        np.testing.assert_allclose(spans(is_marked(picture)), expected, atol=2.5)


def test_a_session_that_has_not_begun_is_marked_as_its_scene_is_and_nobody_of_an_unknown_name(
    elys, free_port, tmp_path: Path
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "stack", "--headless", "--paused", "--listen", endpoint).wait_for("simulating")
    asked = ("--size", "240x160", "--debug")
    marked = (*asked, "obb,axes,labels", "--stamp")
    orders = {
        "session.png": ("--connect", endpoint, *marked),
        "scene.png": ("stack", *marked),
        "plain.png": ("stack", "--size", "240x160"),
        "physics.png": (
            "--connect",
            endpoint,
            *asked,
            "aabb,contacts,joints,islands,sleeping,trajectories,velocity,grid",
        ),
    }
    for name, words in orders.items():
        drawing = elys("render", *words, "-o", name)
        assert drawing.wait() == 0, drawing.output
    session, scene, plain, physics = (load_picture(tmp_path / name).astype(int) for name in orders)
    assert (np.abs(session - scene).max(axis=-1) > 8).mean() < 0.002
    assert (np.abs(session - plain).max(axis=-1) > 60).mean() > 0.02
    assert (np.abs(physics - plain).max(axis=-1) > 60).mean() > 0.01  # whatever physics can say before its first step
    vain = elys("render", "--connect", endpoint, "-o", "vain.png", "--debug", "aabb", "--debug-of", "Nobody")
    assert vain.wait() == 1
    assert vain.lines[-1] == "elys: there is no entity 'Nobody'"
    assert not (tmp_path / "vain.png").exists()


def test_what_physics_alone_knows_of_a_running_session_is_in_its_picture(elys, free_port, tmp_path: Path) -> None:
    """Contacts and forces of ten cubes, as of the scene itself, where no lines can be guessed."""
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "stack", "--headless", "--realtime", "--listen", endpoint).wait_for("first tick")
    for kind in ("contacts", "forces"):
        drawing = elys("render", "--connect", endpoint, "-o", f"{kind}.png", "--size", "480x360", "--debug", kind)
        assert drawing.wait() == 0, drawing.output
        picture = load_picture(tmp_path / f"{kind}.png").astype(int)
        assert (np.abs(picture - IMPULSE).max(axis=-1) < 60).sum() > 100, kind
