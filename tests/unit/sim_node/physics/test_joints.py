"""What joints a world takes, refuses and tells."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.sim_node.physics import DYNAMIC, STATIC, PhysicsSettings, PhysicsWorld
from elys.sim_node.physics.joint_plan import JointPlan

DT = 1.0 / 60.0
WEIGHTLESS = PhysicsSettings(gravity=(0.0, 0.0, 0.0))


def run(world, steps):
    for _ in range(steps):
        world.step(DT)


def pair_of_boxes(settings=None, **joint):
    world = PhysicsWorld(settings)
    world.add_bodies([3, 8], position=[[0, 0, 0], [1.2, 0, 0]])
    world.add_colliders([3, 8])
    if joint:
        world.add_joints([5], entity_a=3, entity_b=8, anchor_a=[0.6, 0, 0], **joint)
    return world


def ragdoll(order=None):
    """A ring and a tail of boxes with all kinds of joints between them, falling onto the ground."""
    world = PhysicsWorld()
    entities = np.arange(1, 11)
    position = [[0, -1, 0], *([k * 1.1, 2.0 + 0.3 * k, 0.1 * k] for k in range(9))]
    world.add_bodies(entities, motion=[STATIC] + [DYNAMIC] * 9, position=position)
    world.add_colliders(entities, size=[[40, 2, 40]] + [[0.9, 0.5, 0.4]] * 9)
    joints = [
        {"kind": "ball"},
        {"kind": "hinge", "axis_a": [0, 0, 1], "lower": -0.5, "upper": 0.5, "motor_speed": 2.0, "motor_limit": 1.0},
        {"kind": "fixed"},
        {"kind": "slider", "lower": -0.1, "upper": 0.2, "spring_frequency": 3.0},
        {"kind": "distance", "anchor_b": [0, 0, 0], "lower": 0.2, "upper": 1.3},
        {"kind": "cone_twist", "swing_limit": 0.4, "lower": -0.2, "upper": 0.2},
        {"kind": "fixed", "frequency": 5.0, "damping_ratio": 0.5},
        {"kind": "hinge", "axis_a": [0, 1, 0]},
    ]
    for k in range(len(joints)) if order is None else order:
        world.add_joints([10 * k + 7], entity_a=k + 2, entity_b=k + 3, anchor_a=[0.55, 0, 0], **joints[k])
    world.add_joints([200], kind="gear", joint_a=17, joint_b=77, ratio=0.5)
    return world


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"kind": "glue"}, "joint 5 has the kind 'glue': it must be one of fixed, ball"),
        ({"kind": ["ball", "ball"]}, "kind must be one name or a row of 1"),
        ({"anchor_a": [0, np.nan, 0]}, "anchor_a must be finite: joint 5"),
        ({"kind": "hinge", "axis_a": [0, 0, 0]}, "axis_a must have a length: joint 5"),
        ({"kind": "hinge", "lower": 1.0, "upper": 0.5}, "lower must not be above upper: joint 5"),
        ({"frequency": -1.0}, "frequency must be at least 0: joint 5"),
        ({"break_force": -1.0}, "break_force must be at least 0: joint 5"),
        ({"swing_limit": 4.0}, "swing_limit must be at most 3.1: joint 5"),
        ({"colour": 3}, "'colour' cannot be said of joints"),
        ({"entity_a": 4}, "entity 4 has no body"),
        ({"entity_a": 8}, "joint 5 joins entity 8 with itself"),
        ({"kind": "gear", "joint_a": 6, "joint_b": 7}, "joint 5 is a gear on joint 6, which must be a hinge"),
    ],
)
def test_bad_joints_are_refused_and_nothing_changes(values, sentence):
    world = pair_of_boxes()
    with pytest.raises(PhysicsError, match=sentence):
        world.add_joints([5], **{"entity_a": 3, "entity_b": 8, **values})
    assert len(world.joints.joint) == 0


def test_ids_of_joints_are_checked():
    world = pair_of_boxes(kind="ball")
    with pytest.raises(PhysicsError, match="There is a joint 5 already"):
        world.add_joints([5], entity_b=3)
    with pytest.raises(PhysicsError, match="joint 6 is named twice"):
        world.add_joints([6, 6], entity_b=3)
    with pytest.raises(PhysicsError, match="There is no joint 9"):
        world.remove_joints([9])
    with pytest.raises(PhysicsError, match="There is no joint 9"):
        world.set_joints([9], motor_speed=1.0)
    with pytest.raises(PhysicsError, match="'entity_a' cannot be said of joints here"):
        world.set_joints([5], entity_a=3)


# ---------------------------------------------------------------- what there is


def test_joints_are_listed_by_id_and_go_with_their_bodies():
    world = ragdoll(order=[3, 1, 0, 2, 7, 6, 5, 4])
    assert world.joints.joint.tolist() == [7, 17, 27, 37, 47, 57, 67, 77, 200]
    assert world.joints.entity_a.tolist() == [2, 3, 4, 5, 6, 7, 8, 9, 0]
    world.remove_bodies([3])  # joints 7 and 17, and the gear on 17
    assert world.joints.joint.tolist() == [27, 37, 47, 57, 67, 77]
    world.add_bodies([1000, 3])
    run(world, 10)
    world.remove_joints([27])
    run(world, 10)
    assert world.joints.joint.tolist() == [37, 47, 57, 67, 77]
    assert np.isfinite(world.bodies.position).all()
    assert world.take_problems() == []


def test_a_joint_follows_the_entity_when_shapes_move_its_centre_of_mass():
    world = PhysicsWorld()
    world.add_bodies([1], position=[0.0, 0.0, 0.0])
    world.add_colliders([1], size=[0.2, 0.2, 0.2])
    world.add_joints([1], kind="ball", entity_b=1, anchor_a=[0.0, 1.0, 0.0])
    world.add_colliders([1], size=[0.4, 0.4, 0.4], position=[0.5, 0.0, 0.0])
    run(world, 120)
    # One point of the entity stays where it is.
    x, y, z, w = world.bodies.rotation[0].astype(float)
    up = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    np.testing.assert_allclose(world.bodies.position[0] + up, [0.0, 1.0, 0.0], atol=1e-4)
    assert abs(up[1] - 1.0) > 1e-3


def test_connected_bodies_collide_only_when_asked():
    """Two boxes that overlap push each other apart unless a joint holds them."""
    for settings in ({"kind": "ball"}, {"kind": "ball", "collide_connected": True}):
        world = PhysicsWorld(WEIGHTLESS)
        world.add_bodies([1, 2], position=[[0, 0, 0], [0.9, 0, 0]])
        world.add_colliders([1, 2])
        run(world, 1)
        assert world.touching_count == 1
        world.add_joints([1], entity_a=1, entity_b=2, anchor_a=[0.45, 0, 0], **settings)
        run(world, 1)
        assert world.touching_count == ("collide_connected" in settings)
        world.remove_joints([1])
        run(world, 1)
        assert world.touching_count == 1


def test_the_rows_of_unpaired_bodies_follow_when_bodies_come_and_go():
    world = pair_of_boxes(WEIGHTLESS, kind="fixed")
    world.add_bodies([1, 5], position=[[0, 9, 0], [0, 0.9, 0]])
    world.add_colliders([1, 5])
    run(world, 1)
    contacts = world.contacts
    assert set(zip(contacts.entity_a.tolist(), contacts.entity_b.tolist(), strict=True)) == {(3, 5)}
    world.remove_bodies([1])
    world.set_poses([8], position=[0.5, 0.0, 0.0], rotation=[0, 0, 0, 1])
    run(world, 1)
    contacts = world.contacts
    assert (3, 8) not in set(zip(contacts.entity_a.tolist(), contacts.entity_b.tolist(), strict=True))


def test_a_motor_that_is_switched_off_pushes_no_more():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1])
    world.add_colliders([1])
    world.add_joints([1], kind="hinge", entity_b=1, lower=-100.0, upper=100.0, motor_speed=100.0, motor_limit=1.0)
    run(world, 30)
    world.set_joints([1], motor_limit=0.0)
    run(world, 1)
    speed = world.joints.speed[0]
    run(world, 30)
    assert world.joints.speed[0] == pytest.approx(speed, rel=1e-9)
    assert world.joints.torque[0] == pytest.approx(0.0, abs=1e-9)


def test_a_joint_between_two_immovable_things_does_nothing():
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, STATIC], position=[[0, 0, 0], [1, 0, 0]])
    world.add_joints([1], kind="hinge", entity_a=1, entity_b=2, axis_a=[0, 0, 1], motor_speed=1.0, motor_limit=1.0)
    run(world, 3)
    assert world.joints.force[0] == 0.0
    world.set_properties([2], motion=DYNAMIC)
    run(world, 60)
    assert world.joints.force[0] == pytest.approx(9.81, rel=0.2)


def test_a_kinematic_body_leads_what_is_joined_to_it():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1, 2], motion=[1, DYNAMIC], position=[[0, 0, 0], [1, 0, 0]])
    world.add_colliders([1, 2], size=[0.4, 0.4, 0.4])
    world.add_joints([1], kind="fixed", entity_a=1, entity_b=2)
    world.set_velocities([1], linear=[0, 2.0, 0], angular=[0, 0, 1.0])
    run(world, 60)
    np.testing.assert_allclose(world.bodies.position[1], [math.cos(1.0), 2.0 + math.sin(1.0), 0.0], atol=1e-3)


def test_an_anchor_that_is_off_is_drawn_in_without_a_bang():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1], position=[3.0, 0.0, 0.0])
    world.add_colliders([1])
    world.add_joints([1], kind="ball", entity_b=1, anchor_a=[0, 0, 0], anchor_b=[0, 0, 0])
    run(world, 60)
    np.testing.assert_allclose(world.bodies.position[0], 0.0, atol=1e-6)
    assert np.linalg.norm(world.bodies.linear_velocity[0]) < 1e-6


# ---------------------------------------------------------------- the same bits


def test_the_order_of_adding_joints_changes_no_bit():
    one, two = ragdoll(), ragdoll(order=[6, 2, 0, 7, 3, 1, 5, 4])
    for _ in range(60):
        one.step(DT)
        two.step(DT)
        assert one.state_hash() == two.state_hash()


@pytest.mark.parametrize("at", [0, 1, 45])
def test_from_a_snapshot_joints_go_on_with_the_same_bits(at):
    world = ragdoll()
    run(world, at)
    other = pair_of_boxes(kind="ball")
    run(other, 3)
    other.restore(world.snapshot())
    for _ in range(60):
        world.step(DT)
        other.step(DT)
        assert other.state_hash() == world.state_hash()
    np.testing.assert_array_equal(other.joints.coordinate, world.joints.coordinate)
    np.testing.assert_array_equal(other.joints.force, world.joints.force)


def test_the_hash_tells_what_joints_remember():
    one, two = pair_of_boxes(kind="ball"), pair_of_boxes(kind="hinge")
    assert one.state_hash() == two.state_hash()  # the same bodies, and nothing has pushed yet
    snapshot = one.snapshot()
    snapshot["joints"]["impulse"][0, 1] = 1e-9
    two.restore(snapshot)
    assert one.state_hash() != two.state_hash()
    one.remove_joints([5])
    assert one.state_hash() == pair_of_boxes().state_hash()


def test_a_heap_of_jointed_boxes_comes_to_rest():
    world = ragdoll()
    world.set_joints([17], motor_limit=0.0)
    run(world, 900)
    assert world.take_problems() == []
    assert world.bodies.position[1:, 1].min() > -0.1
    assert abs(world.bodies.linear_velocity).max() < 0.05


# ---------------------------------------------------------------- the plan


def direct_solution(plan, matrix):
    """Eliminates block by block as the plan says, with blocks of one number: the factors' pattern must be complete."""
    matrix = matrix.copy()
    for column in plan.columns:
        p = column["joint"]
        others = plan.blocks["joint"][column["first"] : column["first"] + column["count"]]
        for a in others:
            for b in others:
                matrix[a, b] -= matrix[a, p] * matrix[p, b] / matrix[p, p]
        outside = np.setdiff1d(np.flatnonzero(matrix[:, p]), [p, *others, *_before(plan, column)])
        assert not len(outside)
    return matrix


