"""What a referee does between races: edits that no file has are kept, and a level that the editor saved is raced in."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

from elys.bus.messages.commands import CommandRequest, NoteSaved, Rename, SetComponent, Tell
from elys.bus.messages.session import Event
from elys.bus.session import Session
from elys.common.assets.store import AssetStore
from elys.common.components import OverlayText
from elys.common.scene import open_scene
from elys.editor_node.asset_placing import AssetPlacing
from elys.editor_node.model import EditorModel
from elys.editor_node.piece_list import PIECE_MENUS, piece_file
from elys.game.board import Board
from elys.game.referee import HEARD, Attempt, Finished, Referee, result_of
from elys.game.scene_level import SceneLevel
from elys.samples.game.levels import LEVELS
from tests.unit.game.hosted_races import hosted, raced


async def until(condition) -> None:
    async with asyncio.timeout(60.0):
        while not condition():
            await asyncio.sleep(0.005)


def went(referee: Referee) -> bool:
    return referee.attempt is not None and referee.attempt.began >= 0.0


async def ask(referee: Referee, command) -> None:
    reply = await referee._node.put(CommandRequest(origin="test", command=command))
    assert reply.accepted, reply.reason


@contextlib.asynccontextmanager
async def editing(referee: Referee) -> AsyncIterator[EditorModel]:
    """An editor's model in the session of a race that has begun."""
    broker = referee.broker  # type: ignore[attr-defined]
    session = await Session.join(broker.connect(), kind="editor")
    model = EditorModel(session)
    running = asyncio.create_task(model.run())
    try:
        await until(lambda: went(referee) and model.scene.is_known)
        yield model
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await session.close()


@pytest.mark.timeout(300)
def test_no_race_begins_while_there_are_edits_that_no_file_has(tmp_path: Path, caplog) -> None:
    async def scenario() -> None:
        async with hosted(LEVELS["meadow"], tmp_path) as referee:
            await until(lambda: went(referee))
            node = referee._node
            (gate,) = node.simulation.scripts.named("Gate 1")
            await ask(referee, Rename(entity=gate, name="Mine"))
            attempt = referee.attempt
            with caplog.at_level(logging.WARNING):
                referee._wishes.put_nowait(("restart", {}))
                await until(lambda: "has edits that are not saved" in caplog.text)
            assert referee.attempt is attempt  # the race goes on, and the edit is there
            assert node.simulation.scripts.named("Mine") == [gate]
            await ask(referee, NoteSaved(path=str(tmp_path / "mine.scene.json"), content=node.history.content))
            referee._wishes.put_nowait(("restart", {}))
            await until(lambda: referee.attempt is not attempt and went(referee))
            assert not node.simulation.scripts.named("Mine")

    asyncio.run(scenario())


@pytest.mark.timeout(600)
def test_what_the_editor_saves_in_the_middle_of_a_race_is_a_level(tmp_path: Path, monkeypatch) -> None:
    """From the editor's Save, meshes that code made and all, to a race in the file that is finished and proven."""
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
    file = tmp_path / "levels" / "mine.scene.json"
    file.parent.mkdir()

    async def edit_and_save() -> None:
        async with hosted(LEVELS["meadow"], tmp_path / "times") as referee, editing(referee) as model:
            (gate,) = referee._node.simulation.scripts.named("Gate 1")
            await ask(referee, SetComponent(entity=gate, component="Transform", values={"scale": [1.25, 1.0, 1.0]}))
            await until(lambda: model.file.is_dirty)
            await model.documents.save(file)
            await until(lambda: referee._node.history.content == referee._node.history.saved)

    asyncio.run(edit_and_save())
    assert (file.parent / "mine.parts").is_dir()
    opened = open_scene(file, AssetStore())
    assert any(
        one.name == "Gate 1" and one.components["Transform"]["scale"] == [1.25, 1.0, 1.0] for one in opened.records
    )
    level = SceneLevel.read(file, AssetStore())
    asyncio.run(raced(level, tmp_path / "times"))
    (entry,) = Board(level.board, tmp_path / "times").entries
    assert entry.proof == "equal"


