"""Debug lines show what the tables hold: boxes where shapes are, normals where bodies touch, one colour an island."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.sim_node.physics import DYNAMIC, PLANE, SPHERE, STATIC, PhysicsWorld
from elys.sim_node.physics.debug_geometry import LINES, box_lines

DT = 1.0 / 60.0


def jointed_boxes(**joint):
    """Two boxes in the air, three metres apart, joined where a's anchor is."""
    world = PhysicsWorld()
    world.add_bodies([1, 2], position=[[0, 5, 0], [3, 5, 0]])
    world.add_colliders([1, 2])
    world.add_joints([7], entity_a=1, entity_b=2, anchor_a=[1, 0, 0], **joint)
    return world


def two_stacks(steps=5):
    """Two stacks of two cubes and a ball by itself in the air, on a ground."""
    world = PhysicsWorld()
    entities = np.arange(1, 7)
    position = [[0, -1, 0], [0, 0.5, 0], [0, 1.5, 0], [5, 0.5, 0], [5, 1.5, 0], [0, 9, 5]]
    world.add_bodies(entities, motion=[STATIC] + [DYNAMIC] * 5, position=position)
    size = [[40, 2, 40]] + [[1, 1, 1]] * 5
    world.add_colliders(entities, shape=[0, 0, 0, 0, 0, SPHERE], size=size, radius=0.25)
    for _ in range(steps):
        world.step(DT)
    return world


def test_a_box_has_twelve_edges_along_its_axes():
    lines = box_lines(np.array([[0.0, 0, 0, 1, 2, 3]]), np.array([7]), np.array([9]))
    assert lines.positions.shape == (12, 2, 3)
    assert lines.colors.tolist() == [7] * 12
    assert lines.entities.tolist() == [[9, 0]] * 12
    lengths = np.abs(lines.positions[:, 1] - lines.positions[:, 0])
    assert sorted(map(tuple, lengths.tolist())) == sorted([(1, 0, 0)] * 4 + [(0, 2, 0)] * 4 + [(0, 0, 3)] * 4)
    corners = {tuple(corner) for corner in lines.positions.reshape(-1, 3).tolist()}
    assert corners == {(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)}


def test_boxes_hold_the_shapes_and_fat_boxes_hold_the_boxes():
    world = two_stacks()
    boxes = world.debug_lines("boxes").positions.reshape(6, 24, 3)
    fat = world.debug_lines("fat_boxes").positions.reshape(6, 24, 3)
    np.testing.assert_allclose(boxes[0].min(0), [-20, -2, -20])
    np.testing.assert_allclose(boxes[1].max(0) - boxes[1].min(0), [1, 1, 1], atol=1e-3)
    assert (fat.min(1) < boxes.min(1)).all()
    assert (fat.max(1) > boxes.max(1)).all()
    assert world.debug_lines("boxes").colors.tolist() == [STATIC] * 12 + [DYNAMIC] * 60


def test_contacts_are_crosses_with_normals():
    world = two_stacks()
    lines = world.debug_lines("contacts")
    count = len(world.contacts.point)
    assert count == 16
    assert np.bincount(lines.colors).tolist() == [3 * count, count]
    normals = lines.positions[lines.colors == 1]
    np.testing.assert_allclose(normals[:, 0], world.contacts.point, atol=1e-6)
    along = (normals[:, 1] - normals[:, 0]) / 0.2
    np.testing.assert_allclose(along, world.contacts.normal, atol=1e-5)
    np.testing.assert_allclose(lines.values[lines.colors == 1], world.contacts.normal_impulse)
    np.testing.assert_array_equal(lines.values[: 3 * count : 3], lines.values[3 * count :])
    between = np.stack([world.contacts.entity_a, world.contacts.entity_b], axis=1)
    np.testing.assert_array_equal(lines.entities[3 * count :], between)
    np.testing.assert_array_equal(lines.entities[1 : 3 * count : 3], between)


@pytest.mark.parametrize("steps", [5, 90])
def test_each_island_has_its_own_number_and_colour(steps):
    world = two_stacks(steps)
    lines = world.debug_lines("islands")
    assert len(np.unique(lines.colors)) == 3
    boxes, island = lines.positions.reshape(5, 24, 3), lines.values[::12]
    assert lines.entities[::12].tolist() == [[entity, 0] for entity in range(2, 7)]
    assert island[0] == island[1] != island[2] == island[3] != island[4]
    tall = boxes[2:4].reshape(-1, 3)
    np.testing.assert_allclose([tall.min(0), tall.max(0)], [[4.5, 0, -0.5], [5.5, 2, 0.5]], atol=5e-3)


def test_what_sleeps_is_shown_in_the_colour_of_its_island():
    world = two_stacks()
    assert len(world.debug_lines("sleeping").positions) == 0
    for _ in range(60):
        world.step(DT)
    lines = world.debug_lines("sleeping")
    assert lines.colors.tolist() == [0] * 24 + [1] * 24


