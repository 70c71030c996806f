"""A script that holds time: nothing moves, nobody else is called, what was told is heard later; wound back; when it fails."""

from __future__ import annotations

import dataclasses

import pytest

from elys.bus.messages.commands import Despawn, LoadScene, SetSettings
from elys.common.components import Collider, RigidBody, Script, Transform
from elys.common.errors import EntityError
from elys.common.ids import Entity
from elys.common.scene import SceneSettings
from elys.sim_node.scene.loading import records_of
from elys.sim_node.state import State
from elys.sim_node.systems.apply_edits import apply_edits, load_scene
from tests.unit.sim_node.scripts.conftest import Playground

COUNTS = """
    class Counts(Behaviour):
        def start(self):
            self.early = self.late = self.rang = 0
            self.heard = []
            self.every(0.1, self.ring)

        def ring(self):
            self.rang += 1
            self.at = self.world.time

        def fixed_update(self, dt):
            self.early += 1

        def update(self, dt):
            self.late += 1

        def on_event(self, event):
            if event.kind == "said":
                self.heard.append(event.values["number"])
"""
HOLDS = """
    class Holds(Behaviour):
        first: int = 30
        last: int = 60

        def start(self):
            self.steps = 0

        def fixed_update(self, dt):
            self.steps += 1
            if self.steps == self.first:
                self.world.hold(self)
                self.world.emit("said", number=1)
            if self.steps == self.first + 5:
                self.world.emit("said", number=2)
            if self.steps == self.last:
                self.world.let_go()
                self.world.emit("said", number=3)
"""


PUSHES = """
    class Pushes(Behaviour):
        holds: bool = False

        def start(self):
            self.steps = 0

        def fixed_update(self, dt):
            self.steps += 1
            self.entity.apply_force((3.0, 0.0, 0.0))
            if self.holds and self.steps == 10:
                self.world.hold(self)
            if self.holds and self.steps == 30:
                self.world.let_go()

        def update(self, dt):
            self.entity.apply_torque((0.0, 0.5, 0.0))
"""


def thrown(play: Playground, **values: int) -> tuple[int, int, int]:
    """A ball that flies, one who counts, and one who holds time from step 31 to 60."""
    ball = play.simulation.world.spawn(
        [
            Transform(position=(0.0, 50.0, 0.0)),
            RigidBody(linear_velocity=(3.0, 4.0, 0.0), angular_velocity=(0.0, 9.0, 0.0)),
            Collider(shape="sphere"),
        ],
        name="Ball",
    )
    counts = play.spawn(play.write("counts.py", COUNTS), "Counts")
    holds = play.spawn(play.write("holds.py", HOLDS), "Holds", **values)
    return ball, counts, holds


def test_nothing_moves_and_nobody_else_is_called_while_time_is_held(play: Playground) -> None:
    ball, counts, holds = thrown(play)
    simulation = play.simulation
    play.run(30)
    before, hash_before = simulation.world.get(ball, RigidBody), simulation.state_hash()
    place = simulation.world.get(ball, Transform).position
    play.run(30)
    assert simulation.is_held and simulation.tick == 60
    assert simulation.world.get(ball, RigidBody) == before and simulation.state_hash() == hash_before
    assert simulation.world.get(ball, Transform).position == place
    counting = play.on(counts)
    assert (counting.early, counting.late, play.on(holds).steps) == (30, 30, 60)
    assert counting.world.time == pytest.approx(0.5) and counting.world.held_time == pytest.approx(0.5)
    play.run(30)
    assert not simulation.is_held and (counting.early, counting.late) == (60, 60)
    assert counting.rang == 9  # of its own second, in which half a second was not counted
    assert counting.heard == [1, 2, 3]


def test_it_goes_on_as_if_nobody_had_held_it(play: Playground, tmp_path) -> None:
    thrown(play)
    play.run(130)
    simulation = play.simulation
    (tmp_path / "other").mkdir()
    other = Playground(play.folder)
    thrown(other, first=-1, last=-1)
    other.run(100)
    assert simulation.state_hash() == other.simulation.state_hash()


def test_what_pushes_on_in_held_steps_pushes_no_harder_afterwards(play: Playground) -> None:
    """Forces before and after physics, of the step that asked for it as well."""
    ran = []
    for holds in (False, True):
        each = Playground(play.folder)
        pusher = each.spawn(each.write("pushes.py", PUSHES), "Pusher", RigidBody(), Collider(), holds=holds)
        each.simulation.settle()  # it has a body from the first step on
        each.run(50 if holds else 30)
        ran.append((each.simulation.state_hash(), each.simulation.world.get(pusher, RigidBody)))
    assert ran[0] == ran[1]
    assert ran[0][1].linear_velocity[0] > 0.0