def _before(plan, column):
    order = plan.columns["joint"].tolist()
    return order[: order.index(column["joint"])]


def test_a_plan_holds_every_block_that_elimination_fills():
    rng = np.random.default_rng(3)
    for count in (1, 5, 30):
        bodies = rng.integers(-1, count, (count, 2))
        plan = JointPlan(np.zeros(count, int), np.arange(count), bodies)
        shared = (bodies[:, None, :, None] == bodies[None, :, None, :]) & (bodies >= 0)[:, None, :, None]
        matrix = np.where(shared.any((2, 3)), rng.uniform(0.1, 0.2, (count, count)), 0.0) + 3.0 * np.eye(count)
        kept = plan.direct == 1
        matrix[~kept] = matrix[:, ~kept] = 0.0
        direct_solution(plan, matrix)


def test_a_chain_is_eliminated_without_a_new_block():
    count = 50
    bodies = np.stack([np.arange(count) - 1, np.arange(count)], axis=1)
    plan = JointPlan(np.zeros(count, int), np.arange(count), bodies)
    assert len(plan.blocks) == count - 1
    assert plan.direct.all()


def test_a_net_leaves_to_sweeps_what_would_fill_it():
    """Elimination of a grid of 40 x 40 would make hundreds of neighbours; the plan stays small."""
    cells = np.arange(1600).reshape(40, 40)
    bodies = np.concatenate(
        [
            np.stack([cells[:, :-1].ravel(), cells[:, 1:].ravel()], 1),
            np.stack([cells[:-1].ravel(), cells[1:].ravel()], 1),
        ]
    )
    plan = JointPlan(np.zeros(len(bodies), int), np.arange(len(bodies)), bodies)
    assert plan.columns["count"].max() <= 12
    assert 0.3 < plan.direct.mean() < 1.0


