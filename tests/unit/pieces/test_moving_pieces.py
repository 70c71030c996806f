"""Pieces that move: doors, buttons, platforms, rotators, belts, spawners and timers, each against its figures."""

from __future__ import annotations

import itertools
import math

import pytest

from elys.bus.messages.commands import Input
from elys.common.components import RigidBody, Transform
from elys.common.scene import EntityNode
from tests.unit.pieces.conftest import MakeStage, ball, box, ground, piece


def test_a_door_opens_for_who_comes_and_closes_when_they_have_left(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Door", "door", values={"duration": 0.5, "stays_open": 1.0, "travel": [0.0, 2.0, 0.0]}),
        ball("Guest", 0.0, 1.0, 5.0, gravity_scale=0.0),
    )
    stage.run(0.5)
    assert stage.kinds() == []
    assert stage.position("Door/Panel") == pytest.approx((0.0, 1.1, 0.0), abs=1e-6)
    stage.place("Guest", 0.0, 1.0, 1.0)
    stage.run(0.25 + 2 / 60)
    assert 1.5 < stage.position("Door/Panel")[1] < 2.7  # on its way
    stage.goes_on_the_same(1.0)
    stage.run(2.0)
    assert stage.position("Door/Panel") == pytest.approx((0.0, 3.1, 0.0), abs=1e-6)  # for as long as the guest stays
    assert stage.kinds() == ["door_opened"]
    stage.place("Guest", 0.0, 1.0, 5.0)
    left = stage.simulation.tick
    stage.run(3.0)
    assert stage.kinds() == ["door_opened", "door_closed"]
    closed, _ = stage.events("door_closed")[0]
    assert (closed - left) / 60 == pytest.approx(1.5, abs=0.1)
    assert stage.position("Door/Panel") == pytest.approx((0.0, 1.1, 0.0), abs=1e-6)


def test_a_plate_under_enough_weight_opens_a_door_by_its_signal(make_stage: MakeStage) -> None:
    stage = make_stage(
        ground(),
        piece("Plate", "button", values={"tells": "gate", "mass": 3.0}),
        piece("Door", "door", 0.0, 0.0, -5.0, values={"signal": "gate", "stays_open": 0.0}),
        box("Light", -0.22, 0.3, 0.0, mass=2.0),
        box("Heavy", 3.0, 0.2, 0.0, mass=2.0),
    )
    stage.run(1.0)
    assert stage.kinds() == []  # 2 kg are too little
    stage.place("Heavy", 0.22, 0.32, 0.0)
    stage.run(1.0)
    assert stage.kinds()[:1] == ["button_pressed"] and stage.on("Plate").is_on
    assert stage.position("Plate/Cap")[1] == pytest.approx(0.14 - 0.08, abs=1e-6)
    stage.run(1.0)
    assert stage.on("Door").is_open
    for name, place in (("Light", 5.0), ("Heavy", 7.0)):
        stage.place(name, place, 0.3, 0.0)
    stage.run(1.5)
    assert stage.kinds() == ["button_pressed", "door_opened", "button_released", "door_closed"]
    assert [event["on"] for _, event in stage.events("signal")] == [True, False]


@pytest.mark.parametrize(("latch", "signals"), [("hold", [1, 0, 1, 0]), ("toggle", [1, 0]), ("once", [1])])
def test_a_switch_is_used_with_a_key_by_who_is_near(make_stage: MakeStage, latch: str, signals: list[int]) -> None:
    stage = make_stage(
        piece("Switch", "button", values={"mode": "use", "latch": latch, "tells": "s"}),
        ball("Player", 0.0, 0.36, 0.0, gravity_scale=0.0),
    )
    stage.run(0.1)
    for number, is_down in enumerate((True, False, True, False)):
        stage.simulation.inputs.take(Input(player=1, source="test", changes=(("e", is_down),)))
        stage.run(0.1)
        assert len(stage.events("button_pressed")) == (number + 2) // 2
    assert [int(event["on"]) for _, event in stage.events("signal")] == signals