def test_axes_stand_in_the_centre_of_mass():
    world = PhysicsWorld()
    world.add_bodies([1], position=[[3, 4, 5]])
    world.add_colliders([1], size=[[2, 2, 2]], position=[[1, 0, 0]])
    lines = world.debug_lines("axes")
    assert lines.colors.tolist() == [0, 1, 2]
    np.testing.assert_allclose(lines.positions[:, 0], [[4, 4, 5]] * 3)
    np.testing.assert_allclose(
        np.linalg.norm(lines.positions[:, 1] - lines.positions[:, 0], axis=1), np.sqrt(3), rtol=1e-6
    )


@pytest.mark.parametrize("kind", LINES)
def test_an_empty_world_has_no_lines(kind):
    lines = PhysicsWorld().debug_lines(kind)
    assert lines.positions.shape == (0, 2, 3)
    assert lines.colors.shape == (0,)


def test_a_plane_has_no_box_and_new_bodies_none_yet():
    world = PhysicsWorld()
    world.add_bodies([1], motion=STATIC)
    world.add_colliders([1], shape=PLANE)
    world.step(DT)
    world.add_bodies([2])
    world.add_colliders([2])
    assert len(world.debug_lines("boxes").positions) == 0


def test_an_unknown_kind_is_refused():
    with pytest.raises(PhysicsError, match="boxes, fat_boxes"):
        PhysicsWorld().debug_lines("shadows")


def test_joints_reach_from_bodies_to_anchors_with_their_axis():
    lines = jointed_boxes(kind="hinge", axis_a=[0, 0, 1]).debug_lines("joints")
    assert lines.colors.tolist() == [0, 0, 1]
    assert lines.entities.tolist() == [[1, 2]] * 3
    np.testing.assert_allclose(lines.positions[0], [[0, 5, 0], [1, 5, 0]], atol=1e-6)
    np.testing.assert_allclose(lines.positions[1], [[3, 5, 0], [1, 5, 0]], atol=1e-6)
    np.testing.assert_allclose(np.abs(lines.positions[2, 1] - lines.positions[2, 0]), [0, 0, 0.6], atol=1e-6)


@pytest.mark.parametrize("kind", ["hinge", "cone_twist"])
def test_limits_of_angles_are_arcs_about_the_axis(kind):
    lines = jointed_boxes(kind=kind, axis_a=[0, 0, 1], lower=-0.5, upper=1.0).debug_lines("joints")
    arc = lines.positions[lines.colors == 2][1:17] - (1, 5, 0)
    np.testing.assert_allclose(np.linalg.norm(arc, axis=2), 0.3, atol=1e-6)
    np.testing.assert_allclose(arc[:, :, 2], 0.0, atol=1e-6)
    start, end = arc[0, 0], arc[-1, 1]
    turned = np.arctan2(np.cross(start, end)[2], start @ end)
    assert turned == pytest.approx(1.5, abs=1e-5)  # counter-clockwise about z, as the coordinate


def test_a_cone_has_a_rim_at_its_opening():
    lines = jointed_boxes(kind="cone_twist", axis_a=[0, 0, 1], swing_limit=0.4).debug_lines("joints")
    rim = lines.positions[lines.colors == 2] - (1, 5, 0)
    assert len(rim) == 16
    np.testing.assert_allclose(rim[:, :, 2], 0.3 * np.cos(0.4), atol=1e-6)


def test_limits_of_ways_are_lines():
    slide = jointed_boxes(kind="slider", axis_a=[0, 1, 0], lower=-1.0, upper=2.0).debug_lines("joints")
    np.testing.assert_allclose(slide.positions[slide.colors == 2], [[[1, 4, 0], [1, 7, 0]]], atol=1e-6)
    rope = jointed_boxes(kind="distance", upper=5.0).debug_lines("joints")
    np.testing.assert_allclose(rope.positions[rope.colors == 2], [[[1, 5, 0], [6, 5, 0]]], atol=1e-6)
    assert (rope.colors == 0).sum() == 3  # to both anchors, of which b's is in its middle, and from one to the other


def test_broken_joints_are_not_drawn_and_joined_bodies_are_one_island():
    world = jointed_boxes(kind="fixed", break_force=1.0)
    world.step(DT)
    assert len(world.debug_lines("joints").positions) == 2
    assert len(np.unique(world.debug_lines("islands").values)) == 1
    world.apply_impulse([2], [100.0, 0.0, 0.0])
    world.step(DT)
    assert [broken.joint for broken in world.take_broken_joints()] == [7]
    assert len(world.debug_lines("joints").positions) == 0
    world.step(DT)
    assert len(np.unique(world.debug_lines("islands").values)) == 2


def test_boxes_are_where_bodies_are_after_the_step_and_to_look_changes_nothing():
    def flying():
        world = PhysicsWorld()
        world.add_bodies([1], position=[[0, 5, 0]], linear_velocity=[[60.0, 0, 0]], gravity_scale=0.0)
        world.add_colliders([1])
        return world

    watched, alone = flying(), flying()
    for step in range(1, 4):
        watched.step(DT)
        alone.step(DT)
        for kind in LINES:
            watched.debug_lines(kind)
        boxes = watched.debug_lines("boxes").positions.reshape(-1, 3)
        np.testing.assert_allclose((boxes.min(0) + boxes.max(0)) / 2, [step, 5, 0], atol=1e-2)
        assert watched.state_hash() == alone.state_hash()