# ---------------------------------------------------------------- frames that are given


def turned_pair(angle, **joint):
    """Two boxes, the second turned by an angle about z, that pointed the same way at rest."""
    world = PhysicsWorld(WEIGHTLESS)
    turn = [0, 0, math.sin(angle / 2), math.cos(angle / 2)]
    world.add_bodies([3, 8], position=[[0, 0, 0], [1.2, 0, 0]], rotation=[[0, 0, 0, 1], turn])
    world.add_colliders([3, 8])
    world.add_joints(
        [5], entity_a=3, entity_b=8, anchor_a=[0, 0, 0], anchor_b=[0, 0, 0], rest_rotation=[0, 0, 0, 1], **joint
    )
    return world


@pytest.mark.parametrize("angle", [0.7, -3.0, 3.1])
@pytest.mark.parametrize("turns", [0, 3, -2])
def test_an_angle_is_counted_from_the_rotation_at_rest(angle, turns):
    whole = 2.0 * math.pi * turns
    world = turned_pair(angle, kind="hinge", axis_a=[0, 0, 1], turned=whole + 0.99 * angle)
    assert world.joints.coordinate[0] == pytest.approx(angle + whole, abs=1e-6)
    world.step(DT)
    assert world.joints.coordinate[0] == pytest.approx(angle + whole, abs=1e-6)


