"""Animations of glTF models: which clips they become, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.common.assets import AssetStore
from elys.common.assets.clip import decode_clips
from elys.common.assets.gltf import import_gltf
from elys.common.assets.gltf_schema import parse_gltf
from elys.common.errors import AssetError
from elys.common.scene import open_scene
from elys.sim_node.simulation import Simulation
from tests.unit.common.assets.test_gltf import Model, quad

TIMES = np.array((0.0, 0.5, 2.0), np.float32)


def moving(path: str = "translation", interpolation: str = "LINEAR", values: Any = None, **fields: Any) -> Model:
    """A model whose arm moves."""
    model = quad()
    model.document["nodes"] = [{"name": "Root", "children": [1]}, {"name": "Arm", "mesh": 0}]
    values = np.arange(9, dtype=np.float32).reshape(3, 3) if values is None else values
    sampler = {"input": model.accessor(TIMES), "output": model.accessor(values, **fields)}
    model.document["animations"] = [
        {
            "name": "Wave",
            "samplers": [{**sampler, "interpolation": interpolation}],
            "channels": [{"sampler": 0, "target": {"node": 1, "path": path}}],
        }
    ]
    return model


def imported(model: Model, folder: Path) -> tuple[list[Any], Any]:
    path = folder / "model.gltf"
    path.write_bytes(model.embedded())
    assets = AssetStore()
    records = import_gltf(path, assets)
    animation = records[0].components.get("Animation")
    return records, decode_clips(assets.get(animation["clips"])) if animation else ()


def test_channels_name_their_targets_by_the_way_from_the_root(tmp_path: Path) -> None:
    (clip,) = imported(moving(), tmp_path)[1]
    (channel,) = clip.channels
    assert (clip.name, clip.duration) == ("Wave", 2.0)
    assert (channel.target, channel.property, channel.interpolation) == (("Root", "Arm"), "position", "linear")
    np.testing.assert_array_equal(channel.times, TIMES)
    np.testing.assert_array_equal(channel.values, np.arange(9).reshape(3, 3))


def test_normalised_rotations_and_splines(tmp_path: Path) -> None:
    turns = np.array(((0, 0, 0, 32767), (0, 32767, 0, 0), (0, 0, 0, -32767)), np.int16)
    model = moving("rotation", values=turns, normalized=True)
    (clip,) = imported(model, tmp_path)[1]
    np.testing.assert_array_equal(clip.channels[0].values, np.sign(turns))
    keys = np.arange(27, dtype=np.float32).reshape(9, 3)
    (clip,) = imported(moving("scale", "CUBICSPLINE", keys), tmp_path)[1]
    np.testing.assert_array_equal(clip.channels[0].values, keys.reshape(3, 3, 3))


def test_clips_get_names_of_their_own(tmp_path: Path) -> None:
    model = moving()
    (wave,) = model.document["animations"]
    unnamed = {key: value for key, value in wave.items() if key != "name"}
    model.document["animations"] = [wave, wave, unnamed, {**wave, "channels": []}]
    assert [clip.name for clip in imported(model, tmp_path)[1]] == ["Wave", "Wave 1", "Animation 2"]


def test_a_model_without_movement_has_no_animation(tmp_path: Path) -> None:
    model = moving()
    model.document["animations"][0]["channels"][0]["target"] = {"path": "pointer"}
    records, clips = imported(model, tmp_path)
    assert "Animation" not in records[0].components
    assert clips == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a, m: a["samplers"][0].update(input=m.accessor(TIMES[::-1].copy())), "must be times that rise"),
        (lambda a, m: a["samplers"][0].update(output=m.accessor(np.zeros((2, 3), np.float32))), "must hold 3 vectors"),
        (lambda a, m: a["samplers"][0].update(interpolation="CUBICSPLINE"), "must hold 9 vectors of 3"),
        (lambda a, m: a["samplers"][0].update(interpolation="SMOOTH"), "interpolation"),
        (lambda a, m: a["samplers"][0].update(input=99), "99"),
        (lambda a, m: a["channels"][0].update(sampler=3), "sampler"),
        (lambda a, m: a["channels"][0]["target"].update(node=7), "node"),
        (lambda a, m: a["channels"].append(a["channels"][0]), "moves what another channel moves already"),
    ],
)
def test_animations_that_are_wrong_are_refused(change: Any, words: str, tmp_path: Path) -> None:
    model = moving()
    change(model.document["animations"][0], model)
    with pytest.raises(AssetError, match=words) as caught:
        imported(model, tmp_path)
    assert "animations[0]" in str(caught.value)


def test_the_fox_walks_as_its_file_says(shared_assets: Path) -> None:
    assets = AssetStore()
    opened = open_scene(str(shared_assets / "Fox" / "Fox.glb"), assets)
    simulation = Simulation.load(opened, assets)
    clips = decode_clips(assets.get(opened.records[0].components["Animation"]["clips"]))
    assert [clip.name for clip in clips] == ["Survey", "Walk", "Run"]
    for _ in range(60):
        simulation.step()
    for channel in clips[0].channels:
        path = "/".join((opened.records[0].name, *channel.target))
        entity = simulation.world.hierarchy.find(path)
        found = getattr(simulation.world.get(entity, "Transform"), channel.property)
        if channel.property == "position":
            expected = [np.interp(1.0, channel.times, column) for column in channel.values.T]
            np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
        else:
            key = int(np.searchsorted(channel.times, 1.0, side="right")) - 1
            share = (1.0 - channel.times[key]) / (channel.times[key + 1] - channel.times[key])
            expected = slow_slerp(channel.values[key], channel.values[key + 1], float(share))
            assert abs(np.dot(found, expected)) == pytest.approx(1.0, abs=1e-6)
    document, _ = parse_gltf((shared_assets / "Fox" / "Fox.glb").read_bytes())
    assert len(clips[0].channels) == len(document.animations[0].channels)


def slow_slerp(start: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    cosine = float(np.dot(start, end))
    end, angle = (end, np.arccos(min(abs(cosine), 1.0))) if cosine >= 0 else (-end, np.arccos(min(-cosine, 1.0)))
    if angle < 1e-6:
        return start
    return (np.sin((1 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle)
