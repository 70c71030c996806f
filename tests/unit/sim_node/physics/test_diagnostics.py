"""What goes wrong is named, with its cause and what to do, and the world goes on calmly."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.sim_node.physics import BOX, SPHERE, STATIC, PhysicsSettings, PhysicsWorld

DT = 1.0 / 60.0


def told(world, cause):
    return [problem for problem in world.take_problems() if problem.cause == cause]


@pytest.mark.parametrize("mass", [0.0, -1.0, np.nan])
def test_a_mass_that_cannot_be_is_refused_by_name(mass):
    with pytest.raises(PhysicsError, match=r"mass must be .*: entity 4"):
        PhysicsWorld().add_bodies([3, 4], mass=[1.0, mass])


def test_an_inertia_that_no_body_has_is_refused_by_name():
    world = PhysicsWorld()
    with pytest.raises(PhysicsError, match=r"triangle inequality.*: entity 2 has"):
        world.add_bodies([1, 2], inertia=[[1.0, 1.0, 2.0], [1.0, 1.0, 2.1]])
    world.add_bodies([1], inertia=[1.0, 1.0, 2.0], mass=5.0)
    world.add_colliders([1])  # shapes do not change what was asked for
    world.set_velocities([1], angular=(1.0, 0.0, 1.0))
    assert world.energy().kinetic == pytest.approx(1.5)


def test_locks_that_are_no_truth_values_are_refused():
    with pytest.raises(PhysicsError, match="locked must be 6 truth values"):
        PhysicsWorld().add_bodies([1], locked=(True, False))


def test_a_speed_over_the_limit_is_told_once_until_it_is_below_again():
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0), max_linear_speed=100.0, max_angular_speed=50.0))
    world.add_bodies([1, 2], position=[[0, 0, 0], [0, 50, 0]], linear_velocity=[[300.0, 0, 0], [99.0, 0, 0]])
    world.step(DT)
    (problem,) = world.take_problems()
    assert (problem.entity, problem.cause) == (1, "too_fast") and "max_linear_speed = 100 m/s" in problem.text
    np.testing.assert_allclose(world.bodies.linear_velocity[:, 0], [100.0, 99.0], rtol=1e-6)
    world.set_forces([1], force=(1e4, 0.0, 0.0))
    for _ in range(5):
        world.step(DT)
    assert world.take_problems() == []
    world.set_forces([1])
    world.set_velocities([1], linear=(10.0, 0.0, 0.0))
    world.step(DT)
    world.set_velocities([1], linear=(500.0, 0.0, 0.0), angular=(0.0, 60.0, 0.0))
    world.step(DT)
    assert [problem.entity for problem in told(world, "too_fast")] == [1]
    assert np.linalg.norm(world.bodies.angular_velocity[0]) == pytest.approx(50.0)


def test_a_deep_overlap_at_spawn_is_named_and_resolved_calmly():
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    world.add_bodies(
        [1, 2, 3, 4], motion=[STATIC, 0, 0, 0], position=[[0, -0.5, 0], [0, 0.5, 0], [0.1, 0.9, 0.1], [9, 0.45, 0]]
    )
    world.add_colliders([1, 2, 3, 4], size=[[50, 1, 50], [1, 1, 1], [1, 1, 1], [1, 1, 1]])
    fastest = 0.0
    for _ in range(180):
        world.step(DT)
        fastest = max(fastest, float(np.linalg.norm(world.bodies.linear_velocity, axis=1).max()))
    problems = told(world, "deep_overlap")
    assert len(problems) == 1 and problems[0].entity in (2, 3) and "entity 2" in problems[0].text
    assert fastest < 3.5  # push_speed, and a little falling
    assert world.contacts.depth.max() < 0.002


def test_what_falls_onto_others_is_no_overlap():
    world = PhysicsWorld()
    world.add_bodies(
        [1, 2], motion=[STATIC, 0], position=[[0, -0.5, 0], [0, 3.0, 0]], linear_velocity=(0.0, -20.0, 0.0)
    )
    world.add_colliders([1, 2], shape=[BOX, SPHERE], size=(20.0, 1.0, 20.0))
    for _ in range(120):
        world.step(DT)
    assert world.take_problems() == []


def test_an_explosion_is_named():
    # A push against overlap that is far too strong.
    world = PhysicsWorld(PhysicsSettings(push_speed=1e4, contact_damping=0.0))
    world.add_bodies([1, 2, 3], motion=[STATIC, 0, 0], position=[[0, -0.5, 0], [0, 0.0, 0], [0, 0.2, 0]])
    world.add_colliders([1, 2, 3], size=[[50, 1, 50], [1, 1, 1], [1, 1, 1]])
    world.step(DT)
    (problem,) = told(world, "explosion")
    assert problem.entity == 3 and "kinetic energy" in problem.text


def test_a_bat_that_hits_a_ball_is_no_explosion():
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], motion=[1, 0, STATIC], position=[[-2, 0.5, 0], [0, 0.5, 0], [0, -0.5, 0]])
    world.add_colliders(
        [1, 2, 3], shape=[BOX, SPHERE, BOX], size=[[1, 1, 1], [1, 1, 1], [200, 1, 200]], restitution=0.9
    )
    world.set_velocities([1], linear=(40.0, 0.0, 0.0))
    for _ in range(60):
        world.step(DT)
    assert world.bodies.linear_velocity[1, 0] > 60.0
    assert world.take_problems() == []


@pytest.mark.parametrize(
    "settings", [{"on_problem": "stop"}, {"max_linear_speed": -1.0}, {"max_angular_speed": np.inf}]
)
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(PhysicsError, match=next(iter(settings))):
        PhysicsSettings(**settings)
