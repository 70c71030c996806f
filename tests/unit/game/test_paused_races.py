"""The menu in the middle of a race: alone, time stands and nothing is gained by it; with several, the race goes on."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus.messages.commands import Input
from elys.bus.messages.ghosts import UNTIL_TOLD, own_time
from elys.bus.recording import Recording
from elys.common.assets.store import AssetStore
from elys.common.components import Overlay, OverlayText
from elys.game.board import Board
from elys.game.bot import Bot
from elys.game.referee import AFTERGLOW, Referee
from elys.samples.game.levels import LEVELS
from elys.sim_node.simulation import Simulation
from tests.unit.game.hosted_races import STICKS_LET_GO, hosted, raced

PAUSED, RESUMED = 500, 620  # ticks


def hands(tick: int) -> tuple[str, ...] | None:
    """Opens the menu, looks around in it, and goes on."""
    if not PAUSED <= tick <= RESUMED + 1:
        return None
    pressed = {PAUSED: "p", PAUSED + 20: "s", PAUSED + 30: "w", RESUMED: "space"}
    return (pressed[tick],) if tick in pressed else ()


@pytest.mark.timeout(600)
def test_a_race_that_was_paused_is_finished_and_verifies(tmp_path: Path) -> None:
    asyncio.run(raced(LEVELS["meadow"], tmp_path, hands=hands))
    (paused,) = Board("meadow", tmp_path).entries
    assert paused.proof == "equal"
    ((start, length),) = paused.pauses
    assert length == pytest.approx((RESUMED - PAUSED) / 60.0, abs=0.02)
    with Recording(tmp_path / "meadow" / paused.file) as recording:
        inside = [place for place, time in enumerate(recording.time) if start - 1e-6 <= time <= start + length + 1e-6]
        assert len(inside) == round(length * 60.0) + 1
        frames = [recording.frame(place) for place in inside]
        before = recording.frame(inside[0] - 1)
        # From the countdown to two seconds after the finish, and what the clock did not count.
        whole = recording.time[-1] - recording.time[0]
        assert whole == pytest.approx(1.5 + paused.time + AFTERGLOW + length, abs=0.2)
    first = frames[1]  # what the camera's script did after the last free step is seen with the next one
    for frame in frames[1:]:
        assert np.array_equal(frame.position, first.position)
        assert np.array_equal(frame.linear_velocity, first.linear_velocity)
    assert np.abs(first.linear_velocity).max() > 5.0
    assert not np.array_equal(before.position, first.position)


@pytest.mark.timeout(600)
def test_a_pause_right_after_the_finish_takes_nothing_away(tmp_path: Path) -> None:
    """Nobody lets go of it: the recording ends inside."""
    referees: list[Referee] = []
    pressed: list[int] = []

    def press_at_the_finish(tick: int) -> tuple[str, ...] | None:
        attempt = referees[0].attempt if referees else None
        if attempt is None or not attempt.finished:
            return None
        pressed.append(tick)
        return ("p",) if len(pressed) == 1 else ()

    async def scenario() -> None:
        async with hosted(LEVELS["meadow"], tmp_path, hands=press_at_the_finish, races=1) as referee:
            referees.append(referee)
            await asyncio.wait_for(referee.judging, 300.0)  # type: ignore[attr-defined]
            assert referee._node.simulation.is_held

    asyncio.run(scenario())
    (entry,) = Board("meadow", tmp_path).entries
    assert entry.proof == "equal" and entry.pauses == ()
    with Recording(tmp_path / "meadow" / entry.file) as recording:
        assert recording.time[-1] >= entry.ended + 0.9


def test_nothing_is_gained_by_a_pause() -> None:
    """Bit for bit the same race, to the same times at its gates."""
    through, paused = Played(), Played()
    through.run(480)
    paused.run(200)
    for times in range(3):
        paused.key("p", True)
        paused.run(1)  # in which it was still driven
        assert not paused.simulation.is_held
        paused.away = {1}
        paused.key("p", False)
        paused.run(20 + times)
        assert paused.simulation.is_held
        paused.key("p", True)
        paused.run(1)
        paused.key("p", False)
        paused.away = set()
        paused.run(10)
    paused.run(480 - 200 - 33)
    assert paused.simulation.tick == 480 + 3 * 21 + sum(range(3))
    assert paused.simulation.state_hash() == through.simulation.state_hash()
    times_at_gates = [[e.values["time"] for e in game.told if e.kind == "race_gate"] for game in (through, paused)]
    assert times_at_gates[0] == times_at_gates[1] and times_at_gates[0]


class Played:
    """A level in this process, whose players press what a test says."""

    def __init__(self, *, players: int = 1, values: dict[str, Any] | None = None) -> None:
        assets = AssetStore()
        menu = {
            "levels": "meadow|Meadow||\nquarry|Quarry||",
            "level": "meadow",
            "settings": "ghosts|Ghosts|on|on,off",
            "players": players,
            **(values or {}),
        }
        opened, layout = LEVELS["meadow"].open(assets, players=players, values={"Menu": menu})
        self.simulation = Simulation.load(opened, assets)
        self.bots = {number: Bot(self.simulation, layout, player=number) for number in range(1, players + 1)}
        self.told: list[Any] = []
        self.away: set[int] = set()  # whose hands are not at the stick

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            for number, bot in self.bots.items():
                if number not in self.away:
                    for request in bot():
                        self.simulation.inputs.take(request.command)
            self.simulation.step()
            self.told += self.simulation.take_events()

    def key(self, name: str, is_down: bool) -> None:
        self.simulation.inputs.take(Input(player=1, changes=((name, is_down),), source="bot-1"))

    def press(self, key: str, *, player: int = 1) -> None:
        for is_down in (True, False):
            axes = STICKS_LET_GO
            self.simulation.inputs.take(
                Input(player=player, axes=axes, changes=((key, is_down),), source=f"bot-{player}")
            )
            self.run(2)

    def place(self, number: int = 1) -> Any:
        ball = self.simulation.scripts.named(f"Ball {number}")[0]
        return np.array(self.simulation.world.transforms.world_pose(ball)[0])

    def wanted(self) -> list[dict[str, Any]]:
        return [event.values for event in self.told if event.kind == "race_wanted"]

    def texts(self) -> list[str]:
        """What is written in the rows of the menu."""
        rows = self.simulation.scripts.world.find("Rows").children
        return [row.children[0].get(OverlayText).text for row in rows]

    @property
    def menu(self) -> Any:
        return self.simulation.scripts.world.find("Menu").get(Overlay)


@pytest.mark.parametrize(
    ("opens", "goes"), [("p", "space"), ("p", "p"), ("pad_start", "pad_a"), ("pad_start", "enter")]
)
def test_it_opens_and_goes_on_by_keyboard_and_gamepad(opens: str, goes: str) -> None:
    game = Played()
    game.run(200)
    game.away = {1}
    game.press(opens)
    assert game.menu.visible and game.simulation.is_held
    assert game.texts() == ["Go on", "Restart", "Meadow", "Quarry", "Ghosts", "Controls"]
    before = game.place()
    game.run(60)
    assert np.array_equal(game.place(), before)
    game.press(goes)
    assert not game.menu.visible and not game.simulation.is_held
    game.run(5)
    assert np.linalg.norm(game.place() - before) > 0.3
    assert not [event for event in game.told if event.kind == "ball_jumped"]  # what chose did not jump as well
    assert not game.wanted()
    game.away = set()
    game.press(opens)  # and again
    assert game.simulation.is_held


@pytest.mark.parametrize(
    ("downs", "key", "told"),
    [
        (1, "space", {"what": "restart", "player": 1}),
        (3, "enter", {"what": "level", "name": "quarry", "player": 1}),
        (4, "d", {"what": "setting", "name": "ghosts", "value": "off", "player": 1}),
    ],
)
def test_what_else_can_be_chosen_in_a_race(downs: int, key: str, told: dict[str, Any]) -> None:
    game = Played()
    game.run(150)
    game.away = {1}
    game.press("pad_start")
    for _ in range(downs):
        game.press("pad_dpad_down")
    game.press(key)
    game.run(2)
    assert game.wanted() == [told]
    assert game.simulation.is_held


def test_the_menu_asks_the_players_window_for_its_card_of_controls() -> None:
    game = Played()
    game.run(150)
    game.away = {1}
    game.press("pad_start")
    game.press("pad_dpad_up")  # from the first row to the last
    game.press("pad_a")
    game.run(2)
    assert [event.values for event in game.told if event.kind == "controls_wanted"] == [{"player": 1}]
    assert game.menu.visible and game.simulation.is_held and not game.wanted()


def test_a_countdown_waits_as_well() -> None:
    game = Played()
    game.run(40)
    game.press("p")
    game.run(200)
    game.press("p")
    assert not [event for event in game.told if event.kind == "race_go"]
    game.run(70)
    assert len([event for event in game.told if event.kind == "race_go"]) == 1


def test_with_several_players_the_menu_is_one_players_and_the_race_goes_on() -> None:
    game = Played(players=2)
    game.run(200)
    game.away = {2}
    game.press("p", player=2)
    assert game.menu.visible and game.menu.player == 2 and not game.simulation.is_held
    before = [game.place(number) for number in (1, 2)]
    game.press("w", player=2)  # which chooses, and does not drive
    game.run(60)
    after = [game.place(number) for number in (1, 2)]
    assert np.linalg.norm(after[0] - before[0]) > 5.0  # who drives drives on
    assert np.linalg.norm(after[1] - before[1]) > 0.0  # and the other's ball rolls out
    game.press("p", player=2)
    assert not game.menu.visible


def test_ghosts_wait_with_who_waits_and_pass_over_where_they_waited_themselves() -> None:
    waits, leaves_out = ((10.0, 2.0), (15.0, 1e9)), ((103.0, 4.0),)
    times = {at: own_time(at, 100.0 - 5.0, waits, leaves_out) for at in (5.0, 8.0, 9.0, 10.0, 11.0, 12.0, 15.0, 40.0)}
    assert times == {
        5.0: 100.0,
        8.0: 103.0,
        9.0: 108.0,
        10.0: 109.0,
        11.0: 109.0,
        12.0: 109.0,
        15.0: 112.0,
        40.0: 112.0,
    }


def test_a_ghost_is_where_it_was_at_the_same_time_of_the_race() -> None:
    """The ghost of a paused run, and a run that is paused, at the clock's times: as those that nobody paused."""
    began, entry_began = 3.0, 2.0
    live = ((6.0, 2.0),)  # at 3 s of the clock
    entry = ((4.0, 5.0),)  # at 2 s
    for clock in (0.5, 1.9, 2.1, 2.9, 3.1, 9.0):
        session = began + clock + (2.0 if clock > 3.0 else 0.0)
        recorded = entry_began + clock + (5.0 if clock > 2.0 else 0.0)
        assert own_time(session, entry_began - began, live, entry) == pytest.approx(recorded)
    assert own_time(100.0, entry_began - began, ((6.0, UNTIL_TOLD),), entry) == pytest.approx(entry_began + 3.0 + 5.0)
