"""The game as a program: races that are recorded, proven and raced against; its menu; and two who play from two processes."""

from __future__ import annotations

import asyncio
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from elys.bus import topics
from elys.bus.messages.commands import Input
from elys.bus.messages.ghosts import Ghost
from elys.bus.recording import Recording
from elys.samples.game.levels import LEVELS
from tests.process.clients import client

pytestmark = pytest.mark.process


@pytest.mark.timeout(900)
@pytest.mark.parametrize("level", list(LEVELS))
def test_a_driven_race_is_recorded_proven_and_raced_against(elys, tmp_path, environment, level):
    """Each level is finished by a driver; on the first a second race follows, against the ghost of the first."""
    environment["ELYS_GAME_DIR"] = str(tmp_path / "times")
    races = 2 if level == "meadow" else 1
    game = elys("game", level, "--bot", "--fast", "--races", str(races), "--name", "ann", "--json")
    assert game.wait(seconds=800) == 0, game.output
    entries = json.loads(game.output[game.output.index("[") :])
    assert [entry["proof"] for entry in entries] == ["equal"] * races, game.output
    first = entries[0]
    assert first["player"] == "ann" and first["medal"] in ("gold", "silver", "bronze")
    # A driver without nerves, who only begins on another tick.
    assert all(abs(entry["time"] - first["time"]) < 1.0 for entry in entries)
    with Recording(Path(first["recording"])) as recording:
        told = [event.kind for batch in events_of(recording) for event in batch.events]
        assert told.count("race_finished") == 1 and told.count("race_go") == 1
        assert recording.time[-1] - recording.time[0] == pytest.approx(first["time"] + 1.5 + 2.0, abs=0.2)
    check_film(elys, Path(first["recording"]), tmp_path / "race.mp4")
    shown = elys("game", "--times", level)
    assert shown.wait() == 0
    assert "gold" in shown.output and "equal" in shown.output and "ann" in shown.output


def check_film(elys, recording: Path, film: Path) -> None:
    """A few pictures of a race in its middle: so many as were asked for, each of something, and of other moments."""
    width, height, count = 128, 72, 4
    words = ("--size", f"{width}x{height}", "--camera", "Camera 1", "--time", "6", "--duration", "2", "--fps", "2")
    render = elys("render", str(recording), "-o", str(film), *words)
    assert render.wait(seconds=300) == 0, render.output
    with av.open(str(film)) as opened:
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in opened.decode(video=0)]
    assert len(pictures) == count
    for picture in pictures:
        assert picture.shape == (height, width, 3)
        assert picture.std() > 15.0 and 20.0 < picture.mean() < 235.0  # neither one colour, nor night, nor glare
    for before, after in pairwise(pictures):
        assert np.abs(after - before).mean() > 2.0


def events_of(recording: Recording) -> list[Any]:
    from elys.bus.codec import decode_body
    from elys.bus.messages.session import EventBatch

    messages = recording.reader.messages([topics.EVENTS.name])
    return [decode_body(message.body, EventBatch, topics.EVENTS.encoding) for message in messages]


@pytest.mark.timeout(300)
def test_the_menu_begins_a_race_in_which_the_best_run_is_a_ghost(elys, tmp_path, environment, free_port):
    environment["ELYS_GAME_DIR"] = str(tmp_path / "times")
    first = elys("game", "meadow", "--bot", "--fast", "--no-ghosts", "--name", "ann")
    assert first.wait(seconds=280) == 0, first.output
    endpoint = f"tcp/127.0.0.1:{free_port}"
    host = elys("node", "race", "quarry", "--listen", endpoint, "--name", "bob", "--players", "2")
    host.wait_for("first tick")

    async def scenario() -> None:
        async with client(endpoint) as one, client(endpoint) as two:
            told: list[Any] = []
            ghosts: list[Ghost] = []
            one.session.subscribe(topics.EVENTS, lambda batch, _: told.extend(batch.events))
            one.session.subscribe(topics.GHOST, lambda ghost, _: ghosts.append(ghost))
            presses = {1: Presses(one, 1), 2: Presses(two, 2)}
            await one.until(lambda: "Row 3" in names_of(one))
            chosen = tmp_path / "times" / "settings.json"
            for key in ("s", "s", "s", "d"):  # down to the ghosts, and without them
                await presses[1].tap(key)
            await one.until(lambda: chosen.exists() and json.loads(chosen.read_text())["ghosts"] == "off")
            await presses[1].tap("a")
            await one.until(lambda: json.loads(chosen.read_text())["ghosts"] == "on")
            for key in ("w", "w", "w", "w", "space"):  # up to the first level, and go
                await presses[1].tap(key)
            await one.until(lambda: one.mirror.scene == "Meadow" and any(e.kind == "race_go" for e in told))
            await one.until(lambda: bool(ghosts))
            assert ghosts[0].title.startswith("ann ")
            before = {number: place_of(one, f"Ball {number}") for number in (1, 2)}
            for one_press in presses.values():
                one_press.hold("w")
            await one.until(lambda: all(place_of(one, f"Ball {n}")[2] < before[n][2] - 2.0 for n in (1, 2)))
            told.clear()
            await presses[1].tap("backspace")
            await one.until(lambda: any(e.kind == "race_go" for e in told))  # again, from the start

    asyncio.run(scenario())
    host.process.terminate()
    assert host.wait() == 0, host.output
    assert "Traceback" not in host.output
    races = [list((tmp_path / "times" / level).glob("*.mcap")) for level in ("meadow", "quarry")]
    assert [len(found) for found in races] == [1, 0]  # those that were left leave nothing behind


class Presses:
    """One player's keys."""

    def __init__(self, joined: Any, player: int) -> None:
        self._joined, self._player, self._sequence = joined, player, 0

    def hold(self, key: str, is_down: bool = True) -> None:
        self._sequence += 1
        session = self._joined.session
        command = Input(player=self._player, sequence=self._sequence, changes=((key, is_down),))
        session.publish(topics.INPUT, command, key=session.node.id)

    async def tap(self, key: str) -> None:
        """Down, for as long as a few states take, and up."""
        for is_down in (True, False):
            seen = len(self._joined.frames)
            self.hold(key, is_down)
            await self._joined.until(lambda seen=seen: len(self._joined.frames) > seen + 6)


def names_of(joined: Any) -> set[str]:
    return {entity.name for entity in joined.mirror.entities.values()}


def place_of(joined: Any, name: str) -> Any:
    (entity,) = (number for number, entity in joined.mirror.entities.items() if entity.name == name)
    frame = joined.frames[-1]
    return frame.position[list(frame.entity).index(entity)]


def test_what_cannot_be_is_said(elys, environment, tmp_path):
    environment["ELYS_GAME_DIR"] = str(tmp_path / "times")
    for words, said in (
        (("game", "mars", "--bot"), "there is no level 'mars': there are meadow, quarry, skyline"),
        (("game", "--fast"), "--fast leaves no time to play: give --bot as well"),
        (("game", "--times", "mars"), "there is no level 'mars'"),
    ):
        command = elys(*words)
        assert command.wait() != 0
        assert said in command.output.replace("\n", " ") and "Traceback" not in command.output
