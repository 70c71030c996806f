"""Pictures and films into files."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path

import av
import msgspec
import numpy as np
import pytest

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.mirror import SceneMirror
from elys.common.components import Light, Material, MeshRenderer, Transform, values_of
from elys.common.errors import ElysError
from elys.common.math.matrix import look_rotation
from elys.render_node.offline import OfflineRenderer, VideoWriter, load_picture, output_kind, save_picture

BALL = 1


@pytest.fixture
def mirror() -> SceneMirror:
    """A glowing ball and a sun."""
    made = SceneMirror()
    ball = (Transform(), MeshRenderer(mesh="sphere"), Material(base_color=(0.0, 0.0, 0.0), emissive=(0.8, 0.0, 0.0)))
    floor = (Transform(position=(0.0, -1.0, 0.0), scale=(2.0, 0.1, 2.0)), MeshRenderer())
    sun = (Transform(rotation=tuple(look_rotation((-1, -2, -1)).tolist())), Light())
    changes = tuple(
        Spawned(
            entity=entity,
            name=str(entity),
            parent=0,
            enabled=True,
            components={type(value).__name__: values_of(value) for value in components},
        )
        for entity, components in ((BALL, ball), (2, floor), (3, sun))
    )
    made.apply_delta(SceneDelta(epoch=0, sequence=0, tick=0, changes=changes))
    return made


@pytest.mark.gl
def test_a_picture_is_written_and_read_back(context, mirror, tmp_path: Path) -> None:
    with OfflineRenderer(mirror, width=64, height=48, context=context) as renderer:
        renderer.write_picture(tmp_path / "one.png")
        expected = renderer.picture()
    written = load_picture(tmp_path / "one.png")
    assert written.shape == (48, 64, 3)
    np.testing.assert_array_equal(written, expected[..., :3])
    assert written[20:28, 28:36, 0].mean() > written[20:28, 28:36, 2].mean() + 60


@pytest.mark.gl
def test_a_film_has_a_picture_for_every_moment(context, mirror, make_frame, tmp_path: Path) -> None:
    frames = [
        make_frame({BALL: (0.0, 0.01 * tick, 0.0)}, tick=tick, simulation_time=tick / 60, published_at=tick)
        for tick in range(31)
    ]
    seen: list[tuple[int, int]] = []
    with OfflineRenderer(mirror, width=65, height=48, context=context) as renderer:
        count = renderer.write_video(
            tmp_path / "film.mp4", frames, fps=20.0, progress=lambda drawn, total: seen.append((drawn, total))
        )
        again = renderer.write_video(tmp_path / "again.mp4", frames, fps=20.0, duration=0.25)
    assert count == 11  # at 0, 0.05, ... 0.5 s
    assert again == 5
    assert seen[-1] == (11, 0)
    with av.open(str(tmp_path / "film.mp4")) as film:
        stream = film.streams.video[0]
        assert (stream.width, stream.height, float(stream.average_rate)) == (64, 48, 20.0)
        assert stream.codec_context.pix_fmt == "yuv420p"
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert len(pictures) == 11
    glow = [np.argwhere(picture[..., 0].astype(int) - picture[..., 2] > 80)[:, 0].mean() for picture in pictures]
    assert all(after < before + 0.5 for before, after in itertools.pairwise(glow))  # rises
    assert glow[0] - glow[-1] > 2


@pytest.mark.gl
def test_the_same_frames_give_the_same_film(context, mirror, make_frame, tmp_path: Path) -> None:
    def frames():
        return [
            make_frame({BALL: (0.03 * tick, 0.0, 0.0)}, tick=tick, simulation_time=tick / 60, published_at=tick)
            for tick in range(10)
        ]

    for name in ("a.mp4", "b.mp4"):
        with OfflineRenderer(mirror, width=64, height=48, context=context) as renderer:
            renderer.write_video(tmp_path / name, frames(), fps=24.0)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


@pytest.mark.gl
def test_it_makes_and_frees_a_context_of_its_own(tmp_path: Path) -> None:
    """In a process of its own: a context stays current on its thread."""
    script = (
        "from elys.bus.mirror import SceneMirror; from elys.render_node.offline import OfflineRenderer\n"
        "from pathlib import Path\n"
        f"with OfflineRenderer(SceneMirror(), width=16, height=16) as r: r.write_picture(Path({str(tmp_path)!r}, 'a.png'))"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)
    assert load_picture(tmp_path / "a.png").shape == (16, 16, 3)


def test_what_cannot_be_written_is_said_before_anything_is_drawn(tmp_path: Path) -> None:
    for path, said in (
        (tmp_path / "a.gif", "suffix .gif"),
        (tmp_path / "plain", r"suffix \(none\)"),
        (tmp_path / "no" / "a.png", "there is no directory"),
        (Path("/proc/a.png"), "cannot be written"),
    ):
        with pytest.raises(ElysError, match=said):
            output_kind(path)
            save_picture(path, np.zeros((2, 2, 4), np.uint8))
    (tmp_path / "folder.mp4").mkdir()
    with pytest.raises(ElysError, match="is a directory"):
        VideoWriter(tmp_path / "folder.mp4", 16, 16)
    with pytest.raises(ElysError, match="no video"):
        VideoWriter(tmp_path / "a.png", 16, 16)
    with pytest.raises(ElysError, match="pictures a second"):
        VideoWriter(tmp_path / "a.mp4", 16, 16, fps=0.0)
    with pytest.raises(ElysError, match="cannot be drawn"):
        OfflineRenderer(SceneMirror(), width=0, height=5)


@pytest.mark.gl
def test_linear_light_is_written_as_it_is(context, mirror, tmp_path: Path) -> None:
    with OfflineRenderer(mirror, width=65, height=49, environment=False, context=context) as renderer:
        renderer.write_picture(tmp_path / "light.npy")
        shown = renderer.picture()
    light = np.load(tmp_path / "light.npy")
    assert light.shape == (49, 65, 3)
    assert light.dtype == np.float32
    # What it glows with, and not what a screen makes of it; the sun's mirror image is white.
    assert light[24, 32, 0] - light[24, 32, 2] == pytest.approx(0.8, abs=1e-6)
    np.testing.assert_array_equal(light[0, 0], 0.0)  # no sky
    assert shown[24, 32, 0] < 255


@pytest.mark.gl
def test_light_from_around_is_sampled_where_the_order_or_the_scene_asks_for_it(context, mirror) -> None:
    def light(shown: SceneMirror, **asked: bool) -> np.ndarray:
        with OfflineRenderer(shown, width=65, height=49, context=context, **asked) as renderer:
            return renderer.values()

    split, ordered = light(mirror), light(mirror, sampled=True)
    picture = msgspec.structs.replace(mirror.settings.picture, sampled_surroundings=True)
    asking = SceneMirror()
    settings = msgspec.structs.replace(mirror.settings, picture=picture)
    asking.apply_snapshot(msgspec.structs.replace(mirror.to_snapshot(), settings=settings))
    np.testing.assert_array_equal(light(asking), ordered)
    assert np.abs(ordered - split).max() > 1e-4


@pytest.mark.gl
def test_light_that_cannot_be_written_is_said(context, mirror, tmp_path: Path) -> None:
    with (
        OfflineRenderer(mirror, width=8, height=8, context=context) as renderer,
        pytest.raises(ElysError, match="light"),
    ):
        renderer.write_picture(tmp_path / "absent" / "light.npy")
