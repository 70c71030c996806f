"""Characters in time: the same again, rewound, forked, from other processes' states; and what frames and scenes hold of them."""

from __future__ import annotations

import numpy as np
import pytest

from elys.bus.messages.commands import Input
from elys.common.assets import AssetStore
from elys.common.components import Camera, CameraRig, Character, Collider, RigidBody, Transform
from elys.common.scene import open_scene
from elys.samples import write_sample
from elys.sim_node.character.kernels.tables import SKIN
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from elys.sim_node.systems.publish_state import state_frame
from tests.unit.sim_node.character.stage import Stage

KEYS = ("w", "a", "s", "d", "space", "left_shift", "left_control")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """The playground, opened."""
    path = tmp_path_factory.mktemp("playground") / "playground.scene.json"
    write_sample("playground", path)
    return lambda: Simulation.load(open_scene(path, assets := AssetStore()), assets)


def play(simulation: Simulation, seed: int, ticks: int) -> list[int]:
    """Keys and pointer by chance; the hash of every tick."""
    chance = np.random.default_rng(seed)
    hashes = []
    for _ in range(ticks):
        if chance.random() < 0.2:
            changes = ((str(chance.choice(KEYS)), bool(chance.random() < 0.6)),)
            moved = {"pointer_x": float(chance.integers(-80, 80)), "pointer_y": float(chance.integers(-20, 20))}
            simulation.inputs.take(Input(player=1, source="test", changes=changes, moved=moved))
        simulation.step()
        hashes.append(simulation.state_hash())
    return hashes


def test_the_same_keys_give_the_same_bits(scene):
    first, second = play(scene(), 5, 240), play(scene(), 5, 240)
    assert first == second
    assert len(set(first)) > 200


def test_rewinding_gives_the_same_bits(scene):
    simulation = scene()
    play(simulation, 1, 90)
    state = simulation.capture()
    ahead = play(simulation, 2, 120)
    simulation.restore(state)
    assert play(simulation, 2, 120) == ahead


def test_a_state_that_went_through_bytes_goes_on_the_same_elsewhere(scene):
    simulation, other = scene(), scene()
    play(simulation, 1, 90)
    data = simulation.capture().to_bytes()
    other.restore(State.from_bytes(data))
    assert play(other, 3, 60) == play(simulation, 3, 60)


def test_captures_do_not_change_what_happens(scene):
    watched, plain = scene(), scene()
    seen = []
    state = None
    for tick in range(60):
        seen += play(watched, tick, 2)
        state = watched.capture(state)
    assert seen == [value for tick in range(60) for value in play(plain, tick, 2)]


def test_a_scene_is_saved_as_it_was_edited():
    stage = Stage()
    stage.simulation.edited.capture()
    stage.step(60, wish=(1.0, 0.0, 0.0))
    columns = stage.simulation.edited.columns(stage.world.table(Character))
    assert columns["velocity"].tolist() == [[0.0, 0.0, 0.0]]
    assert columns["stature"].tolist() == [0.0]


def test_worlds_without_characters_have_the_systems_and_none_of_their_tables():
    simulation = Simulation()
    simulation.world.spawn([Transform(), RigidBody(), Collider()])
    simulation.step()
    assert not simulation._characters.is_needed
    assert not any("Character" in name and name.endswith("count") and value for name, value in _values(simulation))


def _values(simulation: Simulation):
    return list(simulation.capture().values.items())


# --- players and cameras


def hold(stage: Stage, *keys: str, **moved: float) -> None:
    stage.simulation.inputs.take(
        Input(player=1, source="test", changes=tuple((key, True) for key in keys), moved=dict(moved))
    )


def with_camera(**values) -> tuple[Stage, int]:
    stage = Stage(player=1)
    camera = stage.world.spawn([Transform(), Camera(), CameraRig(target=stage.one, player=1, **values)])
    return stage, camera


def test_keys_walk_where_the_camera_looks():
    stage, camera = with_camera(sensitivity=0.01)
    stage.step(3)
    hold(stage, "w", pointer_x=50.0)  # half a radian to the right
    stage.step(60)
    way = stage.place()
    assert stage.world.get(camera, CameraRig).yaw == pytest.approx(-0.5)
    assert way[[0, 2]] / np.hypot(*way[[0, 2]]) == pytest.approx((np.sin(0.5), -np.cos(0.5)), abs=1e-6)
    assert stage.walker().yaw == pytest.approx(-0.5)


