"""What scripts can ask of the world: tweens, timers, prefabs, questions, gravity; each wound back in its middle."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from elys.common.assets.scripts import decode_script
from elys.common.components import Collider, Light, Material, RigidBody, Script, Transform
from elys.common.ids import Entity
from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument, SceneSettings, collapse, expand, read_script_file
from elys.sim_node.scene.loading import load_records
from elys.sim_node.scripts.easing import EASES, eased
from elys.sim_node.scripts.tweening import spin_between
from elys.sim_node.scripts.vector import Rotation
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from tests.unit.sim_node.scripts.conftest import Playground


def goes_on_the_same(play: Playground, watch: Callable[[], object], *, before: int, after: int) -> list[object]:
    """Runs, winds back into the middle through bytes, runs again: what is seen must be the same both times."""

    def on() -> list[object]:
        found = []
        for _ in range(after):
            play.run()
            found.append(watch())
        return found

    play.run(before)
    state = play.simulation.capture()
    first = on()
    play.simulation.restore(State.from_bytes(state.to_bytes()))
    assert on() == first
    return first


def test_any_field_that_has_values_between_two_can_be_tweened(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            async def start(self):
                await all_of(
                    self.entity.tween(components.Light, intensity=5.0, color=(1.0, 0.0, 0.5), duration=1.0, ease="linear"),
                    self.entity.tween("Transform", scale=(3.0, 1.0, 1.0), duration=0.5, ease="out"),
                )
                self.is_over = self.world.tick
        """,
    )
    thing = play.spawn(source, "Lamp", Light(kind="point", intensity=1.0, color=(0.0, 1.0, 0.5)))

    def seen() -> object:
        get = play.simulation.world.get
        return get(thing, Light).intensity, get(thing, Light).color, get(thing, Transform).scale

    seen_later = goes_on_the_same(play, seen, before=20, after=60)
    intensity, color, _ = seen_later[9]  # after 30 of 60 ticks
    assert intensity == pytest.approx(3.0) and color == pytest.approx((0.5, 0.5, 0.5))
    assert seen_later[-1] == (5.0, (1.0, 0.0, 0.5), (3.0, 1.0, 1.0))
    assert play.on(thing).is_over == 59
    assert seen_later[11][2] == (3.0, 1.0, 1.0)  # type: ignore[index]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("tween('Light', brightness=1.0, duration=1.0)", "brightness"),
        ("tween('Light', kind='spot', duration=1.0)", "TypeError: Light.kind cannot be tweened: it is a choice"),
        ("tween('Light', intensity='much', duration=1.0)", "Light.intensity must be a number, not 'much'"),
        ("tween('Collider', radius=1.0, duration=1.0)", "has no Collider"),
        ("tween('Light', duration=1.0)", "takes the fields that shall change"),
        (
            "tween('Light', intensity=1.0, duration=-1.0)",
            "a duration is a finite number of seconds, 0 or more, not -1.0",
        ),
        ("move_to((0, 0, 0), duration=1.0, ease='jumpy')", "there is no ease 'jumpy'; there are linear, smooth"),
    ],
)
def test_what_cannot_be_tweened_says_why_where_it_is_asked_for(play: Playground, call: str, said: str) -> None:
    source = play.write("a.py", f"class A(Behaviour):\n    async def start(self):\n        await self.entity.{call}")
    thing = play.spawn(source, "Lamp", Light())
    play.run()
    failure = play.failure(thing)
    assert said in failure and "a.py:5" in failure


@pytest.mark.parametrize("ease", EASES)
def test_eases_begin_at_0_end_at_1_and_leap_nowhere(ease: str) -> None:
    shares = np.linspace(0.0, 1.0, 1001)
    values = np.array([eased(share, ease) for share in shares])
    assert values[0] == pytest.approx(0.0, abs=1e-12) and values[-1] == pytest.approx(1.0, abs=1e-12)
    assert np.abs(np.diff(values)).max() < 0.01
    assert ease == "back" or values.max() <= 1.0 + 1e-12


def test_a_spin_of_one_tick_is_the_rotation_vector(play: Playground) -> None:
    generator = np.random.default_rng(5)
    for _ in range(50):
        axis = generator.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = generator.uniform(0.0, 0.5)
        start = Rotation(quaternion.from_axis_angle(axis[::-1], 2.0).tolist())
        goal = Rotation(quaternion.multiply(quaternion.from_axis_angle(axis, angle), start).tolist())
        assert spin_between(start, goal, 1 / 60) == pytest.approx(60 * angle * axis, abs=1e-3 * angle)


