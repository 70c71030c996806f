"""World transforms against a plain recursion of 4x4 matrices, over random trees with any scales."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elys.common.components import Transform
from elys.common.ids import NO_ENTITY
from elys.sim_node.ecs.world import World

EVEN = st.sampled_from([(1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (2.0, 2.0, 2.0)])
ANY_SCALE = st.one_of(
    EVEN, st.sampled_from([(1.0, 2.0, 0.5), (-1.0, 1.0, 1.0), (1.0, -2.0, 1.0), (3.0, 0.5, 1.5), (-1.0, -1.0, -1.0)])
)
seeds = st.integers(0, 2**32 - 1)


def random_tree(seed: int, count: int, scales: list[tuple[float, ...]]) -> tuple[World, list[int], list[int]]:
    """A world of entities under random earlier ones (or the ground), their ids and parents."""
    rng = np.random.default_rng(seed)
    world, entities, parents = World(capacity=2), [], []
    for index in range(count):
        parent = entities[rng.integers(index)] if index and rng.random() < 0.8 else NO_ENTITY
        transform = Transform(
            position=tuple(rng.normal(scale=10.0, size=3).tolist()),
            rotation=tuple(Rotation.random(random_state=rng).as_quat().tolist()),
            scale=scales[index % len(scales)],
        )
        has_transform = rng.random() < 0.9
        entities.append(world.spawn([transform] if has_transform else [], parent=parent))
        parents.append(parent)
    return world, entities, parents


def local_matrix(world: World, entity: int) -> np.ndarray:
    """The oracle's parent_from_local, of what the columns hold."""
    matrix = np.eye(4)
    table = world.table(Transform)
    row = table.row_of[entity & 0x3FFFFF]
    if row >= 0:
        rotation = Rotation.from_quat(table.column("rotation")[row].astype(np.float64)).as_matrix()
        matrix[:3, :3] = rotation @ np.diag(table.column("scale")[row].astype(np.float64))
        matrix[:3, 3] = table.column("position")[row]
    return matrix


def world_matrix(world: World, entity: int) -> np.ndarray:
    """The oracle's world_from_local: one parent after the other."""
    if entity == NO_ENTITY:
        return np.eye(4)
    return world_matrix(world, world.hierarchy.parent_of(entity)) @ local_matrix(world, entity)


def assert_all_agree(world: World) -> None:
    """Every cached world transform is the oracle's."""
    for entity in world.entities().tolist():
        expected = world_matrix(world, entity)[:3]
        np.testing.assert_allclose(
            world.transforms.world_from_local(entity), expected, rtol=1e-9, atol=1e-9 * (1 + np.abs(expected).max())
        )


def rotations_equal(a: np.ndarray, b: np.ndarray, tolerance: float = 2e-6) -> bool:
    """Whether quaternions turn alike (q and -q do)."""
    return bool(np.all(np.abs(np.abs(np.sum(a * b, axis=-1)) - 1.0) < tolerance))


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(1, 25), st.lists(ANY_SCALE, min_size=1, max_size=5))
def test_world_transforms_are_products_of_local_ones_after_any_edits(seed, count, scales):
    world, entities, _ = random_tree(seed, count, scales)
    assert_all_agree(world)
    rng = np.random.default_rng(seed)
    for _ in range(4):
        entity = entities[rng.integers(count)]
        match rng.integers(4):
            case 0 if world.has(entity, Transform):
                world.set(entity, Transform(position=tuple(rng.normal(size=3).tolist()), scale=scales[0]))
            case 1 if world.has(entity, Transform):
                world.remove(entity, Transform)
            case 2 if not world.has(entity, Transform):
                world.add(entity, Transform(position=(1.0, 2.0, 3.0)))
            case _:
                target = entities[rng.integers(count)]
                if target not in world.hierarchy.subtree_of(entity):
                    world.set_parent(entity, target, keep_world_pose=False)
        assert_all_agree(world)


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(2, 20), st.lists(EVEN, min_size=1, max_size=3))
def test_reparenting_keeps_the_world_transform_where_scales_are_even(seed, count, scales):
    world, entities, _ = random_tree(seed, count, scales)
    rng = np.random.default_rng(seed)
    for _ in range(4):
        entity, target = entities[rng.integers(count)], entities[rng.integers(count)]
        if not world.has(entity, Transform) or target in world.hierarchy.subtree_of(entity):
            continue
        before = world.transforms.world_from_local(entity)
        world.set_parent(entity, target)
        # Rotation and scale are stored in 32 bits, and multiplied down the chain.
        np.testing.assert_allclose(world.transforms.world_from_local(entity)[:, 3], before[:, 3], rtol=0, atol=1e-4)
        np.testing.assert_allclose(world.transforms.world_from_local(entity)[:, :3], before[:, :3], rtol=0, atol=2e-5)
        assert_all_agree(world)


