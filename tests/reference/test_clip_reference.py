"""Clips of whole models against a plain reading of the standard."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest

from elys.common.assets import AssetStore
from elys.common.assets.clip import decode_clips
from elys.common.assets.clip_sampling import ClipSampler
from elys.common.assets.gltf import import_model
from elys.common.assets.gltf_writing import GltfModel
from elys.common.assets.primitives import primitive
from elys.common.math import quaternion
from elys.samples.figure import FILE
from tests.reference.plain_clips import read_model, sampled

MODELS = ("Fox/Fox.glb", "AnimatedCube/03_animated_cube.gltf", "SimpleSkin/SimpleSkin.gltf")
WIDTHS = {"translation": 3, "rotation": 4, "scale": 3, "weights": 2}


def assert_as_the_standard_says(path: Path, *, count: int) -> None:
    plain = read_model(path)
    store = AssetStore()
    clips = decode_clips(store.get(import_model(path, store).clips))
    chance = random.Random(7)
    assert len(clips) == len(plain.document["animations"])
    for clip, animation in zip(clips, plain.document["animations"], strict=True):
        assert len(clip.channels) == len(animation["channels"])
        sampler = ClipSampler(clip)
        times = [0.0, clip.duration, *(chance.uniform(-0.1, clip.duration + 0.1) for _ in range(count))]
        samples = sampler.sample(np.array(times))
        columns = dict.fromkeys(("position", "rotation", "scale", "weights"), 0)
        for channel, described in zip(clip.channels, animation["channels"], strict=True):
            column = columns[channel.property]
            width = channel.values.shape[-1] if channel.property == "weights" else 1
            columns[channel.property] += width
            for row, time in enumerate(times):
                expected = sampled(plain, animation, described, time)
                if channel.property == "weights":
                    found = samples.weights[row, column : column + width].tolist()
                else:
                    found = getattr(samples, channel.property)[row, column].tolist()
                if channel.property == "rotation" and sum(map(math.prod, zip(found, expected, strict=True))) < 0.0:
                    expected = [-number for number in expected]
                assert found == pytest.approx(expected, rel=1e-6, abs=1e-6), (channel.target, time)


@pytest.mark.parametrize("name", MODELS)
def test_real_models_move_as_the_standard_says(name: str, shared_assets: Path) -> None:
    assert_as_the_standard_says(shared_assets / name, count=12)


def test_the_sample_figure_does() -> None:
    assert_as_the_standard_says(FILE, count=12)


@pytest.mark.parametrize("mode", ["STEP", "LINEAR", "CUBICSPLINE"])
def test_each_interpolation_of_each_property_does(mode: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    model = GltfModel("test")
    mesh = primitive("box")
    made = model.primitive(mesh)
    offsets = [rng.normal(size=mesh.positions.shape).astype(np.float32) for _ in range(2)]
    made["targets"] = [{"POSITION": model.accessor(each, has_bounds=True)} for each in offsets]
    model.add("meshes", {"primitives": [made]})
    model.add("nodes", {"name": "Thing", "mesh": 0})
    model.add("scenes", {"nodes": [0]})
    model.document["scene"] = 0
    times = np.sort(rng.uniform(0.2, 3.0, 7)).astype(np.float32)
    animation: dict[str, list[dict[str, object]]] = {"samplers": [], "channels": []}
    for path, width in WIDTHS.items():
        keys = rng.normal(size=(7, 3 if mode == "CUBICSPLINE" else 1, width))
        if path == "rotation":
            keys[:, -2 if mode == "CUBICSPLINE" else 0] = quaternion.normalize(rng.normal(size=(7, 4)))
        rows = keys.reshape(-1, width).astype(np.float32)
        output = model.accessor(rows.ravel() if path == "weights" else rows)
        animation["samplers"].append({"input": model.accessor(times), "output": output, "interpolation": mode})
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": {"node": 0, "path": path}})
    model.add("animations", {"name": "All", **animation})
    with (tmp_path / "thing.glb").open("wb") as file:
        model.write(file)
    assert_as_the_standard_says(tmp_path / "thing.glb", count=60)