def test_what_rides_a_kinematic_body_that_turns_is_carried_round(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            async def start(self):
                quarter = Rotation.about((0, 1, 0), 1.5707963267948966)
                await self.entity.rotate_to(quarter * self.entity.rotation, duration=2.0)
        """,
    )
    disc = play.spawn(source, "Disc", RigidBody(motion="kinematic"), Collider(size=(6.0, 0.5, 6.0), friction=1.0))
    box = play.simulation.world.spawn(
        [Transform(position=(2.0, 0.75, 0.0)), RigidBody(), Collider(friction=1.0)], name="Box"
    )

    def seen() -> object:
        return [play.simulation.world.get(entity, Transform) for entity in (disc, Entity(box))]

    goes_on_the_same(play, seen, before=50, after=90)
    quarter = math.sqrt(0.5)
    assert play.simulation.world.get(disc, Transform).rotation == pytest.approx((0.0, quarter, 0.0, quarter), abs=1e-6)
    assert play.simulation.world.get(disc, RigidBody).angular_velocity == (0.0, 0.0, 0.0)
    assert play.simulation.world.get(box, Transform).position == pytest.approx((0.0, 0.75, -2.0), abs=0.05)


def test_timers_call_methods_at_the_ticks_that_seconds_mean(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                self.calls = []
                self.every(0.11, self.often)
                self.after(0.5, self.once, "done")
            def often(self):
                self.calls.append(self.world.tick)
                return len(self.calls) < 9
            async def once(self, text):
                await ticks(2)
                self.calls.append(text)
        """,
    )
    thing = play.spawn(source)  # 0.11 s are 6.6 ticks: by the whole, so that nothing adds up
    goes_on_the_same(play, lambda: list(play.on(thing).calls), before=15, after=80)
    assert play.on(thing).calls == [7, 13, 20, 26, "done", 33, 40, 46, 53]


def test_timers_keep_to_seconds_where_another_tick_rate_begins(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                self.times = []
                self.every(0.5, self.often)
            def often(self):
                self.times.append(self.world.time)
        """,
    )
    thing = play.spawn(source)
    for rate, count in ((60, 70), (240, 480)):
        play.simulation.change_settings(SceneSettings(tick_rate=rate))
        play.run(count)
    times = play.on(thing).times
    assert times.pop(2) < 1.5  # who waits when a rate ends waits for as many ticks of the next
    assert times == pytest.approx([0.5, 1.0, 2.0, 2.5, 3.0], abs=1e-9)


def test_timers_take_methods_of_the_script_alone(play: Playground) -> None:
    source = play.write("a.py", "class A(Behaviour):\n    def start(self): self.every(1.0, lambda: None)")
    thing = play.spawn(source)
    play.run()
    assert "a.py:4: TypeError: every() takes a method of the script itself" in play.failure(thing)


CRATE = {
    "elys_scene": 1,
    "entities": [
        {
            "name": "Crate",
            "components": {
                "Transform": {"scale": [2, 1, 1]},
                "RigidBody": {},
                "Collider": {},
                "MeshRenderer": {"mesh": "box"},
            },
            "children": [{"name": "Label", "components": {"Transform": {}, "Material": {"roughness": 0.9}}}],
        }
    ],
}


def write_prefab(play: Playground, name: str, content: dict[str, Any]) -> None:
    (play.folder / name).write_text(json.dumps(content))


def test_prefabs_are_spawned_with_what_is_laid_over_them_and_go_with_the_script(play: Playground) -> None:
    write_prefab(play, "crate.prefab.json", CRATE)
    play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                self.every(0.1, self.drop)
            def drop(self):
                crate = self.world.spawn_prefab(
                    "crate.prefab.json", name=f"Crate {self.world.tick}", position=(self.random.random(), 5, 0),
                    components={"RigidBody": {"mass": 3.0}}, overrides={"Label": {"Material": {"roughness": 0.2}}})
                crate.velocity = (0, 1, 0)
        """,
    )
    source = read_script_file(play.folder / "a.py", "", play.assets)
    (play.folder / "crate.prefab.json").unlink()  # it came along: nothing is read while time goes on
    play.spawn(source)
    world = play.simulation.world

    def seen() -> object:
        return [
            (world.hierarchy.name_of(Entity(entity)), *world.components_of(Entity(entity)))
            for entity in world.entities().tolist()
        ]

    goes_on_the_same(play, seen, before=20, after=40)
    crate = world.hierarchy.find("Crate 12")
    assert world.get(crate, RigidBody).mass == 3.0
    assert world.get(crate, Transform).scale == (2.0, 1.0, 1.0)
    assert world.get(world.hierarchy.find("Crate 12/Label"), Material).roughness == pytest.approx(0.2)
    assert len(play.simulation.scripts.named("Crate 60")) == 0 and len(play.simulation.scripts.named("Crate 54")) == 1


