"""Markers of clips as events: once a pass, to whom, and in which order; and what scripts ask of clips."""

from __future__ import annotations

from typing import Any

import pytest

from elys.bus.messages.session import Event
from elys.common.assets.clip import Clip, encode_clips
from elys.common.components import Animation, AnimationBlend, AnimationMarkers, RootMotion, Script, Transform
from elys.common.ids import Entity
from tests.unit.sim_node.animation.stage import HIPS, Puppet, track
from tests.unit.sim_node.scripts.conftest import Playground, play

__all__ = ["play"]

WALK = Clip(name="Walk", channels=(track(HIPS, [(0, 1, 0), (0, 1, -1)]),))
JUMP = Clip(name="Jump", channels=(track(HIPS, [(0, 1, 0), (0, 2, 0)], duration=0.5),))
MARKERS = AnimationMarkers(markers="Walk: left 0.25, right 0.75; Jump: off 0.0, land 0.5; nod 0.41")


def told(puppet: Puppet, ticks: int) -> list[tuple[int, str]]:
    """Which markers were told after which tick."""
    found = []
    for tick in range(1, ticks + 1):
        puppet.run()
        found += [(tick, event.kind) for event in puppet.simulation.take_events()]
    return found


def test_markers_are_events_of_the_tick_that_passes_them() -> None:
    puppet = Puppet(WALK, JUMP, more=(MARKERS,))
    assert told(puppet, 100) == [
        (tick + 1, name)  # events go over the bus with the tick after
        for tick, name in ((13, "left"), (21, "nod"), (38, "right"), (63, "left"), (71, "nod"), (88, "right"))
    ]


def test_an_event_says_which_clip_and_who_plays_it() -> None:
    puppet = Puppet(JUMP, more=(MARKERS,), loop="once")
    puppet.run(2)
    (event,) = puppet.simulation.take_events()
    assert event == Event(kind="off", entity=puppet.player, other=puppet.player, values={"clip": "Jump", "time": 0.0})
    assert [name for _, name in told(puppet, 60)] == ["nod", "land"]


