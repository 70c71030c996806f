"""The example scenes of the docs: they open, stand in their canonical form, and do what the docs say."""

from __future__ import annotations

from pathlib import Path

import pytest

from elys.common.assets.store import AssetStore
from elys.common.components import Light
from elys.common.scene import format_scene, open_scene, parse_scene
from elys.sim_node.simulation import Simulation

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.json")), ids=lambda path: path.name)
def test_an_example_is_written_as_elys_writes_it(path):
    text = path.read_text()
    assert format_scene(parse_scene(text, is_prefab=path.name.endswith(".prefab.json"))) == text


def test_ball_and_crate_come_to_rest_on_the_table_by_the_lamp():
    simulation = Simulation.load(open_scene(EXAMPLES / "table.scene.json", assets := AssetStore()), assets)
    for _ in range(600):
        simulation.step()
    world = simulation.world
    ball, crate = (world.transforms.world_pose(world.hierarchy.find(name))[0] for name in ("Ball", "Crate"))
    assert ball[1] == pytest.approx(0.9, abs=0.01)  # 0.8 m of table and a radius of 0.1 m
    assert crate[1] == pytest.approx(0.925, abs=0.01)
    assert world.get(world.hierarchy.find("Lamp on the table/Bulb"), Light).intensity == 3.0


def test_the_page_quotes_the_file():
    page = (EXAMPLES.parent / "scene-files.md").read_text()
    quoted = page.split("```json\n", 1)[1].split("```", 1)[0].strip()
    text = (EXAMPLES / "table.scene.json").read_text()
    assert all(part.strip() in text for part in quoted.split("    },\n"))
