"""Pieces that stand and wait: checkpoints, coins, wind and water, what breaks, gates and goals, zones that kill."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.components import Collider, Material, RigidBody, Transform
from elys.common.scene import EntityNode
from tests.unit.pieces.conftest import MakeStage, ball, ground, piece


def runner(name: str, *position: float) -> EntityNode:
    """A ball that comes back."""
    return piece(name, "respawning_ball", *position, RigidBody={"gravity_scale": 0.0})


def test_who_is_killed_comes_back_to_the_last_checkpoint(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("One", "checkpoint", 5.0, 0.0, 0.0, values={"number": 1}),
        piece("Two", "checkpoint", 10.0, 0.0, 0.0, values={"number": 2}),
        piece("Lava", "kill_zone", 20.0, 0.0, 0.0),
        runner("Player", 0.0, 1.0, 0.0),
    )
    stage.run(0.1)
    for x in (5.0, 10.0, 5.0):  # back at the first one: the second still counts
        stage.place("Player", x, 0.5, 0.0)
        stage.run(0.2)
    stage.simulation.world.set_fields(stage.id("Player"), RigidBody, {"linear_velocity": (3.0, 0.0, 0.0)})
    stage.place("Player", 20.0, 0.2, 0.0)
    stage.run(0.2)
    assert stage.events("killed")[0][1] == {"zone": stage.id("Lava"), "entity": stage.id("Player")}
    stage.goes_on_the_same(1.0)
    stage.run(0.5)
    killed, back = stage.events("killed")[0][0], stage.events("respawned")[0][0]
    assert (back - killed) / 60 == pytest.approx(0.5, abs=0.04)
    assert stage.position("Player") == pytest.approx((10.0, 0.5, 0.0), abs=0.02)
    assert stage.velocity("Player") == (0.0, 0.0, 0.0)
    stage.place("Player", 0.0, -30.0, 0.0)  # deeper than the floor
    stage.run(1.0)
    assert stage.events("respawned")[-1][1]["times"] == 2
    assert stage.position("Player")[0] == pytest.approx(10.0, abs=0.02)


def test_what_cannot_come_back_is_taken_away_and_platforms_are_not(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Lava", "kill_zone", values={}),
        ball("Ball", 0.0, 0.3, 0.0),
        piece("Lift", "moving_platform", 0.0, 0.2, 0.0),
        piece("Harmless", "kill_zone", 20.0, 0.0, 0.0, values={"destroys": False}),
        ball("Other", 20.0, 0.3, 0.0),
    )
    ids = stage.id("Ball"), stage.id("Other"), stage.id("Lift/Platform")
    stage.run(0.2)
    assert [stage.simulation.world.is_alive(entity) for entity in ids] == [False, True, True]
    assert sorted(event["entity"] for _, event in stage.events("killed")) == sorted(ids[:2])


def test_a_coin_is_taken_once_and_is_there_again(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Coin", "collectible", values={"value": 5}),
        piece("Gem", "collectible", 9.0, 0.0, 0.0, values={"kind": "gem", "returns": 1.0, "tells": "gem"}),
        ball("Player", 4.0, 0.0, 0.0, gravity_scale=0.0),
    )
    coin = stage.id("Coin")
    turned = stage.simulation.world.get(stage.id("Gem/Coin"), Transform).rotation
    stage.run(0.5)
    now = stage.simulation.world.get(stage.id("Gem/Coin"), Transform).rotation
    assert abs(np.dot(turned, now)) == pytest.approx(np.cos(0.5), abs=0.02)  # 2 rad/s for half a second, half angles
    stage.place("Player", 0.0, 0.0, 0.0)
    stage.run(0.2)
    assert not stage.simulation.world.is_alive(coin)
    player = stage.id("Player")
    assert stage.events("collected")[0][1] == {"collectible": coin, "by": player, "kind": "coin", "value": 5}
    stage.place("Player", 9.0, 0.0, 0.0)
    stage.run(0.2)
    assert not stage.simulation.world.hierarchy.is_enabled(stage.id("Gem/Coin"))
    stage.goes_on_the_same(1.2)
    stage.place("Player", 4.0, 0.0, 0.0)
    stage.run(1.0)
    assert stage.simulation.world.hierarchy.is_enabled(stage.id("Gem/Coin"))
    stage.place("Player", 9.0, 0.0, 0.0)
    stage.run(0.2)
    assert [event["kind"] for _, event in stage.events("collected")] == ["coin", "gem", "gem"]
    assert len(stage.events("signal")) == 2


def force_zone(name: str, *position: float, **values: object) -> EntityNode:
    return EntityNode(
        name=name,
        components={
            "Transform": {"position": list(position or (0.0, 0.0, 0.0))},
            "Collider": {"size": [8, 20, 8], "is_trigger": True},
            "Script": {"source": "elys:force_zone.py#ForceZone", "values": values},
        },
    )


def test_wind_brings_bodies_to_its_speed_as_the_drag_says(make_stage: MakeStage) -> None:
    stage = make_stage(force_zone("Wind", wind=[4.0, 0.0, 0.0], drag=2.0), ball("Leaf"), gravity=(0.0, 0.0, 0.0))
    stage.run(0.1)
    assert stage.kinds() == ["zone_entered"]
    stage.goes_on_the_same(0.5)
    entered = stage.events("zone_entered")[0][0] - 2  # ticks before the first force: what is told is heard one later
    speeds = []
    for _ in range(20):
        stage.run(1 / 60)
        speeds.append(stage.velocity("Leaf")[0])
    # v' = k (w - v), a step of 1/60 s at a time: v_n = w (1 - (1 - k dt)^n).
    counts = np.arange(20) + 7 - entered
    assert speeds == pytest.approx(4.0 * (1.0 - (1.0 - 2.0 / 60.0) ** counts), rel=1e-3)
    stage.place("Leaf", 0.0, 50.0, 0.0)
    stage.run(0.1)
    assert stage.kinds() == ["zone_entered", "zone_left"]


def test_gravity_is_what_a_zone_says(make_stage: MakeStage) -> None:
    stage = make_stage(
        force_zone("None", 0.0, 0.0, 0.0, gravity_scale=0.0),
        force_zone("Moon", 20.0, 0.0, 0.0, gravity_scale=0.165),
        force_zone("Off", 40.0, 0.0, 0.0, gravity_scale=0.0, signal="never"),
        *(ball(f"Ball {number}", 20.0 * number, 5.0, 0.0) for number in range(3)),
    )
    stage.run(0.1)
    before = [stage.velocity(f"Ball {number}")[1] for number in range(3)]
    stage.run(0.5)
    gained = [stage.velocity(f"Ball {number}")[1] - was for number, was in enumerate(before)]
    assert gained == pytest.approx([0.0, -0.165 * 9.81 * 0.5, -9.81 * 0.5], rel=1e-3, abs=1e-4)


def test_what_is_lighter_than_water_floats_where_it_displaces_its_weight(make_stage: MakeStage) -> None:
    stage = make_stage(
        force_zone("Water", lift=2.0, surface=0.0, shallows=0.6, drag=1.5),
        ball("Cork", 0.0, 1.0, 0.0, mass=3.0),
    )
    stage.run(12.0)
    # At rest lift x depth / shallows is 1: 0.3 m below the surface, whatever the mass.
    assert stage.position("Cork")[1] == pytest.approx(-0.3, abs=0.01)
    assert stage.velocity("Cork") == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


def test_a_blow_above_its_strength_breaks_a_crate_into_shards_of_its_mass(make_stage: MakeStage) -> None:
    stage = make_stage(
        ground(),
        piece("Weak", "breakable", 0.0, 0.35, 0.0, values={"strength": 40.0}, Material={"base_color": [0.1, 0.2, 0.3]}),
        piece("Strong", "breakable", 10.0, 0.35, 0.0, values={"strength": 400.0}),
        ball("Shot", -2.0, 0.35, 0.0, mass=8.0, velocity=(12.0, 0.0, 0.0)),
        ball("Other shot", 8.0, 0.35, 0.0, mass=8.0, velocity=(12.0, 0.0, 0.0)),
    )
    world = stage.simulation.world
    weak, strong, shot = stage.id("Weak"), stage.id("Strong"), stage.id("Shot")
    mass = world.get(weak, RigidBody).mass
    stage.run(0.1)
    stage.goes_on_the_same(0.5)
    stage.run(0.3)
    assert not world.is_alive(weak) and world.is_alive(strong)
    ((_, broken),) = stage.events("broken")
    assert (broken["entity"], broken["by"]) == (weak, shot) and broken["impulse"] == pytest.approx(
        12.0 * 8.0 * mass / (8.0 + mass), rel=0.15
    )
    shards = stage.simulation.scripts.named("Shard")
    assert len(shards) == 8
    assert sum(world.get(one, RigidBody).mass for one in shards) == pytest.approx(mass, rel=1e-5)
    assert all(world.get(one, Material).base_color == pytest.approx((0.1, 0.2, 0.3)) for one in shards)
    assert np.prod(world.get(shards[0], Transform).scale) == pytest.approx((0.49 * 0.7) ** 3, rel=1e-4)
    stage.run(4.5)
    assert stage.simulation.scripts.named("Shard") == []  # they are gone after 4 s


def test_a_stack_stands_by_itself_and_falls_apart_under_a_shot(make_stage: MakeStage) -> None:
    stage = make_stage(ground(), piece("Stack", "breakable_stack"))
    stage.run(3.0)
    assert stage.kinds() == []
    top = stage.position("Stack/Crate 10")
    assert top == pytest.approx((0.0, 0.35 + 3 * 0.7, 0.0), abs=0.03)
    parts = [Transform(position=(0.0, 0.9, 8.0)), RigidBody(mass=20.0, linear_velocity=(0.0, 0.0, -25.0))]
    stage.simulation.world.spawn([*parts, Collider(shape="sphere", radius=0.4)], name="Shot")
    stage.run(1.0)
    assert len(stage.events("broken")) >= 2


def test_a_goal_counts_who_has_passed_the_gates_in_their_order(make_stage: MakeStage) -> None:
    stage = make_stage(
        *(piece(f"Gate {number}", "gate", 0.0, 0.0, -5.0 * number, values={"number": number}) for number in (1, 2)),
        piece("Goal", "goal", 0.0, 0.0, -15.0, values={"gates": 2, "tells": "won"}),
        ball("Cheat", 0.5, 1.0, -12.0, velocity=(0.0, 0.0, -10.0), gravity_scale=0.0),
        ball("Fair", -0.5, 1.0, 0.0, velocity=(0.0, 0.0, -10.0), gravity_scale=0.0),
    )
    stage.run(0.6)
    stage.goes_on_the_same(1.2)
    stage.run(1.4)
    fair = stage.id("Fair")
    passed = [(event["number"], event["by"]) for _, event in stage.events("gate_passed")]
    assert passed == [(1, fair), (2, fair)]
    times = [event["time"] for _, event in stage.events("gate_passed")]
    assert times == pytest.approx([0.46, 0.96], abs=0.04)  # a ball of 0.25 m, 10 m/s, gates 0.3 m deep
    ((_, goal),) = stage.events("goal_reached")
    assert goal["by"] == fair and goal["time"] == pytest.approx(1.46, abs=0.04)
    assert [event["name"] for _, event in stage.events("signal")] == ["won"]


def test_a_gate_of_one_way_tells_of_nobody_who_comes_back(make_stage: MakeStage) -> None:
    stage = make_stage(
        piece("Gate", "gate", values={"is_one_way": True}),
        ball("There", 0.5, 1.0, 2.0, velocity=(0.0, 0.0, -10.0), gravity_scale=0.0),
        ball("Back", -0.5, 1.0, -2.0, velocity=(0.0, 0.0, 10.0), gravity_scale=0.0),
    )
    stage.run(0.5)
    assert [event["by"] for _, event in stage.events("gate_passed")] == [stage.id("There")]
