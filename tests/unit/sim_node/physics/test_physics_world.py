"""What a world takes, refuses and tells."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.common.ids import entity_of
from elys.sim_node.physics import BOX, DYNAMIC, KINEMATIC, SPHERE, STATIC, PhysicsSettings, PhysicsWorld

DT = 1.0 / 60.0
WEIGHTLESS = PhysicsSettings(gravity=(0.0, 0.0, 0.0))
QUARTER_ABOUT_Z = [0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]


def test_bodies_are_in_the_order_of_their_indices_whatever_the_order_of_adding():
    world = PhysicsWorld()
    world.add_bodies([9, 2], position=[[9, 0, 0], [2, 0, 0]])
    world.add_bodies([5], position=[[5, 0, 0]])
    assert world.bodies.entity.tolist() == [2, 5, 9]
    assert world.bodies.position[:, 0].tolist() == [2.0, 5.0, 9.0]
    world.remove_bodies([5])
    assert world.bodies.entity.tolist() == [2, 9]
    assert world.has([2, 5, 9]).tolist() == [True, False, True]


def test_a_recycled_place_names_another_entity():
    world = PhysicsWorld()
    old, new = entity_of(3, 0), entity_of(3, 1)
    world.add_bodies([old])
    with pytest.raises(PhysicsError, match="predecessor"):
        world.add_bodies([new])
    world.remove_bodies([old])
    world.add_bodies([new])
    with pytest.raises(PhysicsError, match="entity 3 has no body"):
        world.set_velocities([old], linear=[[1, 0, 0]])


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"mass": [1.0, 0.0]}, r"mass must be above 0: entity 2 has 0"),
        ({"mass": [1.0, -4.0]}, r"mass must be above 0: entity 2 has -4"),
        ({"mass": np.nan}, r"mass must be finite: entity 1 has nan \(and 1 more\)"),
        ({"position": [[0, 0, 0], [0, np.inf, 0]]}, "position must be finite: entity 2"),
        ({"rotation": [0, 0, 0, 0.5]}, "rotation must be a unit quaternion x y z w: entity 1"),
        ({"linear_damping": -1.0}, "linear_damping must be at least 0"),
        ({"motion": 3}, "motion must be from 0 to 2"),
        ({"position": [1.0, 2.0]}, "position must be numbers of shape"),
    ],
)
def test_bad_bodies_are_refused_and_nothing_changes(values, sentence):
    world = PhysicsWorld()
    with pytest.raises(PhysicsError, match=sentence):
        world.add_bodies([1, 2], **values)
    assert world.body_count == 0


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"size": [1.0, 0.0, 1.0]}, "size must be above 0: entity 7"),
        ({"shape": SPHERE, "radius": -0.1}, "radius must be above 0: entity 7"),
        ({"friction": -0.5}, "friction must be at least 0"),
        ({"restitution": 1.5}, "restitution must be at most 1"),
        ({"position": [np.nan, 0.0, 0.0]}, "collider position must be finite"),
    ],
)
def test_bad_colliders_are_refused(values, sentence):
    world = PhysicsWorld()
    world.add_bodies([7])
    with pytest.raises(PhysicsError, match=sentence):
        world.add_colliders([7], **values)


def test_ids_are_checked():
    world = PhysicsWorld()
    with pytest.raises(PhysicsError, match="entity 4 is named twice"):
        world.add_bodies([4, 4])
    with pytest.raises(PhysicsError, match="0 is nobody"):
        world.add_bodies([0])
    with pytest.raises(PhysicsError, match="entity 8 has no body"):
        world.remove_bodies([8])
    with pytest.raises(PhysicsError, match="above 0 s"):
        world.step(0.0)


def test_settings_are_checked():
    with pytest.raises(PhysicsError, match="substeps must be from 1 to 64"):
        PhysicsSettings(substeps=0)
    with pytest.raises(PhysicsError, match="gravity must be three finite numbers"):
        PhysicsSettings(gravity=(0.0, math.nan, 0.0))


def test_an_offset_collider_moves_the_centre_of_mass_but_not_the_entity():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1], position=[1.0, 2.0, 3.0], rotation=QUARTER_ABOUT_Z, angular_velocity=[0.0, 0.0, 1.0])
    world.add_colliders([1], position=[2.0, 0.0, 0.0])
    np.testing.assert_allclose(world.bodies.position[0], [1.0, 2.0, 3.0], atol=1e-12)
    for _ in range(60):
        world.step(DT)
    # The centre of mass (1, 4, 3) stands still; the entity goes round it.
    turn = math.pi / 2 + 1.0
    np.testing.assert_allclose(
        world.bodies.position[0], [1.0 - 2.0 * math.cos(turn), 4.0 - 2.0 * math.sin(turn), 3.0], atol=1e-9
    )


def test_impulses_change_momentum_by_themselves():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1], mass=2.0, position=[1.0, 0.0, 0.0])
    world.add_colliders([1], size=[1.0, 2.0, 3.0])
    world.apply_impulse(1, [0.0, 4.0, 0.0], point=[2.0, 0.0, 0.5])
    momentum = world.momentum()
    np.testing.assert_allclose(momentum.linear, [0.0, 4.0, 0.0])
    np.testing.assert_allclose(momentum.angular, np.cross([2.0, 0.0, 0.5], [0.0, 4.0, 0.0]))
    world.apply_angular_impulse(1, [0.3, 0.0, 0.0])
    np.testing.assert_allclose(world.momentum().angular - momentum.angular, [0.3, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(world.bodies.linear_velocity[0], [0.0, 2.0, 0.0])


def test_only_dynamic_bodies_follow_impulses():
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[KINEMATIC, STATIC], linear_velocity=[1.0, 0.0, 0.0])
    world.add_colliders([1, 2], size=[0.1, 0.1, 0.1])
    world.apply_impulse(1, [5.0, 5.0, 5.0])
    world.step(DT)
    np.testing.assert_allclose(world.bodies.position, [[DT, 0.0, 0.0], [0.0, 0.0, 0.0]], atol=1e-15)


def test_a_kinematic_platform_carries_what_stands_on_it():
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[KINEMATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 0.5, 0]])
    world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]], friction=0.8)
    for _ in range(30):
        world.step(DT)
    world.set_velocities([1], linear=[1.0, 0.5, 0.0])
    for _ in range(60):
        world.step(DT)
    np.testing.assert_allclose(world.bodies.linear_velocity[1], [1.0, 0.5, 0.0], atol=2e-3)


@pytest.mark.parametrize("spin", [0.3, -2.0])  # slowly enough to keep manifolds over many ticks, and not
@pytest.mark.parametrize("platform", [1, 2])  # on either side of the pair
def test_a_turning_platform_carries_its_rider_on_a_circle(spin, platform):
    rider, radius, seconds = 3 - platform, 0.9, 5.0
    world = PhysicsWorld()
    world.add_bodies([platform], motion=KINEMATIC, position=[0, -0.25, 0], angular_velocity=[0, spin, 0])
    world.add_bodies(
        [rider], position=[radius, 0.1, 0], angular_velocity=[0, spin, 0], linear_velocity=[0, 0, -spin * radius]
    )
    world.add_colliders([platform, rider], size=[[4, 0.5, 4], [0.3, 0.2, 0.3]], friction=0.6)
    for _ in range(round(seconds / DT)):
        world.step(DT)
    angle = spin * seconds
    wanted = [radius * math.cos(angle), 0.1, -radius * math.sin(angle)]
    np.testing.assert_allclose(world.bodies.position[world.bodies.entity == rider][0], wanted, atol=5e-4)


def test_a_platform_carries_whatever_way_is_up():
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, -9.81)))
    world.add_bodies([1], motion=KINEMATIC, position=[0, 0, -0.25], angular_velocity=[0, 0, 1.5])
    world.add_bodies([2], position=[0, 1.0, 0.1], angular_velocity=[0, 0, 1.5], linear_velocity=[-1.5, 0, 0])
    world.add_colliders([1, 2], size=[[4, 4, 0.5], [0.3, 0.3, 0.2]], friction=0.6)
    for _ in range(240):
        world.step(DT)
    angle = 1.5 * 240 * DT
    wanted = [-math.sin(angle), math.cos(angle), 0.1]
    np.testing.assert_allclose(world.bodies.position[1], wanted, atol=5e-4)


@pytest.mark.parametrize("size", [(2.0, 0.02, 2.0), (3.0, 0.05, 0.4), (0.5, 0.5, 0.5)])
@pytest.mark.parametrize("height", [0.7, 1.9, 3.0])
def test_what_falls_flat_without_restitution_stays_down(size, height):
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, height, 0]])
    world.add_colliders([1, 2], size=[[20, 1, 20], size])
    highest = 0.0
    for tick in range(150):
        world.step(DT)
        if tick * DT > math.sqrt(2.0 * height / 9.81) + 2.0 * DT:
            highest = max(highest, world.bodies.position[1, 1] - 0.5 * size[1])
    assert highest < 4e-3  # [m]; a few sweeps over its points leave that much of a beam's 7.7 m/s
    assert abs(world.bodies.position[1, 1] - 0.5 * size[1]) < 1e-3


def test_damping_is_exponential():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies(
        [1], linear_velocity=[1, 0, 0], angular_velocity=[0, 2, 0], linear_damping=0.7, angular_damping=3.0
    )
    for _ in range(60):
        world.step(DT)
    assert world.bodies.linear_velocity[0, 0] == pytest.approx(math.exp(-0.7), rel=1e-6)
    assert world.bodies.angular_velocity[0, 1] == pytest.approx(2.0 * math.exp(-3.0), rel=1e-6)


def test_gravity_scale_and_changed_properties():
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], gravity_scale=[1.0, 0.0, -1.0])
    world.step(DT)
    np.testing.assert_allclose(world.bodies.linear_velocity[:, 1], [-9.81 * DT, 0.0, 9.81 * DT], rtol=1e-6)
    world.set_properties([1], motion=STATIC)
    assert world.bodies.linear_velocity[0, 1] == 0.0
    world.set_properties([1, 2], motion=DYNAMIC, gravity_scale=2.0)
    world.step(DT)
    np.testing.assert_allclose(world.bodies.linear_velocity[:2, 1], -2 * 9.81 * DT, rtol=1e-6)


def test_friction_is_the_geometric_mean_and_restitution_the_smaller_one():
    """A block pushed over the floor slows by mu g with mu = sqrt(0.2 * 0.8); a ball rebounds with the smaller e."""
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], motion=[STATIC, DYNAMIC, DYNAMIC], position=[[0, -0.5, 0], [0, 0.5, 0], [20, 1.5, 0]])
    world.add_colliders(
        [1, 2, 3],
        shape=[BOX, BOX, SPHERE],
        size=[[100, 1, 100], [1, 1, 1], [1, 1, 1]],
        friction=[0.2, 0.8, 0.0],
        restitution=[0.9, 0.0, 0.5],
    )
    for _ in range(30):
        world.step(DT)
    speed = 4.0
    world.set_velocities([2], linear=[speed, 0, 0])
    heights = []
    for _ in range(30):
        world.step(DT)
        heights.append(world.bodies.position[2, 1] - 0.5 + world.bodies.linear_velocity[2, 1] ** 2 / (2 * 9.81))
    assert world.bodies.linear_velocity[1, 0] == pytest.approx(speed - 0.4 * 9.81 * 0.5, rel=1e-3)
    assert heights[0] == pytest.approx(1.0 * 0.5**2, rel=1e-4)


def test_contacts_tell_where_and_how_hard():
    world = PhysicsWorld()
    world.add_bodies([3, 8], motion=[STATIC, DYNAMIC], mass=2.0, position=[[0, -0.5, 0], [0, 0.5, 0]])
    world.add_colliders([3, 8], size=[[20, 1, 20], [1, 1, 1]])
    for _ in range(120):
        world.step(DT)
    contacts = world.contacts
    assert contacts.entity_a.tolist() == [3] * 4
    assert contacts.entity_b.tolist() == [8] * 4
    np.testing.assert_allclose(contacts.normal, [[0, 1, 0]] * 4, atol=1e-9)
    np.testing.assert_allclose(np.sort(abs(contacts.point[:, [0, 2]])), 0.5, atol=1e-3)
    assert contacts.normal_impulse.sum() == pytest.approx(2.0 * 9.81 * DT, rel=1e-6)
    assert (contacts.depth > 0.0).all() and (contacts.depth < 1e-3).all()


def test_removing_what_supports_lets_fall_and_changing_motion_keeps_contacts_right():
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 0.5, 0]])
    world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]])
    for _ in range(30):
        world.step(DT)
    world.set_properties([2], motion=STATIC)
    world.step(DT)
    assert len(world.contacts.depth) == 0
    world.set_properties([2], motion=DYNAMIC)
    world.step(DT)
    assert len(world.contacts.depth) == 4
    world.remove_bodies([1])
    for _ in range(30):
        world.step(DT)
    assert world.bodies.position[0, 1] < -0.5


def test_a_teleported_body_leaves_its_contacts():
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 0.5, 0]])
    world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]])
    for _ in range(30):
        world.step(DT)
    world.set_poses([2], position=[0.0, 5.0, 0.0], rotation=QUARTER_ABOUT_Z)
    world.step(DT)
    assert len(world.contacts.depth) == 0
    np.testing.assert_allclose(world.bodies.rotation[1], QUARTER_ABOUT_Z, atol=1e-6)


def test_a_body_that_stops_being_finite_is_named_once_and_the_world_goes_on():
    world = PhysicsWorld()
    world.add_bodies([1, 2], position=[[0, 0, 0], [50, 0, 0]], linear_velocity=[[1e300, 0, 0], [0, 0, 0]])
    world.add_colliders([1, 2])
    world.set_velocities([1], linear=[1.7e308, 1.7e308, 0])
    for _ in range(5):
        world.step(10.0)
    problems = world.take_problems()
    assert [problem.entity for problem in problems] == [1]
    assert "entity 1 got numbers that are not finite" in problems[0].text
    assert world.take_problems() == []
    assert np.isfinite(world.bodies.position).all()
    assert world.bodies.position[1, 1] < -1.0


def test_a_profile_names_every_stage():
    world = PhysicsWorld(PhysicsSettings(forced=("solver", "triggers")))
    profile: dict[str, float] = {}
    world.step(DT, profile)
    assert list(profile) == [
        "place_bodies",
        "update_pairs",
        "update_manifolds",
        "build_islands",
        "colour_contacts",
        "prepare_bodies",
        "solve_contacts",
        "track_contacts",
        "finish_step",
        "track_triggers",
        "put_to_sleep",
    ]


def test_energy_of_a_thrown_spinning_body_is_kept():
    world = PhysicsWorld()
    world.add_bodies([1], mass=3.0, linear_velocity=[1, 5, 0], angular_velocity=[1, 2, 3])
    world.add_colliders([1], size=[1, 2, 3])
    before = sum(world.energy())
    for _ in range(120):
        world.step(DT)
    assert sum(world.energy()) == pytest.approx(before, rel=1e-9)