def test_a_fixed_joint_turns_its_bodies_to_the_rotation_at_rest():
    world = turned_pair(0.5, kind="fixed")
    run(world, 60)
    a, b = world.bodies.rotation
    assert abs(a @ b) == pytest.approx(1.0, abs=1e-6)


def test_a_rotation_at_rest_is_one():
    with pytest.raises(PhysicsError, match="rest_rotation must be a unit quaternion x y z w: joint 5 has"):
        pair_of_boxes(kind="fixed", rest_rotation=[1, 1, 0, 0])


# ---------------------------------------------------------------- soft locks


@pytest.mark.parametrize("kind", ["hinge", "slider", "cone_twist"])
@pytest.mark.parametrize(
    "drive",
    [
        {"lower": 0.0, "upper": 0.0},
        {"lower": -0.5, "upper": -0.5},
        {"lower": 0.0, "upper": 1.0},
        {"motor_speed": 2.0, "motor_limit": 100.0},
    ],
)
def test_what_acts_on_the_coordinate_does_not_fight_soft_locks(kind, drive):
    """An anchor off the centres of mass, struck: it stays as calm as the blow, the way to the limit and the motor make it."""
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1, 2], position=[[0, 0, 0], [1.5, 0.5, 0]])
    world.add_colliders([1, 2], size=(0.8, 0.5, 0.4))
    where = {"anchor_b": [-0.5, 0.45, -0.5], "axis_a": [-0.7, 0.1, -0.95]}
    world.add_joints([1], kind=kind, entity_a=1, entity_b=2, frequency=5.0, **where, **drive)
    world.apply_impulse([2], [0.0, 1.0, 1.0])
    for _ in range(180):
        world.step(DT)
        assert np.abs(world.bodies.angular_velocity).max() < 5.0
    coordinate, speed = world.joints.coordinate[0], world.joints.speed[0]
    if "motor_speed" in drive:
        assert speed == pytest.approx(2.0, abs=0.05)
    else:
        assert drive["lower"] - 0.01 <= coordinate <= drive["upper"] + 0.01


def test_a_joint_whose_numbers_are_none_spoils_one_step_and_no_more():
    world = PhysicsWorld()
    world.add_bodies([3, 8, 9], position=[[0, 0, 0], [1.2, 0, 0], [9, 0, 0]])
    world.add_colliders([3, 8, 9])
    world.add_joints([5], kind="hinge", entity_a=3, entity_b=8)
    world.step(DT)
    snapshot = world.snapshot()
    snapshot["joints"]["impulse"][0] = math.nan
    world.restore(snapshot)
    world.step(DT)
    assert {problem.entity for problem in world.take_problems()} == {3, 8}
    world.set_properties([3, 8], motion=DYNAMIC)
    run(world, 30)
    assert world.take_problems() == []
    height = world.bodies.position[:, 1]
    assert height[0] == pytest.approx(height[2], abs=0.2)  # they fall again, and joined
    assert np.isfinite(world.joints.force).all()
