"""A .glb of a recording: sound for Khronos' validator, and where three.js and pygltflib see things is where they were."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus.exports.model import export_glb
from elys.bus.exports.selection import Selection
from elys.common.assets.gltf import import_model
from elys.common.assets.store import AssetStore
from elys.common.errors import RecordingError
from elys.common.math.matrix import compose_affine, multiply_affine
from tests.unit.bus.told_recordings import (
    CARRIER,
    DESPAWNED,
    EDITED,
    FALLING,
    GUEST,
    IMAGE,
    RATE,
    SPAWNED,
    TICKS,
    WHEEL,
    poses,
    write_told,
)

NODES = ("Ground", "Falling", "Carrier", "Lamp", "Wheel", "Picture", "Arm", "Hand", "Guest")
NO_TURN = (0.0, 0.0, 0.0, 1.0)
ONE = (1.0, 1.0, 1.0)


@pytest.fixture
def told(tmp_path: Path) -> Path:
    return write_told(tmp_path / "told.mcap")


def world_of(tick: int) -> dict[str, Any]:
    """world_from_node (3, 4) of each node at a tick, in closed form; None for who is not there."""
    t, bodies = tick / RATE, poses(tick)
    carrier = compose_affine(*bodies[CARRIER], ONE)
    arm = compose_affine((0.0, t / 2, 0.0), NO_TURN, (1 + t,) * 3)
    return {
        "Ground": compose_affine((1.0 if tick >= EDITED else 0.0, 0.0, 0.0), NO_TURN, (4.0, 1.0, 4.0)),
        "Falling": compose_affine(*bodies[FALLING], ONE),
        "Carrier": carrier,
        "Lamp": multiply_affine(carrier, compose_affine((0.0, 0.5, 0.0), NO_TURN, (0.5,) * 3)),
        "Wheel": compose_affine(*bodies[WHEEL], ONE),
        "Picture": compose_affine((-2.0, 0.0, 0.0), NO_TURN, ONE),
        "Arm": arm,
        "Hand": multiply_affine(arm, compose_affine((0.0, 1.0, 0.0), NO_TURN, ONE)),
        "Guest": compose_affine(*bodies[GUEST], (2.0,) * 3) if GUEST in bodies else None,
    }


def test_three_js_sees_everything_where_it_was(told: Path, tmp_path: Path, node_js: Any) -> None:
    report = export_glb(told, tmp_path / "m.glb")
    ticks = [0, 1, 20, SPAWNED - 1, SPAWNED + 1, EDITED - 1, EDITED + 1, 77, DESPAWNED + 1, TICKS - 1]
    seen = node_js("three_js.mjs", tmp_path / "m.glb", *(str(t / RATE) for t in ticks), needs=("three",))
    assert report.nodes == len(NODES) and report.samples == TICKS + 1
    assert seen["names"] == list(NODES)
    assert seen["clips"] == pytest.approx([TICKS / RATE])
    for tick, moment in zip(ticks, seen["moments"], strict=True):
        for name, expected in world_of(tick).items():
            matrix = np.array(moment[name]["matrix"]).reshape(4, 4).T
            if expected is None:
                np.testing.assert_allclose(matrix[:3, :3], 0.0, atol=1e-9)
            else:
                np.testing.assert_allclose(matrix[:3], expected, atol=2e-5, err_msg=f"{name} at tick {tick}")
        assert moment["Picture"]["weights"] == pytest.approx([tick / RATE / 10], abs=1e-6)
        assert moment["Picture"]["textured"] and moment["Picture"]["mesh"] == 4
        assert moment["Falling"]["color"] == pytest.approx([1.0, 0.5, 0.25])
        assert moment["Lamp"]["light"] and moment["Carrier"]["mesh"] == 0


def test_khronos_validator_finds_nothing(told: Path, tmp_path: Path, node_js: Any) -> None:
    export_glb(told, tmp_path / "m.glb")
    report = node_js("gltf_validator.mjs", tmp_path / "m.glb", needs=("gltf-validator",))
    assert report["issues"]["numErrors"] == report["issues"]["numWarnings"] == 0, report["issues"]["messages"]
    assert report["info"]["animationCount"] == 1


def test_pygltflib_reads_the_keys(told: Path, tmp_path: Path) -> None:
    pygltflib = pytest.importorskip("pygltflib")
    export_glb(told, tmp_path / "m.glb", Selection(start=0.5, end=1.5, rate=30.0))
    model = pygltflib.GLTF2().load(str(tmp_path / "m.glb"))
    (animation,) = model.animations

    def array(number: int) -> Any:
        accessor = model.accessors[number]
        view = model.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        data = np.frombuffer(model.binary_blob(), np.float32, accessor.count * width, view.byteOffset)
        return data.reshape(-1, width)

    def channel(name: str, path: str) -> tuple[Any, Any]:
        node = [node.name for node in model.nodes].index(name)
        (found,) = (c for c in animation.channels if (c.target.node, c.target.path) == (node, path))
        sampler = animation.samplers[found.sampler]
        return array(sampler.input)[:, 0], array(sampler.output)

    times, places = channel("Falling", "translation")
    np.testing.assert_allclose(times, np.arange(31) / 30, atol=1e-6)
    np.testing.assert_allclose(places[:, 1], 4.5 - times, atol=1e-6)
    times, scales = channel("Guest", "scale")
    np.testing.assert_allclose(scales, [[2.0] * 3, [0.0] * 3])
    assert times.tolist() == pytest.approx([0.0, 1.0])
    # What never moves has no channel, and what turns evenly no more than its turn.
    moved = {(model.nodes[c.target.node].name, c.target.path) for c in animation.channels}
    assert ("Carrier", "rotation") not in moved and ("Picture", "translation") not in moved
    assert ("Falling", "rotation") in moved


def test_elys_itself_reads_it_back(told: Path, tmp_path: Path) -> None:
    """Meshes, materials and images go the whole way round."""
    export_glb(told, tmp_path / "m.glb", Selection(end=0.1))
    assets = AssetStore()
    records = {record.name: record for record in import_model(tmp_path / "m.glb", assets).records}
    assert set(NODES) - {"Guest"} <= set(records)
    material = records["Picture"].components["Material"]
    assert material["roughness"] == pytest.approx(0.25)
    image, _, options = material["base_color_texture"].partition("?")
    assert assets.get(image) == IMAGE and "scale=2,2" in options
    assert records["Lamp"].components["Light"]["intensity"] == pytest.approx(10.0)


def test_what_rests_costs_two_keys(tmp_path: Path) -> None:
    whole = write_told(tmp_path / "told.mcap")
    export_glb(whole, tmp_path / "all.glb", Selection(entities=("Falling",)))
    export_glb(whole, tmp_path / "one.glb", Selection(entities=("Picture",)))
    assert (tmp_path / "one.glb").stat().st_size < (tmp_path / "all.glb").stat().st_size
    assert math.isclose(export_glb(whole, tmp_path / "n.glb", Selection(start=1.0, end=1.0)).duration, 0.0)


def test_more_than_a_model_holds_is_refused_with_a_remedy(
    told: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("elys.bus.exports.model_motion.MAX_SAMPLES", 5000)
    with pytest.raises(RecordingError, match="take fewer with --rate"):
        export_glb(told, tmp_path / "m.glb")
    assert not (tmp_path / "m.glb").exists()