@pytest.mark.timeout(300)
def test_pieces_of_the_editors_menu_are_part_of_a_level_by_their_names(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
    file, names = tmp_path / "mine.scene.json", PIECE_MENUS["Game"][1]

    async def put_and_save() -> None:
        async with hosted(LEVELS["meadow"], tmp_path / "times") as referee, editing(referee) as model:
            placing = AssetPlacing(model)
            for number, name in enumerate(names):
                done = await placing.place(piece_file("Game", name), np.array((20.0 * number, 50.0, 4.0)))
                assert done is not None, name
            await model.history.settle()
            await model.documents.save(file)

    asyncio.run(put_and_save())
    nodes = {node["prefab"]: node for node in json.loads(file.read_text())["entities"] if "prefab" in node}
    assert set(nodes) == {f"elys:game/{name.lower().replace(' ', '_')}.prefab.json" for name in names}
    assert nodes["elys:game/road_straight.prefab.json"]["components"]["Transform"]["position"][0] == 20.0
    level = SceneLevel.read(file, AssetStore())
    roads = [one for one in level.opened.records if one.name in names and "MeshRenderer" in one.components]
    assert len(roads) == 5


@pytest.mark.timeout(300)
def test_nobody_but_scripts_tells_how_a_race_goes(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with hosted(LEVELS["meadow"], tmp_path) as referee:
            await until(lambda: went(referee))
            for kind in HEARD:
                told = Tell(kind=kind, values={"player": 1, "time": 0.5, "medal": "gold", "what": "restart"})
                reply = await referee._node.put(CommandRequest(origin="test", command=told))
                assert not reply.accepted and "scripts of this session alone" in reply.reason
            await ask(referee, Tell(kind="cheered", values={"player": 1}))
            assert referee.attempt is not None and not referee.attempt.finished

    asyncio.run(scenario())


@pytest.mark.timeout(300)
def test_a_level_whose_scripts_tell_nonsense_is_raced_in_all_the_same(tmp_path: Path, caplog) -> None:
    nonsense = [
        Event(kind="race_gate", values={"player": [1], "time": 1.0}),
        Event(kind="race_finished"),
        Event(kind="race_finished", values={"player": 1, "time": -1.0}),
        Event(kind="race_finished", values={"player": 7, "time": 1.0}),
        Event(kind="race_paused"),
        Event(kind="race_resumed", values={"held": "long"}),
        Event(kind="race_wanted", values={"what": "finished"}),
        Event(kind="race_wanted", values={"what": "level", "name": ("meadow",)}),
    ]

    async def scenario() -> None:
        async with hosted(LEVELS["meadow"], tmp_path) as referee:
            await until(lambda: went(referee))
            attempt, simulation = referee.attempt, referee._node.simulation
            with caplog.at_level(logging.WARNING):
                simulation.scripts.hear(nonsense)
                await until(lambda: "race_resumed of" in caplog.text)
            assert attempt is not None and not attempt.finished
            referee._wishes.put_nowait(("restart", {}))
            await until(lambda: referee.attempt is not attempt and went(referee))
            assert referee.races == 0

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("times", "place", "expected"),
    [
        ({1: 31.236}, 3, "31.24 s, silver medal, place 3"),
        ({1: 31.236}, 0, "31.24 s, silver medal, not among the 10 fastest"),
        ({1: 33.0, 2: 29.5, 3: 40.25}, 1, "P2  29.50 s   P1  33.00 s   P3  40.25 s"),
    ],
)
def test_how_a_race_went_is_a_line_for_the_menu(times: dict[int, float], place: int, expected: str) -> None:
    attempt = Attempt(recorder=None, players=len(times))  # type: ignore[arg-type]
    attempt.finished = {player: Finished(player=player, time=time, medal="silver") for player, time in times.items()}
    assert result_of(attempt, place) == expected


@pytest.mark.timeout(300)
def test_the_menu_after_a_race_says_how_it_went_and_that_of_the_next_race_does_not(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with hosted(LEVELS["meadow"], tmp_path, has_menu=True) as referee:
            await until(lambda: referee.attempt is not None)
            scripts, world = referee._node.simulation.scripts, referee._node.simulation.world

            def lines() -> list[str]:
                return [world.get(one, OverlayText).text for one in world.query(OverlayText).entities.tolist()]

            finished = Event(kind="race_finished", values={"player": 1, "time": 31.236, "medal": "bronze"})
            scripts.hear([finished])
            await until(lambda: "31.24 s, bronze medal, place 1" in lines())
            attempt = referee.attempt
            referee._wishes.put_nowait(("restart", {}))
            await until(lambda: referee.attempt is not attempt and went(referee))
            assert not any("31.24 s, bronze" in line for line in lines())

    asyncio.run(scenario())
