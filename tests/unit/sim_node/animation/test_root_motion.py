"""Root motion: who walks, how far, and what the node does meanwhile; against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.assets.clip import Clip
from elys.common.components import AnimationBlend, RigidBody, RootMotion, Transform
from tests.unit.sim_node.animation.stage import HIPS, SPINE, Puppet, track, turn

# Uneven in time, with a bob and a sway: from z 0 to -1.5 m in 0.7 s.
WAY = [(0.0, 1.0, 0.0), (0.1, 1.1, -0.2), (-0.1, 0.9, -1.1), (0.0, 1.0, -1.5)]
STRIDE = np.float32(-1.5)
WALK = Clip(name="Walk", channels=(track(HIPS, WAY, duration=0.7),))
LENGTH = float(np.float32(0.7))


def walker(*clips: Clip, more=(), root: RootMotion | None = None, at: Transform | None = None, **animation) -> Puppet:
    return Puppet(*(clips or (WALK,)), more=(root or RootMotion(node="Hips"), *more), at=at, **animation)


@pytest.mark.parametrize("speed", [1.0, 0.37, -1.0, 9.0, -40.0])
def test_n_rounds_are_n_times_one(speed: float) -> None:
    puppet = walker(speed=speed)
    ticks = 3000
    puppet.run(ticks)
    rounds = float(np.float32(speed)) * ticks / 50 / LENGTH
    whole, part = np.floor(rounds), rounds - np.floor(rounds)
    times = np.linspace(0.0, 1.0, 4)
    keys = np.array(WAY, np.float32).astype(np.float64)
    along = [np.interp(part, times, keys[:, axis]) for axis in range(3)]
    expected = (along[0], 0.0, whole * float(STRIDE) + along[2])
    assert puppet.place(puppet.player) == pytest.approx(expected, abs=2e-9 * abs(rounds) + 1e-9)
    assert puppet.place(puppet.hips) == pytest.approx((0.0, along[1], 0.0), abs=1e-5)


def test_after_whole_rounds_it_has_gone_whole_ways_to_the_last_digits() -> None:
    puppet = walker(Clip(name="Walk", channels=(track(HIPS, [(0, 1, 0), (0, 1, -2)], duration=1.0),)))
    for rounds in range(1, 41):
        puppet.run(50)
        time = puppet.animation().time
        time = time - 1.0 if time > 0.5 else time  # 50 ticks make a second but for rounding
        assert puppet.place(puppet.player)[2] == pytest.approx(-2.0 * (rounds + time), abs=1e-12 * rounds)


@pytest.mark.parametrize("loop", ["ping_pong", "once"])
def test_there_and_back_is_nowhere_and_an_end_is_an_end(loop: str) -> None:
    puppet = walker(loop=loop)
    puppet.run(70)
    expected = 0.0 if loop == "ping_pong" else float(STRIDE)
    assert puppet.place(puppet.player)[2] == pytest.approx(expected, abs=1e-5)


def test_it_goes_where_the_entity_looks_and_as_large_as_it_is() -> None:
    at = Transform(position=(3.0, 4.0, 5.0), rotation=tuple(turn((0, 1, 0), 90).tolist()), scale=(2.0, 2.0, 2.0))
    puppet = walker(at=at, loop="once")
    puppet.run(60)
    assert puppet.place(puppet.player) == pytest.approx((3.0 - 3.0, 4.0, 5.0), abs=1e-5)


def test_up_and_down_only_if_it_rises() -> None:
    climb = Clip(name="Climb", channels=(track(HIPS, [(0, 1, 0), (0, 1.5, -0.25)]),))
    puppet = walker(climb, root=RootMotion(node="Hips", height=True))
    puppet.run(200)
    assert puppet.place(puppet.player) == pytest.approx((0.0, 2.0, -1.0), abs=1e-6)
    assert puppet.place(puppet.hips) == pytest.approx((0.0, 1.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("rounds", [1, 4, 7])
def test_who_turns_goes_round_a_circle(rounds: int) -> None:
    """A quarter to the left and a step in each round: four make a square."""
    clip = Clip(
        name="Turn",
        channels=(
            track(HIPS, [(0, 1, 0), (0, 1, -1)]),
            track(HIPS, [turn((0, 1, 0), 0), turn((0, 1, 0), 90)], name="rotation"),
        ),
    )
    puppet = walker(clip, root=RootMotion(node="Hips", turn=True))
    puppet.run(50 * rounds)
    place, facing = np.zeros(3), Rotation.identity()
    for _ in range(rounds):  # plain: one round after the other
        place = place + facing.apply((0.0, 0.0, -1.0))
        facing = facing * Rotation.from_euler("y", 90, degrees=True)
    assert puppet.place(puppet.player) == pytest.approx(tuple(place), abs=1e-5)
    off = (Rotation.from_quat(puppet.rotation(puppet.player)) * facing.inv()).magnitude()
    assert off < 1e-5
    assert puppet.rotation(puppet.hips) == pytest.approx((0.0, 0.0, 0.0, 1.0), abs=1e-6)
    assert puppet.place(puppet.hips) == pytest.approx((0.0, 1.0, 0.0), abs=1e-6)


def test_in_one_great_step_it_comes_as_far_as_in_many() -> None:
    clip = Clip(
        name="Turn",
        channels=(
            track(HIPS, [(0.2, 1, 0), (0.5, 1, -1)]),
            track(HIPS, [turn((0, 1, 0), 20), turn((0.1, 1, 0), 51)], name="rotation"),
        ),
    )
    ends = []
    for speed, ticks in ((1.0, 370), (370.0, 1), (-37.0, 10), (-370.0, 1)):
        puppet = walker(clip, root=RootMotion(node="Hips", turn=True), speed=speed)
        puppet.run(ticks)
        facing = Rotation.from_quat(puppet.rotation(puppet.player)).as_matrix()
        ends.append((*puppet.place(puppet.player), *facing.ravel()))
    assert ends[1] == pytest.approx(ends[0], abs=1e-5)
    assert ends[3] == pytest.approx(ends[2], abs=1e-5)


def test_a_node_below_turned_ones_moves_the_entity_in_its_own_space() -> None:
    """As exporters from programs with z up do: the armature is turned, and the node moves in its space."""
    clip = Clip(name="Walk", channels=(track(SPINE, [(0, 0, 0.5), (0, 2, 0.5)]),))
    puppet = walker(clip, root=RootMotion(node="Hips/Spine"))
    puppet.world.set_fields(puppet.hips, Transform, {"rotation": tuple(turn((1, 0, 0), -90).tolist())})
    puppet.run(50)
    assert puppet.place(puppet.player) == pytest.approx((0.0, 0.0, -2.0), abs=1e-5)
    assert puppet.place(puppet.spine)[2] == pytest.approx(0.5, abs=1e-6)


def test_of_a_mix_it_goes_the_weighted_way() -> None:
    run = Clip(name="Run", channels=(track(HIPS, [(0, 1, 0), (0, 1, -4)], duration=0.7),))
    puppet = walker(WALK, run, more=(AnimationBlend(mix="Walk 1, Run 3"),))
    puppet.run(350)  # ten rounds
    assert puppet.place(puppet.player)[2] == pytest.approx(10 * (0.25 * -1.5 + 0.75 * -4.0), abs=1e-4)


def test_only_told_it_stays_and_says_how_far() -> None:
    puppet = walker(
        root=RootMotion(node="Hips", mode="tell"), at=Transform(rotation=tuple(turn((0, 1, 0), 90).tolist()))
    )
    gone = np.zeros(3)
    for _ in range(35):
        puppet.run()
        gone += puppet.simulation.animations.walks.gone[0]
    assert puppet.place(puppet.player) == (0.0, 0.0, 0.0)
    assert gone == pytest.approx((-1.5, 0.0, 0.0), abs=1e-5)
    assert puppet.place(puppet.hips)[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("motion", ["kinematic", "dynamic"])
def test_a_body_is_moved_by_physics(motion: str) -> None:
    puppet = walker(
        Clip(
            name="Turn",
            channels=(
                track(HIPS, [(0, 1, 0), (0, 1, -1)]),
                track(HIPS, [turn((0, 1, 0), 0), turn((0, 1, 0), 90)], name="rotation"),
            ),
        ),
        more=(RigidBody(motion=motion, gravity_scale=0.0 if motion == "kinematic" else 1.0),),
        root=RootMotion(node="Hips", turn=True),
        at=Transform(position=(0.0, 10.0, 0.0)),
    )
    puppet.run(50)
    x, y, z = puppet.place(puppet.player)
    assert (x, z) == pytest.approx((0.0, -1.0), abs=0.02)
    assert (y == 10.0) == (motion == "kinematic") and (y == 10.0 or y == pytest.approx(10 - 4.9, abs=0.1))
    facing = Rotation.from_quat(puppet.rotation(puppet.player)).as_euler("YXZ", degrees=True)
    assert facing == pytest.approx((90.0, 0.0, 0.0), abs=0.1)


def test_who_walks_is_told_to_viewers_and_saved_where_it_was() -> None:
    puppet = walker()
    puppet.run(10)
    assert puppet.player in puppet.simulation.animated().local_entity.tolist()
    edited = puppet.simulation.edited.of(puppet.player, "Transform")
    assert edited is not None and edited["position"].tolist() == [0.0, 0.0, 0.0]


def test_wound_back_it_walks_the_same_way_again() -> None:
    puppet = walker(speed=1.3)
    puppet.run(20)
    state = puppet.simulation.capture()
    puppet.run(40)
    expected = puppet.simulation.state_hash(), puppet.place(puppet.player)
    puppet.simulation.restore(state)
    puppet.run(40)
    assert (puppet.simulation.state_hash(), puppet.place(puppet.player)) == expected


@pytest.mark.parametrize("node", ["", "Legs", "Hips/Tail"])
def test_a_node_that_is_not_there_is_told_of(node: str) -> None:
    puppet = walker(root=RootMotion(node=node))
    puppet.run(2)
    (problem,) = puppet.problems()
    assert f"RootMotion.node names '{node}', which is not below it" in problem
    assert puppet.place(puppet.player) == (0.0, 0.0, 0.0)
