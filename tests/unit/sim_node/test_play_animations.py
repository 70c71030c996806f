"""Clips in a running simulation: what moves, when, for whom, and what is told of it."""

from __future__ import annotations

import numpy as np
import pytest

from elys.bus.messages.state_frame import HEADER, pack_frame, unpack_frame
from elys.common.assets import AssetStore
from elys.common.assets.clip import Channel, Clip, encode_clips
from elys.common.components import Animation, Collider, RigidBody, Transform
from elys.common.errors import MessageError
from elys.common.scene import SceneSettings
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.publish_state import state_frame

RATE = 50
SLIDE = np.array(((0, 0, 0), (2, 0, 0)), np.float32)  # m, in 1 s
TIMES = np.array((0, 1), np.float32)


def slide(target: tuple[str, ...], name: str = "Slide", way: np.ndarray = SLIDE) -> Clip:
    channel = Channel(target=target, property="position", interpolation="linear", times=TIMES, values=way)
    return Clip(name=name, channels=(channel,))


class Stage:
    """A player with an arm and a hand below it."""

    def __init__(self, *clips: Clip, **animation) -> None:
        self.assets = AssetStore()
        self.simulation = Simulation(settings=SceneSettings(tick_rate=RATE), assets=self.assets)
        world = self.world = self.simulation.world
        reference = self.assets.put(encode_clips(clips or (slide(("Arm", "Hand")),)), kind="clips")
        self.player = world.spawn([Transform(), Animation(clips=reference, **animation)], name="Player")
        self.arm = world.spawn([Transform(position=(0.0, 1.0, 0.0))], name="Arm", parent=self.player)
        self.hand = world.spawn([Transform()], name="Hand", parent=self.arm)
        self.simulation.settle()
        self.simulation.take_changes()

    def run(self, ticks: int) -> float:
        """x of the hand after so many ticks."""
        for _ in range(ticks):
            self.simulation.step()
        return self.world.get(self.hand, Transform).position[0]

    def frame(self):
        return state_frame(self.simulation, epoch=1, delta_sequence=0, playing=True)


def test_what_a_clip_names_moves_with_all_below_it() -> None:
    stage = Stage(slide(("Arm",)))
    for _ in range(25):
        stage.simulation.step()
    assert stage.world.transforms.world_pose(stage.hand)[0] == pytest.approx((1.0, 0.0, 0.0))
    assert stage.world.get(stage.player, Animation).time == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("animation", "expected"),
    [
        ({}, {10: 0.4, 60: 0.4}),
        ({"time": 0.75}, {0: 1.5, 10: 1.9, 20: 0.3}),
        ({"speed": -0.5}, {10: 1.8, 60: 0.8}),
        ({"loop": "once"}, {10: 0.4, 60: 2.0, 90: 2.0}),
        ({"loop": "once", "speed": -1.0, "time": 0.3}, {5: 0.4, 60: 0.0}),
        ({"loop": "ping_pong"}, {10: 0.4, 60: 1.6, 110: 0.4}),
        ({"playing": False, "time": 0.25}, {0: 0.5, 40: 0.5}),
        ({"speed": 1000.0, "loop": "once"}, {1: 2.0}),
    ],
)
def test_time_goes_on_as_the_component_says(animation, expected) -> None:
    stage, done = Stage(**animation), 0
    for ticks, x in expected.items():
        assert stage.run(ticks - done) == pytest.approx(x, abs=1e-6)
        done = ticks


def test_a_pause_shows_where_time_was_put() -> None:
    stage = Stage()
    stage.world.set(stage.player, Animation(clips=stage.world.get(stage.player, Animation).clips, time=0.25))
    stage.simulation.settle()
    assert stage.run(0) == pytest.approx(0.5)


def test_two_runs_give_the_same_bits() -> None:
    first, second = Stage(time=0.1, speed=0.77), Stage(time=0.1, speed=0.77)
    first.run(137), second.run(137)
    assert pack_frame(first.frame())[HEADER.size :] == pack_frame(second.frame())[HEADER.size :]


def test_the_state_hash_tells_apart_what_clips_move() -> None:
    stage = Stage()
    stage.run(3)
    moved, of_physics = stage.simulation.state_hash(), stage.simulation.physics.state_hash()
    assert moved != of_physics
    stage.run(1)
    assert stage.simulation.state_hash() != moved
    stage.world.remove(stage.player, Animation)
    stage.simulation.settle()
    assert stage.simulation.state_hash() == stage.simulation.physics.state_hash()


