"""Cameras along keyframes, beside scipy's splines, and around a scene."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from elys.common.errors import ElysError
from elys.common.math import quaternion
from elys.render_node.camera import View
from elys.render_node.camera_path import FIELD_OF_VIEW, CircularPath, read_camera_path

KEYS = [
    {"time": 0.5, "eye": [0, 2, 8], "target": [0, 0, 0]},
    {"time": 1.0, "eye": [4, 3, 6], "target": [0, 0.5, 0], "field_of_view": 0.6},
    {"time": 3.0, "eye": [7, 1, -2], "target": [1, 0, 0]},
    {"time": 3.5, "eye": [0, 1, -9], "target": [0, 0, 1], "field_of_view": 1.2},
]


def written(folder: Path, keyframes: object) -> Path:
    """A file of a path."""
    path = folder / "path.json"
    path.write_text(json.dumps({"keyframes": keyframes}))
    return path


def forward_of(rotation: object) -> np.ndarray:
    """Where a camera looks."""
    return quaternion.rotate(np.asarray(rotation, np.float64), np.array((0.0, 0.0, -1.0)))


def test_it_is_the_spline_of_catmull_and_rom(tmp_path: Path) -> None:
    path = read_camera_path(written(tmp_path, KEYS))
    time = np.array([key["time"] for key in KEYS])
    opening = [FIELD_OF_VIEW, 0.6, 0.6, 1.2]
    values = np.array([[*key["eye"], *key["target"], angle] for key, angle in zip(KEYS, opening, strict=True)])
    slopes = np.gradient(values, axis=0)  # of equal steps: the differences, which the times then divide
    slopes[0], slopes[-1] = (values[1] - values[0]) / 0.5, (values[3] - values[2]) / 0.5
    slopes[1], slopes[2] = (values[2] - values[0]) / 2.5, (values[3] - values[1]) / 2.5
    spline = CubicHermiteSpline(time, values, slopes)
    for now in np.linspace(0.5, 3.5, 61):
        camera, expected = path.camera_at(float(now)), spline(now)
        np.testing.assert_allclose(camera.position, expected[:3], atol=1e-12)
        assert camera.field_of_view == pytest.approx(expected[6])
        toward = expected[3:6] - expected[:3]
        np.testing.assert_allclose(forward_of(camera.rotation), toward / np.linalg.norm(toward), atol=1e-9)


def test_it_passes_its_keyframes_and_rests_before_and_after(tmp_path: Path) -> None:
    path = read_camera_path(written(tmp_path, KEYS))
    for key in KEYS:
        np.testing.assert_allclose(path.camera_at(key["time"]).position, key["eye"], atol=1e-12)
    assert path.camera_at(-9.0) == path.camera_at(0.5)
    assert path.camera_at(99.0) == path.camera_at(3.5)
    alone = read_camera_path(written(tmp_path, KEYS[:1]))
    assert alone.camera_at(0.0) == alone.camera_at(7.0)


@pytest.mark.parametrize(
    ("keyframes", "said"),
    [
        ([], "length >= 1"),
        ("none", "Expected `array`"),
        ([{"time": 0, "eye": [0, 1], "target": [0, 0, 0]}], r"keyframes\[0\].eye"),
        ([{"time": 0, "eye": [0, 1, 2]}], "missing required field `target`"),
        ([{**KEYS[0], "fov": 3}], "unknown field `fov`"),
        ([{**KEYS[0], "field_of_view": 4}], "field_of_view"),
        ([{**KEYS[0], "eye": [0, 0, 0]}], r"keyframes\[0\] looks at the place where it stands"),
        ([{**KEYS[0], "eye": [1e300, 0, 0]}], r"keyframes\[0\] has a number beyond all scenes"),
        ([KEYS[1], KEYS[0]], r"keyframes\[1\] is at 0.5 s, not after the one before at 1 s"),
        ([KEYS[0], KEYS[0]], "sort them"),
    ],
)
def test_a_wrong_path_names_the_place(tmp_path: Path, keyframes: object, said: str) -> None:
    with pytest.raises(ElysError, match=said) as caught:
        read_camera_path(written(tmp_path, keyframes))
    assert "path.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_path_at_all(tmp_path: Path) -> None:
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "empty.json").write_bytes(b"")
    for name, said in (
        ("binary.json", "no camera path"),
        ("empty.json", "no camera path"),
        ("gone.json", "No such file"),
    ):
        with pytest.raises(ElysError, match=said):
            read_camera_path(tmp_path / name)
    with pytest.raises(ElysError, match="cannot be read"):
        read_camera_path(tmp_path)


@pytest.mark.parametrize("aspect", [16 / 9, 0.6])
def test_going_round_everything_stays_in_the_picture(aspect: float) -> None:
    lower, upper = np.array((-4.0, 0.0, 1.0)), np.array((5.0, 2.0, 3.0))
    path = CircularPath.around(lower, upper, period=8.0, aspect=aspect)
    corners = np.array([(x, y, z, 1.0) for x in (lower[0], upper[0]) for y in (0.0, 2.0) for z in (1.0, 3.0)])
    positions = []
    for time in np.linspace(0.0, 8.0, 33):
        camera = path.camera_at(float(time))
        view = View.of(camera, round(1000 * aspect), 1000)
        clip = np.column_stack((corners[:, :3] - view.eye, np.ones(8))) @ view.clip_from_relative.T
        assert (np.abs(clip[:, :3]) <= clip[:, 3:]).all()
        positions.append(camera.position)
    np.testing.assert_allclose(positions[0], positions[-1], atol=1e-9)
    heights = np.array(positions)[:, 1]
    np.testing.assert_allclose(heights, heights[0])
    quarter = np.array(positions[8]) - positions[24]  # half a turn later on the other side
    np.testing.assert_allclose(np.array(positions[8]) - quarter / 2, ((0.5, heights[0], 2.0)), atol=1e-9)


def test_around_nothing_there_is_a_camera_too() -> None:
    path = CircularPath.around(np.full(3, np.inf), np.full(3, -np.inf), period=1.0, aspect=1.0)
    assert np.isfinite(path.camera_at(0.3).position).all()
