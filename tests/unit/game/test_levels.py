"""Each level can be finished: by a driver that has nothing but a gamepad's stick and button; and its clock is exact."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.common import scene_files, trust
from elys.common.assets.store import AssetStore
from elys.common.components import Script
from elys.common.errors import ElysError
from elys.game.bot import Bot
from elys.game.driver import Style
from elys.samples.game.levels import LEVELS
from elys.sim_node.scripts.reloading import ScriptFiles
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command
from elys.verbs.game import level_named

LIMIT = 75  # [s] of simulation


class Run:
    """A level driven to its end in this process: what was told, and where the balls were after each tick."""

    def __init__(
        self,
        name: str,
        *,
        players: int = 1,
        ticks: int = LIMIT * 60,
        gates: int = 99,
        by_shortcut: bool = False,
        style: Style | None = None,
        meanwhile: Callable[[Run], None] = lambda run: None,
    ) -> None:
        """Until so many gates were passed, or the finish; `meanwhile` is called before each tick."""
        assets = AssetStore()
        opened, layout = LEVELS[name].open(assets, players=players)
        layout = layout.by_shortcut() if by_shortcut else layout
        self.simulation = Simulation.load(opened, assets)
        bots = [Bot(self.simulation, layout, player=number + 1, style=style) for number in range(players)]
        balls = [self.simulation.scripts.named(f"Ball {number + 1}")[0] for number in range(players)]
        self.events: list[Any] = []
        self.paths: list[list[Any]] = []
        while self.simulation.tick < ticks and len(self.told("race_finished")) < players and not self.passed(gates):
            meanwhile(self)
            for bot in bots:
                for request in bot():
                    self.simulation.inputs.take(request.command)
            self.simulation.step()
            self.events += [(self.simulation.tick, event) for event in self.simulation.take_events()]
            self.paths.append([self.simulation.world.transforms.world_pose(ball)[0] for ball in balls])

    def passed(self, gates: int) -> bool:
        return len(self.told("race_gate")) >= gates

    def told(self, kind: str) -> list[Any]:
        return [event for _, event in self.events if event.kind == kind]


@pytest.mark.parametrize(("name", "gates"), [("meadow", 3), ("quarry", 3), ("skyline", 99)])
@pytest.mark.timeout(400)
def test_a_driver_passes_the_gates_in_their_order_and_the_clock_is_exact(name, gates):
    """That each level can be finished, and is proven, tests/process/test_game.py sees; skyline, without curbs, without a fall."""
    run = Run(name, gates=gates)
    assert not run.told("script")  # none failed
    passed = [event.values["number"] for event in run.told("race_gate")]
    assert passed == list(range(1, len(passed) + 1)) and len(passed) >= min(gates, 5)
    assert name != "skyline" or not run.told("ball_fell")
    for finished in run.told("race_finished"):
        assert finished.values["time"] == run.told("race_gate")[-1].values["time"]
        assert finished.values["medal"] in ("gold", "silver", "bronze")
    assert bool(run.told("race_finished")) == (name == "skyline")
    check_times(run)


def check_times(run: Run) -> None:
    """The clock at each gate against the crossing of its plane by the straight ways between the states."""
    world = run.simulation.world
    (go,) = [tick for tick, event in run.events if event.kind == "race_go"]
    path = np.array(run.paths)[:, 0]
    for tick, event in run.events:
        if event.kind != "race_gate":
            continue
        place, rotation, _ = world.transforms.world_pose(
            run.simulation.scripts.named(f"Gate {event.values['number']}")[0]
        )
        yaw = 2.0 * np.arctan2(rotation[1], rotation[3])
        along = np.array([-np.sin(yaw), 0.0, -np.cos(yaw)])
        # What scripts tell is told in the tick after.
        before, after = ((path[number] - place) @ along for number in (tick - 3, tick - 2))
        assert before < 0.0 <= after
        share = -before / (after - before)
        assert event.values["time"] == pytest.approx((tick - go + share) / 60.0, abs=2e-6)


@pytest.mark.parametrize("pace", [1.0, 0.85])
@pytest.mark.parametrize("name", [name for name in LEVELS if name != "meadow"])
@pytest.mark.timeout(400)
def test_a_board_saves_time_and_can_be_held(name, pace):
    """Both at full speed and by who takes care: to the gate behind it, without a fall."""
    times = {}
    for by_shortcut in (False, True):
        run = Run(name, gates=2, by_shortcut=by_shortcut, style=Style(pace=pace))
        assert not run.told("ball_fell")
        times[by_shortcut] = run.told("race_gate")[1].values["time"]
    assert times[True] < times[False] - 1.0


def test_only_levels_with_a_board_have_a_way_over_it():
    boards = {name: bool(level.open(AssetStore())[1].shortcut) for name, level in LEVELS.items()}
    assert boards == {"meadow": False, "quarry": True, "skyline": True}


def test_two_race_at_once_and_the_same_way_each_time():
    first, second = (Run("meadow", players=2, ticks=420) for _ in range(2))
    assert first.simulation.state_hash() == second.simulation.state_hash()
    players = {event.values["player"] for event in first.told("race_gate")}
    assert players == {1, 2}


@pytest.mark.timeout(400)
def test_a_script_that_is_saved_anew_goes_on_in_the_middle_of_a_race(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / "pieces"
    shutil.copytree(scene_files.PIECES_FOLDER, folder)
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setattr(scene_files, "PIECES_FOLDER", folder)
    trust.remember(folder)
    file, saved = folder / "game" / "ball.py", []
    broken = "class Ball(Behaviour:\n"

    def save(run: Run, text: str) -> None:
        world, files = run.simulation.world, ScriptFiles(run.simulation)
        file.write_text(text)
        ball = run.simulation.scripts.named("Ball 1")[0]
        command = files.reloaded(world.get(ball, Script).source, [ball])
        if command is not None:
            apply_command(run.simulation, command)
        saved.append((run.simulation.tick, command is not None))

    def meanwhile(run: Run) -> None:
        gates = len(run.told("race_gate"))
        if gates == 2 and not saved:
            save(run, broken)  # half a file: the version before goes on
        elif gates == 3 and len(saved) == 1:
            rolls = 'self.world.emit("rolled_anew"); self.roll(push * 0.97)'
            save(run, as_it_was.replace("self.roll(push)", rolls))

    as_it_was = file.read_text()
    run = Run("meadow", meanwhile=meanwhile)
    assert [is_new for _, is_new in saved] == [False, True]
    assert not run.told("script")
    (finished,) = run.told("race_finished")
    numbers = [event.values["number"] for event in run.told("race_gate")]
    assert numbers == list(range(1, len(numbers) + 1))  # the ball went on with what it remembered
    anew = [tick for tick, event in run.events if event.kind == "rolled_anew"]
    assert saved[1][0] < anew[0] <= saved[1][0] + 3 and len(anew) > 60
    assert 18.5 < finished.values["time"] < 30.0  # a little slower for what was saved
    check_times(run)


def test_an_unknown_level_names_those_there_are():
    with pytest.raises(ElysError, match="there is no level 'mars': there are meadow, quarry, skyline"):
        level_named("mars", AssetStore())