@pytest.mark.parametrize("before", [30, 45, 59, 60, 61])
def test_a_state_from_the_middle_of_a_hold_goes_on_the_same(play: Playground, before: int) -> None:
    _, counts, _ = thrown(play)
    simulation = play.simulation

    def seen() -> tuple[object, ...]:
        counting = play.on(counts)
        return simulation.state_hash(), counting.early, counting.rang, counting.heard[:], counting.world.time

    play.run(before)
    state = State.from_bytes(simulation.capture().to_bytes())
    play.run(50)
    first = seen()
    simulation.restore(state)
    play.run(50)
    assert seen() == first


@pytest.mark.parametrize("how", ["fails", "is switched off", "is gone", "tells without end"])
def test_time_goes_on_where_the_one_who_holds_it_cannot_let_go(play: Playground, how: str) -> None:
    _, counts, _ = thrown(play, first=-1, last=-1)
    source = play.write(
        "stuck.py",
        """
        class Stuck(Behaviour):
            how: str = ""

            def start(self):
                self.world.hold(self)
                self.steps = 0

            def fixed_update(self, dt):
                self.steps += 1
                if self.steps == 10 and self.how == "fails":
                    raise ValueError("no")
                if self.how == "tells without end":
                    for number in range(2000):
                        self.world.emit("noise", number=number)
                if self.steps == 10 and self.how == "is gone":
                    self.entity.destroy()
                if self.steps == 10 and self.how == "is switched off":
                    self.entity.set("Script", enabled=False)
        """,
    )
    play.spawn(source, "Stuck", how=how)
    play.run(40)
    assert not play.simulation.is_held and not play.on(counts).world.is_held
    assert 25 <= play.on(counts).early < 40


def test_who_is_called_in_no_held_step_cannot_hold_time(play: Playground) -> None:
    _, counts, _ = thrown(play, first=-1, last=-1)
    source = play.write(
        "asks.py",
        """
        class Asks(Behaviour):
            async def start(self):
                self.world.hold(self)
                await seconds(0.1)
                self.world.let_go()
        """,
    )
    asks = play.spawn(source, "Asks")
    play.run(20)
    assert "Asks cannot hold time: it has no fixed_update and no update" in play.failure(asks)
    assert not play.simulation.is_held and play.on(counts).early == 20


def test_a_holder_whose_file_loses_the_hook_that_lets_go_holds_no_more(play: Playground) -> None:
    _, counts, holds = thrown(play, last=-1)
    play.run(40)
    assert play.simulation.is_held
    changed = play.write("holds.py", "class Holds(Behaviour):\n    def on_input(self, player): self.world.let_go()\n")
    play.simulation.world.set(holds, Script(source=changed))
    play.run(10)
    assert not play.simulation.is_held and play.on(counts).early == 40


def test_what_was_missed_in_a_hold_is_not_told_to_the_next_scene(play: Playground) -> None:
    _, counts, _ = thrown(play)
    simulation = play.simulation
    play.run(40)
    assert simulation.is_held and simulation.scripts.hold.missed
    records = tuple(records_of(simulation.world, counts))
    held_time = play.on(counts).world.held_time
    (again,) = load_scene(simulation, LoadScene(name="next", records=records))
    assert not simulation.is_held
    play.run(5)
    counting = play.on(Entity(again))
    assert counting.early == 5 and counting.heard == []
    assert counting.world.held_time == held_time  # time does not jump


def test_who_comes_while_time_is_held_starts_when_it_goes_on(play: Playground) -> None:
    thrown(play)
    play.run(40)
    late = play.spawn(play.source("counts.py"), "Late")
    play.run(10)
    assert not hasattr(play.on(late), "early")
    play.run(20)
    assert play.on(late).early == 10


def test_a_state_of_before_time_could_be_held_can_be_gone_back_to(play: Playground) -> None:
    _, counts, _ = thrown(play, first=-1, last=-1)
    play.run(20)
    state = play.simulation.capture()
    older = dataclasses.replace(
        state, values={path: value for path, value in state.values.items() if path != "scripts/hold"}
    )
    assert len(older.values) == len(state.values) - 1
    play.run(5)
    play.simulation.restore(older)
    assert play.on(counts).early == 20 and not play.on(counts).world.is_held
    assert play.on(counts).world.held_time == 0.0


def test_another_tick_rate_that_is_refused_with_others_leaves_no_bit_of_time_behind(play: Playground) -> None:
    thrown(play)
    play.run(50)
    before = play.simulation.capture().to_bytes()
    with pytest.raises(EntityError):
        apply_edits(play.simulation, (SetSettings(settings=SceneSettings(tick_rate=7)), Despawn(entity=4_000_000)))
    assert play.simulation.capture().to_bytes() == before


def test_what_is_held_counts_in_seconds_of_each_tick_rate(play: Playground) -> None:
    thrown(play)
    play.run(40)  # ten of them held, at 60 Hz
    play.simulation.change_settings(SceneSettings(tick_rate=20))
    play.run(50)  # twenty of them held
    world = play.simulation.scripts.world
    assert world.held_time == pytest.approx(10 / 60 + 20 / 20, abs=1e-12)
    assert world.time == pytest.approx(30 / 60 + 30 / 20, abs=1e-12)
    assert play.simulation.time == pytest.approx(40 / 60 + 50 / 20, abs=1e-12)