@settings(max_examples=30, deadline=None)
@given(seeds, ANY_SCALE, ANY_SCALE)
def test_an_entity_can_go_under_a_parent_of_any_scale_and_out_again(seed, own_scale, parent_scale):
    rng = np.random.default_rng(seed)
    world = World()
    turned = tuple(Rotation.random(random_state=rng).as_quat().tolist())
    # The parent's axes are not turned against its own parent's, and the child's not against the parent's: no shear arises.
    parent = world.spawn([Transform(position=(1.0, 2.0, 3.0), rotation=turned, scale=parent_scale)])
    child = world.spawn([Transform(position=(4.0, 5.0, 6.0), rotation=turned, scale=own_scale)])
    before = world.transforms.world_from_local(child)
    world.set_parent(child, parent)
    np.testing.assert_allclose(world.transforms.world_from_local(child), before, rtol=0, atol=1e-5)
    world.unparent(child)
    np.testing.assert_allclose(world.transforms.world_from_local(child), before, rtol=0, atol=1e-5)


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(1, 20), st.lists(ANY_SCALE, min_size=1, max_size=4))
def test_set_world_poses_puts_entities_where_they_are_told_whatever_is_above_them(seed, count, scales):
    world, entities, _ = random_tree(seed, count, scales)
    rng = np.random.default_rng(seed)
    chosen = np.array([e for e in entities if world.has(e, Transform) and rng.random() < 0.6], np.uint32)
    rng.shuffle(chosen)
    positions = rng.normal(scale=20.0, size=(len(chosen), 3))
    rotations = (
        Rotation.random(len(chosen), random_state=rng).as_quat().astype(np.float32)
        if len(chosen)
        else np.zeros((0, 4), np.float32)
    )
    world.drain_changes()
    world.transforms.set_world_poses(chosen, positions, rotations)
    assert not world.drain_changes()
    poses = world.transforms.world_poses(chosen)
    np.testing.assert_allclose(poses.position, positions, rtol=0, atol=1e-7)
    assert rotations_equal(poses.rotation, rotations, 1e-4)
    assert_all_agree(world)
    is_root = np.array([world.hierarchy.parent_of(e) == NO_ENTITY for e in chosen.tolist()], bool)
    np.testing.assert_array_equal(poses.position[is_root], positions[is_root])
    np.testing.assert_array_equal(poses.rotation[is_root], rotations[is_root])


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(1, 20), st.lists(EVEN, min_size=1, max_size=3))
def test_world_rotation_and_scale_are_products_where_scales_are_even(seed, count, scales):
    world, entities, _ = random_tree(seed, count, scales)
    poses = world.transforms.world_poses(np.array(entities, np.uint32))
    for index, entity in enumerate(entities):
        matrix = world_matrix(world, entity)
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        np.testing.assert_allclose(poses.scale[index], scale, rtol=1e-5)
        expected = Rotation.from_matrix(matrix[:3, :3] / scale).as_quat()
        assert rotations_equal(poses.rotation[index], expected)
        np.testing.assert_allclose(poses.position[index], matrix[:3, 3], rtol=1e-9, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(2, 8))
def test_positions_hold_a_hundred_kilometres_away(seed, depth):
    rng = np.random.default_rng(seed)
    world, parent, expected = World(), NO_ENTITY, np.zeros(3)
    for _ in range(depth):
        position = rng.uniform(-1e5, 1e5, 3)
        expected = expected + position
        parent = world.spawn([Transform(position=tuple(position.tolist()))], parent=parent)
    np.testing.assert_allclose(world.transforms.world_from_local(parent)[:, 3], expected, rtol=0, atol=1e-9)
