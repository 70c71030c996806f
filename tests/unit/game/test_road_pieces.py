"""Pieces of road: as the code makes them, one fitting to the next, and rolled over without a bump where they meet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from elys.common.assets.store import AssetStore
from elys.common.components import RigidBody
from elys.common.scene import EntityNode, SceneDocument, SceneSettings, expand
from elys.common.scene_files import PIECES_FOLDER
from elys.samples.game.course import Course
from elys.samples.game.road_pieces import MESHES, ROADS, write
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation


def test_the_files_are_what_the_code_makes(tmp_path: Path) -> None:
    write(tmp_path)
    for file in tmp_path.iterdir():
        assert file.read_bytes() == (PIECES_FOLDER / "game" / file.name).read_bytes(), file.name
    assert (tmp_path / MESHES).is_file()


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("road_straight", (0.0, 0.0, -10.0)),
        ("road_bend_left", (-12.0, 0.0, -12.0)),
        ("road_bend_right", (12.0, 0.0, -12.0)),
        ("road_slope", (0.0, 2.0, -12.0)),
        ("road_jump", (0.0, 2.0, -10.0)),
    ],
)
def test_where_one_ends_another_can_begin(name: str, end: tuple[float, float, float]) -> None:
    assert np.allclose(ROADS[name](Course()).here.position, end, atol=0.01)


def test_a_fast_ball_feels_no_edge_where_pieces_meet() -> None:
    pieces = [
        EntityNode(
            name=f"Road {number}",
            prefab="elys:game/road_straight.prefab.json",
            components={"Transform": {"position": [0.0, 0.0, -10.0 * number]}},
        )
        for number in range(9)
    ]
    for speed in (9.0, 13.0, 16.7):
        ball = EntityNode(
            name="Ball",
            components={
                "Transform": {"position": [0.3, 0.5, -2.0]},
                "RigidBody": {"mass": 8.0, "linear_velocity": [0, 0, -speed], "angular_velocity": [-speed / 0.5, 0, 0]},
                "Collider": {"shape": "sphere", "friction": 1.2},
                "MeshRenderer": {"mesh": "sphere"},
            },
        )
        assets = AssetStore()
        document = SceneDocument(name="Road", settings=SceneSettings(), entities=[*pieces, ball])
        records = expand(document, directory=PIECES_FOLDER, assets=assets)
        simulation = Simulation(assets=assets)
        load_records(simulation.world, records)
        simulation.settle()
        (entity,) = simulation.scripts.named("Ball")
        heights = []
        for _ in range(int(70.0 / speed * 60.0)):
            simulation.step()
            heights.append(simulation.world.transforms.world_pose(entity)[0][1])
        assert simulation.world.transforms.world_pose(entity)[0][2] < -60.0
        assert max(heights) < 0.53, speed
        assert np.linalg.norm(simulation.world.get(entity, RigidBody).linear_velocity) > 0.8 * speed