def test_a_platform_goes_its_path_in_the_time_that_its_speed_says_and_carries(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Lift", "moving_platform", 0.0, 1.0, 0.0),
        box("Crate", 0.5, 1.325, 0.0),
    )
    # 4 m at 2 m/s and half a second at each end.
    stage.run(1.0)
    assert stage.position("Lift/Platform")[2] == pytest.approx(-2.0, abs=0.07)
    stage.goes_on_the_same(1.0)
    stage.run(6.5)
    arrivals = stage.events("platform_arrived")
    assert [event["point"] for _, event in arrivals] == [1, 0, 1]
    assert [(b[0] - a[0]) / 60 for a, b in itertools.pairwise(arrivals)] == pytest.approx([2.5, 2.5], abs=0.05)
    crate, platform = stage.position("Crate"), stage.position("Lift/Platform")
    assert [a - b for a, b in zip(crate, platform, strict=True)] == pytest.approx([0.5, 0.325, 0.0], abs=0.03)


@pytest.mark.parametrize(
    ("mode", "points"), [("loop", [1, 2, 0, 1, 2, 0]), ("ping_pong", [1, 2, 1, 0, 1, 2]), ("once", [1, 2])]
)
def test_the_ways_round_a_path(make_stage: MakeStage, mode: str, points: list[int]) -> None:
    lift = piece("Lift", "moving_platform")
    lift.overrides = {"Platform": {"Script": {"values": {"mode": mode, "speed": 4.0, "pause": 0.0, "ease": "linear"}}}}
    lift.children = []
    stage = make_stage(lift)
    third = stage.simulation.world.spawn(
        [Transform(position=(3.0, 0.0, -4.0))], name="Point 3", parent=stage.id("Lift/Path")
    )
    assert third
    stage.run(8.0)
    assert [event["point"] for _, event in stage.events("platform_arrived")][: len(points)] == points
    if mode == "once":
        assert len(stage.events("platform_arrived")) == 2


def test_a_platform_waits_for_its_signal(make_stage: MakeStage) -> None:
    lift = piece("Lift", "moving_platform")
    lift.overrides = {"Platform": {"Script": {"values": {"signal": "go", "pause": 0.0}}}}
    stage = make_stage(lift)
    stage.run(1.0)
    assert stage.position("Lift/Platform") == (0.0, 0.0, 0.0)
    stage.on("Lift/Platform").world.emit("signal", name="go", on=True)
    stage.run(1.0)
    assert stage.position("Lift/Platform")[2] < -1.5
    stage.on("Lift/Platform").world.emit("signal", name="go", on=False)
    stage.run(2.0)
    assert stage.position("Lift/Platform")[2] == pytest.approx(-4.0)


def test_a_rotator_turns_at_its_speed_and_swings_by_its_angle(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Wheel", "rotator", values={"speed": math.pi}),
        piece("Arm", "rotator", 20.0, 0.0, 0.0, values={"angle": 1.0, "speed": 2.0, "pause": 0.0}),
    )
    stage.run(0.5)
    x, y, z, w = stage.simulation.world.get(stage.id("Wheel"), Transform).rotation
    assert 2.0 * math.atan2(y, w) == pytest.approx(math.pi / 2.0, abs=0.01) and abs(x) + abs(z) < 1e-6
    stage.run(4.0 + 2 / 60)
    assert [event["times"] for _, event in stage.events("rotator_turned") if event["rotator"] == stage.id("Wheel")] == [
        1,
        2,
    ]
    swings = [tick for tick, event in stage.events("rotator_turned") if event["rotator"] == stage.id("Arm")]
    assert [(b - a) / 60 for a, b in itertools.pairwise(swings)] == pytest.approx([0.5] * (len(swings) - 1), abs=0.03)
    stage.goes_on_the_same(0.7)


