"""Levels that a person made: read from a scene's file, renewed for each race, each state of them with times of its own."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import msgspec
import pytest

from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError
from elys.common.made_contents import keep_made_contents
from elys.common.scene import EntityRecord, collapse, read_script_file, write_scene
from elys.common.scene_files import PIECES_FOLDER
from elys.game.bot import Bot
from elys.game.scene_level import SceneLevel
from elys.samples.game.kit import Medals
from elys.samples.game.levels import LEVELS, with_values
from elys.sim_node.scripts.library import ScriptLibrary
from elys.sim_node.simulation import Simulation


def save(path: Path, records: list[EntityRecord], assets: AssetStore) -> None:
    keep_made_contents(records, path, assets)
    settings = LEVELS["meadow"].open(AssetStore())[0].settings
    write_scene(collapse(records, name="Mine", settings=settings, directory=path.parent, assets=assets), path)


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """Meadow for two, saved as a file."""
    assets = AssetStore()
    save(tmp_path / "mine.scene.json", LEVELS["meadow"].open(assets, players=2)[0].records, assets)
    return tmp_path / "mine.scene.json"


def moved(mine: Path, name: str, **values: Any) -> None:
    """The file with an entity's transform changed."""
    assets = AssetStore()
    records = SceneLevel.read(mine, assets).opened.records
    changed = [
        msgspec.structs.replace(
            one, components={**one.components, "Transform": {**one.components["Transform"], **values}}
        )
        if one.name == name
        else one
        for one in records
    ]
    save(mine, changed, assets)


def test_it_is_raced_in_like_the_one_it_was_made_of(mine: Path) -> None:
    assets = AssetStore()
    level = SceneLevel.read(mine, assets)
    assert (level.name, level.title, level.seats, level.medals) == (
        "mine.scene.json",
        "Mine",
        2,
        LEVELS["meadow"].medals,
    )
    opened, _ = level.open(assets, values={"Menu": {"level": "mine"}})
    simulation = Simulation.load(opened, assets)
    bot = Bot(simulation, LEVELS["meadow"].open(AssetStore())[1])  # nobody knows the line of a file: it is meadow's
    gates = 0
    while simulation.tick < 1500 and gates < 2:
        for request in bot():
            simulation.inputs.take(request.command)
        simulation.step()
        gates += sum(event.kind == "race_gate" for event in simulation.take_events())
    assert gates == 2


def test_what_is_told_before_a_race_leaves_its_times_and_an_edit_does_not(mine: Path) -> None:
    level = SceneLevel.read(mine, AssetStore())
    assets = AssetStore()
    records = SceneLevel.read(mine, assets).opened.records
    told = {"Menu": {"is_open": True, "level": "mine"}, "Display 1": {"best": "1.0,2.0"}, "Ball 1": {"look_speed": 4.5}}
    save(mine, with_values(records, told), assets)
    assert level.renewed(AssetStore()).board == level.board
    moved(mine, "Gate 2", scale=[1.5, 1.0, 1.0])
    assert level.renewed(AssetStore()).board != level.board


def test_a_file_that_is_broken_between_races_is_said_and_the_level_stays(mine: Path, caplog) -> None:
    assets = AssetStore()
    level = SceneLevel.read(mine, assets)
    mine.write_text(mine.read_text()[:-100])
    with caplog.at_level(logging.ERROR):
        assert level.renewed(assets) is level
    assert "the race is that of before" in caplog.text
    assert level.open(assets)[0].records == level.opened.records


def without_scripts_of(mine: Path, start: str) -> None:
    assets = AssetStore()
    kept = [
        msgspec.structs.replace(one, components={name: v for name, v in one.components.items() if name != "Script"})
        if one.name.startswith(start)
        else one
        for one in SceneLevel.read(mine, assets).opened.records
    ]
    save(mine, kept, assets)


@pytest.mark.parametrize(("gone", "noun"), [("Race", "clock"), ("Ball", "ball"), ("Gate", "gate")])
def test_what_nobody_could_race_in_is_no_level(mine: Path, gone: str, noun: str) -> None:
    without_scripts_of(mine, gone)
    with pytest.raises(ElysError, match=rf"mine\.scene\.json is no level: it has no {noun} \(`elys:game`, {gone}\)"):
        SceneLevel.read(mine, AssetStore())


def test_as_many_can_race_as_there_are_balls(mine: Path) -> None:
    without_scripts_of(mine, "Ball 1")
    assert SceneLevel.read(mine, AssetStore()).seats == 1


def test_more_players_than_balls_are_refused(mine: Path) -> None:
    assets = AssetStore()
    with pytest.raises(ElysError, match="has balls for 2, not for 3: give --players 2"):
        SceneLevel.read(mine, assets).open(assets, players=3)


def test_medals_that_a_file_does_not_say_are_those_of_the_script() -> None:
    assets = AssetStore()
    source = read_script_file(PIECES_FOLDER / "game" / "race.py", "Race", assets)
    fields = ScriptLibrary(assets).load(source).fields
    assert Medals() == Medals(**{name: fields[name].default for name in ("gold", "silver", "bronze")})