def test_a_clip_is_chosen_by_name_and_changed_while_it_runs() -> None:
    stage = Stage(slide(("Arm", "Hand")), slide(("Arm", "Hand"), "Back", -SLIDE))
    assert stage.run(10) == pytest.approx(0.4)
    before = stage.world.get(stage.player, Animation)
    stage.world.set(stage.player, Animation(clips=before.clips, clip="Back", time=before.time))
    assert stage.run(10) == pytest.approx(-0.8)
    stage.world.set(stage.player, Animation(clips=before.clips, clip="Run"))
    stage.run(2)
    (event,) = stage.simulation.take_events()
    assert event.kind == "animation"
    assert "there is no clip 'Run'" in event.values["text"]
    assert "'Slide', 'Back'" in event.values["text"]


def test_a_frame_tells_what_moves_and_comes_back_whole() -> None:
    stage = Stage()
    stage.world.spawn([Transform(position=(0.0, 5.0, 0.0)), RigidBody(), Collider()])
    stage.run(10)
    frame = unpack_frame(pack_frame(stage.frame()))
    assert frame.body_count == 1
    assert frame.local_entity.tolist() == [stage.hand]
    np.testing.assert_allclose(frame.local_position, [(0.4, 0.0, 0.0)], atol=1e-6)
    np.testing.assert_array_equal(frame.local_rotation, [(0.0, 0.0, 0.0, 1.0)])
    np.testing.assert_array_equal(frame.local_scale, [(1.0, 1.0, 1.0)])


@pytest.mark.parametrize("change", [lambda d: d[:-1], lambda d: d + b"\0", lambda d: d[:64], lambda d: d[:68]])
def test_a_frame_with_another_length_is_refused(change) -> None:
    with pytest.raises(MessageError, match="a state frame of 0 bodies"):
        unpack_frame(change(pack_frame(Stage().frame())))


def test_frames_without_animation_have_no_tail() -> None:
    simulation = Simulation()
    assert len(pack_frame(state_frame(simulation, epoch=1, delta_sequence=0, playing=False))) == HEADER.size


def test_who_is_no_longer_moved_is_told_of() -> None:
    stage = Stage()
    stage.run(10)
    stage.world.remove(stage.player, Animation)
    stage.simulation.step()
    told = {key for changes in stage.simulation.take_changes() for key in changes.set}
    assert (stage.hand, "Transform") in told
    assert not len(stage.frame().local_entity)


def test_switched_off_it_rests_and_a_new_tree_is_bound_anew() -> None:
    stage = Stage()
    stage.run(10)
    stage.world.set_enabled(stage.player, False)
    assert stage.run(10) == pytest.approx(0.4)
    stage.world.set_enabled(stage.player, True)
    assert stage.run(5) == pytest.approx(0.6)
    stage.world.despawn(stage.hand)
    stage.hand = stage.world.spawn([Transform()], name="Hand", parent=stage.arm)
    assert stage.run(5) == pytest.approx(0.8)


def test_names_that_nobody_has_are_told_of_once_and_the_rest_moves() -> None:
    both = Clip(name="", channels=slide(("Arm", "Hand")).channels + slide(("Leg", "Foot")).channels)
    stage = Stage(both)
    assert stage.run(10) == pytest.approx(0.4)
    (event,) = stage.simulation.take_events()
    assert "nobody below it at 'Leg/Foot'" in event.values["text"]


def test_physics_keeps_what_it_moves() -> None:
    stage = Stage()
    stage.world.add(stage.hand, RigidBody())
    stage.world.add(stage.hand, Collider())
    stage.run(5)
    assert stage.world.transforms.world_pose(stage.hand)[0][1] < 1.0  # it falls
    assert not len(stage.frame().local_entity)


def test_clips_that_cannot_be_had_are_told_of() -> None:
    stage = Stage()
    stage.world.set(stage.player, Animation(clips="blake2b:" + "0" * 32))
    stage.run(2)
    (event,) = stage.simulation.take_events()
    assert "plays nothing: there is no asset" in event.values["text"]


def test_many_players_of_one_clip_each_have_their_own_time() -> None:
    stage = Stage()
    clips = stage.world.get(stage.player, Animation).clips
    hands = []
    for number in range(5):
        player = stage.world.spawn([Transform(), Animation(clips=clips, time=0.1 * number)])
        arm = stage.world.spawn([Transform()], name="Arm", parent=player)
        hands.append(stage.world.spawn([Transform()], name="Hand", parent=arm))
    stage.run(5)
    found = [stage.world.get(hand, Transform).position[0] for hand in hands]
    assert found == pytest.approx([0.2 + 0.2 * number for number in range(5)], abs=1e-6)