def test_a_belt_brings_what_lies_on_it_to_its_speed_and_stays(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Belt", "conveyor", 0.0, 0.15, 0.0, values={"velocity": [1.5, 0.0, 0.0]}),
        box("Box", -2.0, 0.5, 0.0, friction=0.9),
    )
    stage.run(0.1)
    # Until it has the belt's speed friction pulls with mu g = 0.9 * 9.81.
    assert 0.0 < stage.velocity("Box")[0] < 0.9 * 9.81 * 0.1 + 0.05
    stage.run(0.9)
    assert stage.velocity("Box")[0] == pytest.approx(1.5, abs=0.02)
    before = stage.position("Box")[0]
    stage.run(1.0)
    assert stage.position("Box")[0] - before == pytest.approx(1.5, abs=0.03)
    assert stage.position("Belt") == pytest.approx((0.0, 0.15, 0.0), abs=1e-6) or stage.position("Belt") == (
        0.0,
        0.0,
        0.0,
    )
    stage.goes_on_the_same(0.5)


def test_a_spawner_keeps_to_its_interval_limit_total_and_spread(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece(
            "Few",
            "spawner",
            values={"interval": 0.5, "limit": 3, "spread": [1.0, 0.0, 2.0], "velocity": [0.0, 3.0, 0.0]},
        ),
        piece(
            "Ended",
            "spawner",
            50.0,
            0.0,
            0.0,
            values={"interval": 0.25, "limit": 0, "total": 4, "lifetime": 1.0, "velocity": [0.0, 9.0, 0.0]},
        ),
        gravity=(0.0, 0.0, 0.0),
    )
    stage.run(0.6)
    stage.goes_on_the_same(1.0)
    stage.run(4.0)
    few = [(tick, event) for tick, event in stage.events("spawned") if event["spawner"] == stage.id("Few")]
    first = few[0][0]
    assert [tick - first for tick, _ in few] == [0, 30, 60]
    alive = stage.on("Few").alive
    assert len(alive) == 3
    for one in alive:
        assert abs(one.position.x) <= 1.0 and abs(one.position.z) <= 2.0
        assert one.velocity == pytest.approx((0.0, 3.0, 0.0))
    assert len({round(one.position.x, 3) for one in alive}) == 3
    assert stage.on("Ended").count == 4
    assert stage.on("Ended").alive == []  # each is taken away after a second
    alive[0].destroy()
    stage.run(0.6)
    assert len(stage.on("Few").alive) == 3 and stage.on("Few").count == 4


def test_a_timer_rings_and_its_signal_takes_it_back(make_stage: MakeStage) -> None:
    clock = {"Transform": {}}
    stage = make_stage(
        EntityNode(
            name="Clock",
            components={
                **clock,
                "Script": {
                    "source": "elys:timer.py#Timer",
                    "values": {"duration": 1.0, "tells": "tick", "rings": 0.25},
                },
            },
        ),
        EntityNode(
            name="Bomb",
            components={
                **clock,
                "Script": {
                    "source": "elys:timer.py#Timer",
                    "values": {"duration": 0.8, "repeats": False, "signal": "fuse"},
                },
            },
        ),
    )
    stage.run(3.5)
    rings = [tick for tick, event in stage.events("timer_rang")]
    assert [b - a for a, b in itertools.pairwise(rings)] == [60, 60]
    assert [event["on"] for _, event in stage.events("signal")] == [True, False] * 3
    for on, wait in ((True, 0.5), (False, 1.0), (True, 1.0)):
        stage.on("Bomb").world.emit("signal", name="fuse", on=on)
        stage.run(wait)
        stage.goes_on_the_same(0.2)
    assert len([1 for _, event in stage.events("timer_rang") if event["timer"] == stage.id("Bomb")]) <= 1
    assert stage.on("Bomb").count == 1


def test_bodies_of_pieces_are_kinematic_where_they_move(make_stage: MakeStage) -> None:
    stage = make_stage(piece("Door", "door"), piece("Lift", "moving_platform", 9.0, 0.0, 0.0))
    for path in ("Door/Panel", "Lift/Platform"):
        assert stage.simulation.world.get(stage.id(path), RigidBody).motion == "kinematic"
