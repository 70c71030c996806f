from __future__ import annotations

import numpy as np
import pytest
from pyglm import glm

from elys.common.components import Transform
from elys.common.errors import ComponentError, EntityError
from elys.common.ids import NO_ENTITY
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.kernels import KERNELS

HALF_TURN = (0.0, 1.0, 0.0, 0.0)


def test_a_deep_chain_agrees_with_glm():
    world, parent, expected = World(), NO_ENTITY, glm.dmat4(1.0)
    rng = np.random.default_rng(1)
    for _ in range(50):
        rotation = rng.normal(size=4)
        rotation = (rotation / np.linalg.norm(rotation)).astype(np.float32).astype(float)
        position, scale = rng.normal(size=3), float(np.float32(rng.uniform(0.9, 1.1)))
        x, y, z, w = rotation
        expected = expected * glm.translate(glm.dvec3(*position))
        expected = expected * glm.mat4_cast(glm.normalize(glm.dquat(w, x, y, z))) * glm.scale(glm.dvec3(scale))
        transform = Transform(position=tuple(position), rotation=tuple(rotation), scale=(scale,) * 3)
        parent = world.spawn([transform], parent=parent)
    np.testing.assert_allclose(world.transforms.world_from_local(parent), np.array(expected)[:3], rtol=0, atol=1e-12)


def test_what_is_written_into_columns_shows_after_marking_dirty():
    world = World()
    parent = world.spawn([Transform()])
    child = world.spawn([Transform(position=(1.0, 0.0, 0.0))], parent=world.spawn(parent=parent))
    assert world.transforms.world_pose(child)[0] == (1.0, 0.0, 0.0)
    world.table(Transform).column("rotation")[0] = HALF_TURN
    assert world.transforms.world_pose(child)[0] == (1.0, 0.0, 0.0)
    world.transforms.mark_dirty(parent)
    assert world.transforms.world_pose(child) == ((-1.0, 0.0, 0.0), HALF_TURN, (1.0, 1.0, 1.0))


def test_a_mirrored_ancestor_turns_what_hangs_below_the_way_it_is_seen():
    world = World()
    mirror = world.spawn([Transform(scale=(-1.0, 1.0, 1.0))])
    quarter = (0.0, 0.0, 2**-0.5, 2**-0.5)
    child = world.spawn([Transform(rotation=quarter)], parent=mirror)
    _, rotation, scale = world.transforms.world_pose(child)
    assert rotation == pytest.approx((0.0, 0.0, -(2**-0.5), 2**-0.5)) and scale == pytest.approx((-1.0, 1.0, 1.0))
    assert world.transforms.world_pose(mirror) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (-1.0, 1.0, 1.0))


def test_flat_parents_do_no_harm():
    world = World()
    flat = world.spawn([Transform(scale=(1.0, 0.0, 1.0))])
    child = world.spawn([Transform(position=(1.0, 2.0, 3.0))], parent=flat)
    other = world.spawn([Transform(position=(4.0, 0.0, 0.0))])
    before = world.get(child, Transform)
    world.transforms.set_world_poses(np.array([child], np.uint32), np.ones((1, 3)), np.float32([[0, 0, 0, 1]]))
    assert world.get(child, Transform) == before
    world.set_parent(other, flat)
    for entity in (flat, child, other):
        position, rotation, scale = world.transforms.world_pose(entity)
        assert np.isfinite([*position, *rotation, *scale]).all()


def test_a_body_on_a_moving_body_ends_where_it_is_told():
    world = World()
    ship = world.spawn([Transform()])
    deck = world.spawn([Transform(position=(0.0, 1.0, 0.0))], parent=ship)
    crate, mast = (world.spawn([Transform(position=(0.0, 1.0, 0.0))], parent=deck) for _ in range(2))
    positions = np.array([[5.0, 5.0, 5.0], [100.0, 0.0, 0.0]])
    world.transforms.set_world_poses(
        np.array([crate, ship], np.uint32), positions, np.float32([[0, 0, 0, 1], HALF_TURN])
    )
    assert world.transforms.world_pose(crate)[:2] == ((5.0, 5.0, 5.0), (0.0, 0.0, 0.0, 1.0))
    assert world.transforms.world_pose(mast)[0] == (100.0, 2.0, 0.0)
    np.testing.assert_allclose(world.get(crate, Transform).position, (95.0, 4.0, -5.0), atol=1e-5)


def test_bulk_access_refuses_the_dead_and_the_placeless():
    world = World()
    bare, dead = world.spawn(name="Bare"), world.spawn([Transform()])
    world.despawn(dead)
    pose = (np.zeros((1, 3)), np.float32([[0, 0, 0, 1]]))
    with pytest.raises(ComponentError, match="entity 1 'Bare' has no Transform"):
        world.transforms.set_world_poses(np.array([bare], np.uint32), *pose)
    with pytest.raises(EntityError, match="entity 2 does not exist"):
        world.transforms.set_world_poses(np.array([dead], np.uint32), *pose)
    with pytest.raises(EntityError, match="entity 2 does not exist"):
        world.transforms.world_poses(np.array([bare, dead], np.uint32))
    assert world.transforms.world_affines(np.zeros(0, np.uint32)).shape == (0, 3, 4)


def test_listed_signatures_are_the_ones_that_are_called():
    compiled = [len(kernel.signatures) for _, kernel, _ in KERNELS]
    for _, kernel, signatures in KERNELS:
        for signature in signatures:
            kernel.compile(signature)
    world = World(capacity=2)
    parent = world.spawn([Transform()])
    children = world.spawn_many(100, {Transform: {}}, parent=parent)
    read_only = np.ones((100, 3))
    read_only.setflags(write=False)
    world.transforms.set_world_poses(children[::-1], read_only, np.tile(np.float64([0, 0, 0, 1]), (100, 1)))
    world.transforms.world_poses(children[::2])
    assert [len(kernel.signatures) for _, kernel, _ in KERNELS] == [max(count, 1) for count in compiled]
