"""A body that is only put elsewhere, or given another velocity, stays the body it is: what rests on it goes on resting.

The plain way beside it is the whole component set anew, for which physics makes the body anew: both put it at the same place.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.components import Collider, Joint, RigidBody, Transform
from elys.common.ids import Entity
from elys.common.scene import SceneSettings
from elys.sim_node.simulation import Simulation

DT = 1.0 / 60.0
Put = Callable[[Simulation, Entity, tuple[float, ...], tuple[float, ...]], None]


def put_fields(simulation: Simulation, entity: Entity, position, rotation) -> None:
    simulation.world.set_fields(entity, Transform, {"position": position, "rotation": rotation})


def put_whole(simulation: Simulation, entity: Entity, position, rotation) -> None:
    simulation.world.set(entity, Transform(position=position, rotation=rotation))


def turned(degrees: float) -> tuple[float, ...]:
    return tuple(Rotation.from_euler("y", degrees, degrees=True).as_quat().tolist())


def pose(simulation: Simulation, entity: Entity) -> tuple[np.ndarray, np.ndarray]:
    row = int(np.flatnonzero(simulation.physics.bodies.entity == entity)[0])
    return simulation.physics.bodies.position[row].copy(), simulation.physics.bodies.rotation[row].copy()


def test_what_rides_on_a_driven_platform_goes_along_and_touches_it_once() -> None:
    simulation = Simulation()
    world = simulation.world
    platform = world.spawn([Transform(scale=(4.0, 0.5, 4.0)), RigidBody(motion="kinematic"), Collider()], name="Lift")
    rider = world.spawn([Transform(position=(0.0, 0.76, 0.0)), RigidBody(), Collider()], name="Crate")
    begun = 0
    for tick in range(240):
        speed = min(tick * DT, 1.0)
        world.set_fields(platform, RigidBody, {"linear_velocity": (speed, 0.0, 0.3 * speed)})
        simulation.step()
        begun += len(simulation.physics.event_changes.begun[0])
    row = simulation.physics.bodies.entity.tolist().index(rider)
    np.testing.assert_allclose(simulation.physics.bodies.linear_velocity[row], (1.0, 0.0, 0.3), atol=1e-4)
    assert begun == 1
    ground = pose(simulation, platform)[0]
    np.testing.assert_allclose(ground[0], sum(min(tick * DT, 1.0) for tick in range(240)) * DT, rtol=1e-6)


def test_telling_a_body_each_tick_what_it_does_already_changes_nothing() -> None:
    def stand(is_told: bool) -> np.ndarray:
        simulation = Simulation()
        world = simulation.world
        lift = [
            Transform(scale=(4.0, 0.5, 4.0)),
            RigidBody(motion="kinematic", linear_velocity=(0.5, 0.2, 0.0)),
            Collider(),
        ]
        lift = world.spawn(lift, name="Lift")
        for place in range(8):
            world.spawn([Transform(position=(0.0, 0.76 + 1.01 * place, 0.0)), RigidBody(), Collider()], name="Crate")
        for _ in range(120):
            if is_told:
                world.set_fields(lift, RigidBody, {"linear_velocity": (0.5, 0.2, 0.0)})
            simulation.step()
        return simulation.moving_bodies().position

    np.testing.assert_array_equal(stand(True), stand(False))


def test_who_sleeps_on_what_begins_to_move_wakes() -> None:
    simulation = Simulation()
    world = simulation.world
    platform = world.spawn([Transform(scale=(4.0, 0.5, 4.0)), RigidBody(motion="kinematic"), Collider()], name="Lift")
    rider = world.spawn([Transform(position=(0.0, 0.75, 0.0)), RigidBody(), Collider()], name="Crate")
    for _ in range(300):
        simulation.step()
    before = pose(simulation, rider)[0]
    for _ in range(60):
        world.set_fields(platform, RigidBody, {"linear_velocity": (0.0, 1.0, 0.0)})
        simulation.step()
    np.testing.assert_allclose(pose(simulation, rider)[0] - before, (0.0, 1.0, 0.0), atol=0.02)


@pytest.mark.parametrize("motion", ["dynamic", "kinematic", "static", None])
@pytest.mark.parametrize("place", ["alone", "below a turned group", "below a stretched group"])
def test_it_stands_where_a_body_made_anew_would(motion: str | None, place: str) -> None:
    """With a collider and a body of its own below it, which go along."""

    def stand(put: Put) -> list[np.ndarray]:
        simulation = Simulation()
        simulation.change_settings(SceneSettings(gravity=(0.0, 0.0, 0.0)))
        world = simulation.world
        stretch = (1.0, 1.0, 3.0) if place.endswith("stretched group") else (2.0, 2.0, 2.0)
        above = {"parent": world.spawn([Transform((1.0, 2.0, 3.0), turned(30.0), stretch)])} if place != "alone" else {}
        body = [RigidBody(motion=motion)] if motion else []
        thing = world.spawn([Transform(), Collider(), *body], name="Thing", **above)
        world.spawn([Transform((0.0, 2.0, 0.0)), Collider(shape="sphere")], name="Part", parent=thing)
        far = [Transform((0.0, 5.0, 1.0), turned(10.0)), RigidBody(), Collider()]
        below = world.spawn(far, name="Below", parent=thing)
        simulation.step()
        put(simulation, thing, (7.0, 1.0, -2.0), turned(50.0))
        simulation.step()
        hit = simulation.physics.raycast([[7.0, 30.0, -2.0]], [[0.0, -1.0, 0.0]], 100.0)
        return [*pose(simulation, thing), *pose(simulation, below), hit.distance]

    for light, anew in zip(stand(put_fields), stand(put_whole), strict=True):
        np.testing.assert_allclose(light, anew, atol=1e-6)


def test_a_joint_of_what_is_put_elsewhere_begins_anew() -> None:
    places = []
    for put in (put_fields, put_whole):
        simulation = Simulation()
        world = simulation.world
        post = world.spawn([Transform(), RigidBody(motion="static"), Collider()], name="Post")
        arm = [Transform((1.5, 0.0, 0.0)), RigidBody(), Collider(), Joint(kind="fixed", other=post)]
        held = world.spawn(arm, name="Arm")
        simulation.step()
        put(simulation, held, (1.5, 4.0, 0.0), turned(0.0))
        for _ in range(60):
            simulation.step()
        places.append(pose(simulation, held)[0])
    np.testing.assert_array_equal(*places)


def test_what_is_put_out_of_reach_is_left_out_and_comes_back() -> None:
    simulation = Simulation()
    box = simulation.world.spawn([Transform(), RigidBody(), Collider()], name="Box")
    simulation.step()
    put_fields(simulation, box, (0.0, 1e12, 0.0), turned(0.0))
    simulation.step()
    assert len(simulation.moving_bodies().entity) == 0
    put_fields(simulation, box, (0.0, 3.0, 0.0), turned(0.0))
    simulation.step()
    assert simulation.moving_bodies().position[0, 1] == pytest.approx(3.0, abs=0.01)


def test_a_moved_wall_is_met_where_it_is() -> None:
    simulation = Simulation()
    world = simulation.world
    floor = world.spawn([Transform((0.0, 0.0, 0.0), scale=(9.0, 1.0, 9.0)), Collider()], name="Floor")
    box = world.spawn([Transform((0.0, 1.0, 0.0)), RigidBody(), Collider()], name="Box")
    for _ in range(240):
        simulation.step()
    put_fields(simulation, floor, (0.0, -2.0, 0.0), turned(0.0))  # who slept on it falls
    for _ in range(240):
        simulation.step()
    assert pose(simulation, box)[0][1] == pytest.approx(-1.0, abs=0.01)
    assert math.isclose(world.get(floor, Transform).position[1], -2.0)