@pytest.mark.parametrize(("speed", "expected"), [(3.0, "left nod right"), (-3.0, "right nod left")])
def test_each_pass_tells_once_at_any_speed(speed: float, expected: str) -> None:
    for factor in (1, 7, 50):
        puppet = Puppet(WALK, JUMP, more=(MARKERS,), speed=speed * factor)
        names = [name for _, name in told(puppet, 1 + 200 // factor)]
        rounds = 12 if factor != 7 else len(names) // 3
        assert names[: 3 * rounds] == expected.split() * rounds
        assert len(names) == pytest.approx(3 * abs(speed) * factor * (200 // factor) / 50, abs=3)


def test_of_a_mix_the_heaviest_clip_tells() -> None:
    puppet = Puppet(WALK, JUMP, more=(MARKERS, AnimationBlend(mix="Walk 1, Jump 3")))
    names = {name for _, name in told(puppet, 200)}
    assert names == {"off", "nod", "land"}


def test_a_clip_that_fades_out_tells_no_more() -> None:
    puppet = Puppet(WALK, JUMP, more=(MARKERS,), fade=5.0)
    puppet.run()
    puppet.set(clip="Jump", loop="once", time=0.0)
    assert [name for _, name in told(puppet, 100)] == ["off", "nod", "land"]


def test_paused_it_tells_nothing() -> None:
    puppet = Puppet(WALK, more=(MARKERS,), playing=False, time=0.25)
    assert told(puppet, 20) == []
    puppet.set(playing=True)
    assert told(puppet, 5) == [(2, "left")]


def test_markers_that_are_none_are_told_of() -> None:
    puppet = Puppet(WALK, more=(AnimationMarkers(markers="Walk: 0.5 left"),))
    puppet.run()
    assert "tells of nothing: markers are a name and its times" in puppet.problems()[0]


# --- scripts


def actor(play: Playground, script: str, *more: Any, **animation: Any) -> Entity:
    """An entity with a script, and below it a model that plays."""
    source = play.write("actor.py", script)
    above = play.spawn(source, "Actor")
    clips = play.assets.put(encode_clips((WALK, JUMP)), kind="clips")
    world = play.simulation.world
    model = world.spawn([Transform(), Animation(clips=clips, **animation), *more], name="Model", parent=above)
    world.spawn([Transform(position=(0.0, 1.0, 0.0))], name="Hips", parent=model)
    return above


def animation_of(play: Playground) -> Animation:
    return play.simulation.world.get(play.simulation.world.hierarchy.find("Actor/Model"), Animation)


def test_scripts_above_hear_markers_and_await_ends(play: Playground) -> None:
    entity = actor(
        play,
        """
        class Actor(Behaviour):
            async def start(self):
                self.heard = []
                self.entity.play("Jump", fade=0.1, loop="once")
                await self.entity.animation_end()
                self.heard.append(("over", self.world.tick))
                self.entity.play("Walk", loop="repeat", speed=2.0)
                found = await event("right")
                self.heard.append((found.values["clip"], self.world.tick))
                await self.entity.animation_end()
                self.heard.append(("round", self.world.tick))

            def on_event(self, event):
                self.heard.append((event.kind, self.world.tick))
        """,
        MARKERS,
    )
    play.run(120)
    assert play.failure(entity) == ""
    heard = play.on(entity).heard
    assert [what for what, _ in heard[:10]] == [
        "off", "nod", "land", "over", "left", "nod", "right", "Walk", "round", "left",
    ]  # fmt: skip
    assert dict(heard)["over"] == 31 and play.on(entity).world.dt == pytest.approx(1 / 60)
    assert animation_of(play).clip == "Walk" and animation_of(play).speed == 2.0


def test_playing_the_same_again_goes_on(play: Playground) -> None:
    entity = actor(
        play,
        """
        class Actor(Behaviour):
            def fixed_update(self, dt):
                self.entity.play("Walk", fade=0.2)
        """,
    )
    play.run(30)
    assert animation_of(play).time == pytest.approx(0.5)
    assert play.failure(entity) == ""


def test_mixes_by_weight_and_by_value(play: Playground) -> None:
    entity = actor(
        play,
        """
        class Actor(Behaviour):
            def start(self):
                self.entity.blend({"Walk": 1, "Jump": 3})

            def update(self, dt):
                if self.world.tick > 10:
                    self.entity.blend({"Walk": 0, "Jump": 4}, value=self.world.tick / 10, fade=0.5)
        """,
    )
    play.run(2)
    world = play.simulation.world
    model = world.hierarchy.find("Actor/Model")
    hips = world.hierarchy.find("Actor/Model/Hips")
    assert world.get(model, AnimationBlend) == AnimationBlend(mix="Walk 1, Jump 3")
    play.run(60)
    assert play.failure(entity) == ""
    assert world.get(hips, Transform).position[1] > 1.0 and len(play.simulation.animations.voices) == 2
    assert world.get(model, AnimationBlend).value == pytest.approx(6.1)


def test_root_motion_is_there_for_scripts(play: Playground) -> None:
    entity = actor(
        play,
        """
        class Actor(Behaviour):
            def start(self):
                self.entity.play("Walk")
                self.gone = Vector((0.0, 0.0, 0.0))

            def update(self, dt):
                self.gone += self.entity.root_motion[0]
        """,
        RootMotion(node="Hips", mode="tell"),
    )
    play.run(60)
    assert play.failure(entity) == ""
    assert play.on(entity).gone[2] == pytest.approx(-1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ('self.entity.play("Fly")', "has no clip 'Fly'; there are 'Walk', 'Jump'"),
        ('self.entity.blend({"Walk": 1, "Fly": 1})', "has no clip 'Fly'"),
        ('self.entity.blend({"Walk": -1})', "takes weights of at least 0"),
        ("self.entity.blend({})", "takes at least one clip"),
        ('self.entity.play("Walk", fade=-1)', "Animation.fade must be at least 0 s, not -1"),
        ('self.world.find("Stone").play("Walk")', "has no Animation, nor has anybody below it"),
    ],
)
def test_what_scripts_ask_wrongly_is_said(play: Playground, call: str, words: str) -> None:
    entity = actor(
        play,
        f"""
        class Actor(Behaviour):
            def start(self):
                {call}
        """,
    )
    play.simulation.world.spawn([Transform()], name="Stone")
    play.run(2)
    assert words in play.failure(entity)


def test_a_wait_for_the_end_survives_going_back(play: Playground) -> None:
    entity = actor(
        play,
        """
        class Actor(Behaviour):
            over = 0

            async def start(self):
                self.entity.play("Jump", loop="once")
                await self.entity.animation_end()
                self.over = self.world.tick
        """,
        MARKERS,
    )
    play.run(12)
    state = play.simulation.capture()
    play.run(60)
    assert play.on(entity).over == 31
    play.simulation.restore(state)
    assert play.on(entity).over == 0
    play.run(60)
    assert play.on(entity).over == 31


def test_without_scripts_markers_are_on_the_bus_all_the_same() -> None:
    puppet = Puppet(WALK, more=(MARKERS,))
    puppet.world.spawn([Script()])
    assert [name for _, name in told(puppet, 30)] == ["left", "nod"]
