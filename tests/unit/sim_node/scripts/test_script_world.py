"""What scripts find in the world, what players do to them, what they log, and that what they wait for ends with their entity."""

from __future__ import annotations

import logging

import pytest

from elys.bus.messages.commands import Input
from elys.common.components import Collider, Light, RigidBody, Transform
from elys.common.ids import Entity
from tests.unit.sim_node.scripts.conftest import Playground

PLAYS = """
class Plays(Behaviour):
    def start(self): self.heard = []
    def on_input(self, player):
        done = self.world.input(player)
        self.heard.append((self.world.tick, player, done.action("jump").was_pressed, round(done.vector("move").x, 3)))
"""


def test_on_input_is_called_for_each_player_who_does_or_holds_something(play: Playground) -> None:
    thing = play.spawn(play.write("a.py", PLAYS))
    play.run(2)
    one = play.on(thing)
    assert one.heard == []  # nobody does anything
    inputs = play.simulation.inputs
    inputs.take(Input(player=3, changes=(("space", True), ("space", False))))
    inputs.take(Input(player=1, changes=(("d", True),)))
    play.run()
    assert one.heard == [(2, 1, False, 1.0), (2, 3, True, 0.0)]
    play.run()
    assert one.heard[2:] == [(3, 1, False, 1.0)]  # the one who holds a key
    inputs.take(Input(player=1, changes=(("d", False),)))
    play.run(3)
    assert {tick for tick, *_ in one.heard[3:]} <= {4}


def test_on_input_may_be_async_and_is_begun_anew_for_each_call(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self): self.over = []
            async def on_input(self, player):
                await ticks(2)
                self.over.append((player, self.world.tick))
        """,
    )
    thing = play.spawn(source)
    play.run(1)
    play.simulation.inputs.take(Input(player=2, changes=(("space", True),)))
    play.run(2)
    play.simulation.inputs.take(Input(player=2, changes=(("space", False),)))
    play.run(5)
    assert play.on(thing).over[:2] == [(2, 3), (2, 4)]


TICKS_ON = """
said = []
class A(Behaviour):
    async def start(self):
        self.begin(self.beside())
        self.every(1 / 60, self.again)
        await all_of(self.inner(), seconds(9))
    async def inner(self):
        while True:
            said.append("inner")
            await ticks(1)
    async def beside(self):
        try:
            while True:
                said.append("beside")
                await ticks(1)
        finally:
            said.append("finally")
    def again(self): said.append("again")
    def on_destroy(self): said.append("destroyed")
"""


@pytest.mark.parametrize("way", ["script", "parent", "command", "component", "disabled"])
def test_async_functions_are_cancelled_with_their_entity(play: Playground, way: str) -> None:
    parent = play.simulation.world.spawn([Transform()], name="Parent")
    source = play.write("a.py", TICKS_ON)
    thing, other = play.spawn(source, "Thing"), play.spawn(source, "Other")
    play.simulation.world.set_parent(thing, parent)
    play.run(3)
    scripts = play.simulation.scripts
    modules = scripts.library.load(source).modules.loaded()
    said = next(vars(module)["said"] for module in modules if "said" in vars(module))
    assert len(scripts._running[thing].tasks) == 3
    match way:
        case "script":
            play.on(thing).entity.destroy()
        case "parent":
            scripts.destroy_later(Entity(parent))
        case "command":
            play.simulation.world.despawn(thing)
        case "component":
            play.simulation.world.remove(thing, "Script")
        case "disabled":
            play.simulation.world.set_enabled(thing, False)
    play.run()
    said.clear()
    play.run(3)
    assert sorted(said) == sorted(
        ["beside", "again", "inner"] * 3
    )  # the other's, and nothing of the one that is gone: no `finally` either
    assert len(scripts._running[other].tasks) == 3
    if way == "disabled":
        play.simulation.world.set_enabled(thing, True)
        said.clear()
        play.run(3)
        assert sorted(said) == sorted(["beside", "again", "inner"] * 6)  # it goes on where it stood
    else:
        assert thing not in scripts._running


def test_entities_are_found_by_name_and_components_in_the_order_of_the_tree_and_of_ids(play: Playground) -> None:
    world = play.simulation.world
    lamps = [world.spawn([Transform(), Light()], name="Lamp") for _ in range(3)]
    below = world.spawn([Transform(), Light(), RigidBody()], name="Lamp", parent=lamps[0])
    world.set_enabled(lamps[2], False)
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                world = self.world
                self.lamps = [found.id for found in world.find_all("Lamp")]
                self.none = world.find_all("lamp")
                self.first = world.find("Lamp").id
                self.lights = [found.id for found in world.with_component(components.Light)]
                self.both = [found.id for found in world.with_component(components.RigidBody, components.Light)]
                self.sounds = world.with_component(components.Camera)
        """,
    )
    thing = play.spawn(source)
    play.run()
    one = play.on(thing)
    assert one.lamps == [lamps[0], below, lamps[1], lamps[2]]  # those below one come before the next
    assert one.first == lamps[0] and one.none == [] and one.sounds == []
    assert one.lights == sorted([*lamps, below]) and one.both == [below]  # those switched off too


def test_a_ball_finds_all_colliders_that_share_a_point_with_it_once_each(play: Playground) -> None:
    world = play.simulation.world
    near = world.spawn([Transform(position=(2.0, 0.0, 0.0)), Collider(size=(1.0, 1.0, 1.0))], name="Near")
    world.spawn([Transform(position=(5.0, 0.0, 0.0)), Collider(size=(1.0, 1.0, 1.0))], name="Far")
    ball = world.spawn([Transform(position=(0.0, 3.0, 0.0)), Collider(shape="sphere", radius=1.0)], name="Ball")
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def update(self, dt):
                found = self.world.overlap_sphere
                self.found = [sorted(one.id for one in found((0, 0, 0), radius)) for radius in (1.4, 1.6, 1.9, 2.1)]
        """,
    )
    thing = play.spawn(source)
    play.run(2)
    assert play.on(thing).found == [[], [near], [near], sorted([near, ball])]


def test_what_a_script_logs_has_its_level_and_its_entity(play: Playground, caplog: pytest.LogCaptureFixture) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                self.log("it begins")
                self.log("it leaks", level="warning")
                self.log("it burns", level="error")
                self.log("it sings", level="loud")
        """,
    )
    thing = play.spawn(source, "Boiler")
    with caplog.at_level(logging.INFO, logger="elys.script"):
        play.run()
    told = [(record.levelname, record.getMessage()) for record in caplog.records if record.name == "elys.script"]
    name = f"entity {thing} 'Boiler'"
    assert told == [("INFO", f"{name}: it begins"), ("WARNING", f"{name}: it leaks"), ("ERROR", f"{name}: it burns")]
    assert "a.py:9: ValueError: log() takes the levels info, warning, error, not 'loud'" in play.failure(thing)
