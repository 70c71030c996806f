"""The sample figure: its file is what its code makes, its feet stay where they tread, and its walkers on their circle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from elys.common.assets import AssetStore
from elys.common.assets.clip import decode_clips
from elys.common.assets.gltf import import_model
from elys.common.assets.mesh import decode_mesh
from elys.common.components import Animation, RootMotion
from elys.samples.dance import RADIUS, check_dance
from elys.samples.figure import CLIPS, FILE, RUN, WALK, Gait, figure_model
from elys.samples.registry import write_sample
from elys.sim_node.simulation import Simulation
from elys.verbs.scenes import open_scene_or_sample


def test_the_file_is_what_the_code_makes(tmp_path: Path) -> None:
    (tmp_path / "figure.glb").write_bytes(figure_model())
    stores = AssetStore(), AssetStore()
    models = [import_model(path, store) for path, store in zip((FILE, tmp_path / "figure.glb"), stores, strict=True)]
    clips = [decode_clips(store.get(model.clips)) for model, store in zip(models, stores, strict=True)]
    assert [clip.name for clip in clips[0]] == list(CLIPS)
    for kept, made in zip(*clips, strict=True):
        for one, other in zip(kept.channels, made.channels, strict=True):
            assert (one.target, one.property) == (other.target, other.property)
            np.testing.assert_allclose(one.values, other.values, atol=1e-5)
    meshes = [decode_mesh(store.get(model.meshes[0, 0])) for model, store in zip(models, stores, strict=True)]
    np.testing.assert_allclose(meshes[0].positions, meshes[1].positions, atol=1e-5)
    np.testing.assert_array_equal(meshes[0].indices, meshes[1].indices)


def test_the_figure_stands_on_the_ground_and_its_skin_is_closed() -> None:
    store = AssetStore()
    mesh = decode_mesh(store.get(import_model(FILE, store).meshes[0, 0]))
    low, high = mesh.bounds
    assert low[1] == pytest.approx(0.0, abs=1e-6) and high[1] == pytest.approx(1.76, abs=0.02)
    corners = mesh.positions[mesh.indices.reshape(-1, 3)].astype(np.float64)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert 0.05 < volume < 0.09  # [m3] of a person; outside out
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize(("clip", "gait"), [("Walk", WALK), ("Run", RUN)])
def test_a_foot_on_the_ground_stays_where_it_is(clip: str, gait: Gait) -> None:
    assets = AssetStore()
    simulation = Simulation.load(open_scene_or_sample(str(FILE), assets), assets)
    world = simulation.world
    (player,) = world.query(Animation).entities.tolist()
    world.add(player, RootMotion(node="Hips"))
    world.set_fields(player, Animation, {"clip": clip})
    simulation.settle()
    foot = world.hierarchy.find("figure/Hips/L Thigh/L Shin/L Foot")
    seen = []
    ticks = round(gait.duration * 60)
    for _ in range(ticks):
        simulation.step()
        seen.append(world.transforms.world_pose(foot)[0])
    places = np.array(seen)
    phase = np.arange(1, ticks + 1) / ticks
    treads = (phase > 0.1 * gait.stance) & (phase < 0.6 * gait.stance)
    assert np.ptp(places[treads, 2]) < 0.015  # [m], of a way of more than half a metre
    assert np.ptp(places[treads, 1]) < 0.012
    assert world.transforms.world_pose(player)[0][2] == pytest.approx(-gait.stride, rel=0.03)


def test_who_goes_around_comes_back(tmp_path: Path) -> None:
    write_sample("dance", tmp_path / "dance.scene.json")
    assert (tmp_path / "figure.glb").read_bytes() == FILE.read_bytes()
    assets = AssetStore()
    simulation = Simulation.load(open_scene_or_sample(str(tmp_path / "dance.scene.json"), assets), assets)
    world = simulation.world
    steps = 0
    places = {}
    for _ in range(720):  # twelve rounds of 30 degrees
        simulation.step()
        steps += sum(event.kind == "step" for event in simulation.take_events())
    for entity in world.entities().tolist():
        places[world.hierarchy.name_of(entity)] = world.transforms.world_pose(entity)[0]
    assert check_dance(places) == ""
    assert places["Walker 1"] == pytest.approx((RADIUS, 0.0, 0.0), abs=0.01)
    assert steps == 3 * 12 * 2
    assert not any(event.kind == "animation" for event in simulation.take_events())
    assert "left the circle" in check_dance({**places, "Walker 2": (0.0, 0.0, 0.0)})