def test_space_jumps_shift_runs_control_crouches_f_flies():
    stage, _ = with_camera()
    stage.step(3)
    hold(stage, "w", "left_shift")
    stage.step(40)
    assert np.linalg.norm(stage.walker().velocity) == pytest.approx(6.0)
    hold(stage, "space")
    stage.step(5)
    assert stage.place()[1] > 0.2
    stage.step(120)
    hold(stage, "left_control")
    stage.step(5)
    assert stage.walker().stature == pytest.approx(1.1)
    hold(stage, "f")
    stage.step(2)
    assert stage.walker().mode == "fly"


def test_a_camera_is_behind_over_the_shoulder_and_told_in_frames():
    stage, camera = with_camera(distance=4.0, height=1.6, shoulder=0.5, pitch=0.0, follow_rate=0.0)
    stage.step(5)
    assert stage.place(camera) == pytest.approx((0.5, 1.6 + SKIN, 4.0), abs=1e-6)
    frame = state_frame(stage.simulation, epoch=1, delta_sequence=0, playing=True)
    assert frame.local_entity.tolist() == [camera]
    assert frame.local_position[0] == pytest.approx((0.5, 1.6 + SKIN, 4.0), abs=1e-5)


def test_in_first_person_it_is_where_the_eyes_are_and_sinks_with_them():
    stage, camera = with_camera(view="first", height=1.6, follow_rate=0.0)
    stage.step(5)
    assert stage.place(camera) == pytest.approx((0.0, 1.6 + SKIN, 0.0), abs=1e-6)
    hold(stage, "left_control")
    stage.step(2)
    assert stage.place(camera) == pytest.approx((0.0, 0.9 + SKIN, 0.0), abs=1e-6)


def test_a_camera_never_goes_through_a_wall_and_comes_back_little_by_little():
    stage, camera = with_camera(distance=4.0, shoulder=0.0, pitch=0.0, radius=0.2, return_rate=6.0)
    wall = stage.box((20.0, 6.0, 0.1), (0.0, 3.0, 1.55))
    stage.step(30)
    assert stage.place(camera)[2] == pytest.approx(1.5 - 0.2, abs=2e-3)
    stage.world.despawn(wall)
    path = []
    for _ in range(120):
        stage.step()
        path.append(stage.place(camera)[2])
    steps = np.diff([1.3, *path])
    assert 0.0 < steps.max() < 0.3
    assert path[-1] == pytest.approx(4.0, abs=0.01)


def test_it_looks_up_and_down_within_its_limits():
    stage, camera = with_camera(least_pitch=-1.0, most_pitch=0.8, sensitivity=0.01)
    hold(stage, pointer_y=-1000.0)
    stage.step()
    assert stage.world.get(camera, CameraRig).pitch == pytest.approx(0.8)
    hold(stage, pointer_y=1000.0)
    stage.step()
    assert stage.world.get(camera, CameraRig).pitch == pytest.approx(-1.0)


def test_a_camera_turns_with_the_platform():
    stage = Stage(floor=False, at=(0.5, 1.0 + SKIN, 0.0))
    stage.box((8.0, 0.4, 8.0), (0.0, 0.8, 0.0), body=RigidBody(motion="kinematic", angular_velocity=(0.0, 0.5, 0.0)))
    camera = stage.world.spawn([Transform(), Camera(), CameraRig(target=stage.one)])
    stage.step(10)
    before = stage.world.get(camera, CameraRig).yaw
    stage.step(60)
    assert stage.world.get(camera, CameraRig).yaw - before == pytest.approx(0.5, abs=1e-6)


def test_a_camera_follows_what_is_no_character_and_says_where_it_has_stopped():
    simulation = Simulation()
    world = simulation.world
    ball = world.spawn([Transform(), RigidBody(motion="kinematic", linear_velocity=(1.0, 0.0, 0.0)), Collider()])
    rig = world.spawn([Transform(), Camera(), CameraRig(target=ball, shoulder=0.0)], name="Rig")
    for _ in range(60):
        simulation.step()
    (place,), (entity,) = simulation.animated().local_position.tolist(), simulation.animated().local_entity.tolist()
    assert entity == rig and place[0] == pytest.approx(1.0, abs=1e-5) and place[2] > 3.0
    simulation.take_changes()
    world.remove(rig, CameraRig)
    simulation.step()
    told = {key for changes in simulation.take_changes() for key in changes.set}
    assert (rig, "Transform") in told
    np.testing.assert_allclose(world.get(rig, Transform).position, place, atol=1e-6)
    assert not len(simulation.animated().local_entity)