def test_a_scene_gives_a_script_the_prefab_of_its_field_and_is_written_again_as_it_was(play: Playground) -> None:
    write_prefab(play, "crate.prefab.json", CRATE)
    play.write(
        "a.py",
        """
        class A(Behaviour):
            what: str = ""
            def start(self):
                self.world.spawn_prefab(self.what, position=(0, 5, 0))
        """,
    )
    values = {"source": "a.py#A", "values": {"what": "crate.prefab.json"}}
    document = SceneDocument(entities=[EntityNode(name="Maker", components={"Transform": {}, "Script": values})])
    records = expand(document, directory=play.folder, assets=play.assets)
    simulation = play.simulation
    load_records(simulation.world, records)
    play.run()
    assert simulation.world.get(simulation.world.hierarchy.find("Crate"), RigidBody).mass == 1.0
    written = collapse(records, name="", directory=play.folder, assets=play.assets, settings=document.settings)
    assert written.entities[0].components["Script"] == values


def test_a_script_in_the_prefab_that_it_spawns_is_itself(play: Playground) -> None:
    """What breaks in two, and its halves again: content cannot hold itself, so the prefab names its carrier."""
    write_prefab(
        play,
        "half.prefab.json",
        {
            "elys_scene": 1,
            "entities": [{"name": "Half", "components": {"Transform": {}, "Script": {"source": "a.py#A"}}}],
        },
    )
    play.write(
        "a.py",
        """
        class A(Behaviour):
            generation: int = 0
            def start(self):
                if self.generation < 3:
                    for side in (-1, 1):
                        half = self.world.spawn_prefab("half.prefab.json", position=(side, 0, 0), components={
                            "Script": {"values": {"generation": self.generation + 1}}})
        """,
    )
    play.spawn(read_script_file(play.folder / "a.py", "A", play.assets), "First")
    play.run(6)
    world = play.simulation.world
    found = [world.get(Entity(entity), Script).values.get("generation", 0) for entity in world.entities().tolist()]
    assert sorted(found) == [0] + [1] * 2 + [2] * 4 + [3] * 8


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("spawn_prefab('no.prefab.json')", "there is no prefab 'no.prefab.json' with the script, which brings"),
        ("spawn_prefab('bad.prefab.json')", "there is no prefab 'bad.prefab.json' with the script"),
        (
            "spawn_prefab('crate.prefab.json', overrides={'Labl': {}})",
            "the prefab has nobody at 'Labl'; did you mean 'Label'?",
        ),
        ("spawn_prefab('crate.prefab.json', components={'RigidBody': {'mass': -1.0}})", "mass must be at least"),
        ("spawn_prefab('crate.prefab.json', components={'Nothing': {}})", "Nothing"),
    ],
)
def test_prefabs_that_cannot_be_spawned_say_what_is_missing(
    play: Playground, call: str, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    write_prefab(play, "crate.prefab.json", CRATE)
    (play.folder / "bad.prefab.json").write_text("{")
    play.write("a.py", f"class A(Behaviour):\n    def start(self):\n        self.world.{call}")
    with caplog.at_level(logging.WARNING):
        thing = play.spawn(read_script_file(play.folder / "a.py", "", play.assets))
    if "bad" in call:
        assert "bad.prefab.json, which cannot be had" in caplog.text
    before = len(play.simulation.world.entities())
    play.run()
    assert said in play.failure(thing)
    assert len(play.simulation.world.entities()) == before


def test_a_bundle_without_prefabs_is_what_it_was(play: Playground) -> None:
    play.write("a.py", "class A(Behaviour): pass")
    source = read_script_file(play.folder / "a.py", "A", play.assets)
    assert b"prefabs" not in play.assets.get(source)
    assert decode_script(play.assets.get(source)).prefabs == {}


def test_questions_and_gravity(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                world = self.world
                self.box = [found.name for found in world.overlap_box((0, 0, 0), (4, 1, 1))]
                self.ball = world.cast_sphere((0, 5, 0), (0, -1, 0), 0.25)
                self.near = world.closest_point((1.5, 0.0, 0.0))
                world.gravity = (0.0, 2.0, 0.0)
        """,
    )
    thing = play.spawn(source)
    block = play.simulation.world.spawn([Transform(), Collider(), RigidBody()], name="Block")
    play.simulation.world.spawn([Transform(position=(9.0, 0.0, 0.0)), Collider()], name="Far")
    play.simulation.settle()
    state = play.simulation.capture()
    play.run(60)
    one = play.on(thing)
    assert one.box == ["Block"]
    assert (one.ball.entity.id, one.ball.distance) == (block, pytest.approx(4.25))
    assert one.near.point == pytest.approx((0.5, 0.0, 0.0)) and one.near.distance == pytest.approx(1.0)
    assert play.simulation.settings.gravity == (0.0, 2.0, 0.0)
    fallen = play.simulation.world.get(block, RigidBody).linear_velocity[1]
    assert fallen == pytest.approx(2.0, rel=0.01)
    play.simulation.restore(state)
    assert play.simulation.settings.gravity == Simulation().settings.gravity
    play.run(60)
    assert play.simulation.world.get(block, RigidBody).linear_velocity[1] == fallen
