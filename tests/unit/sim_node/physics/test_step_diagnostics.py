"""What a step has left, against sums over points of mass, boxes as inequalities and displacements that were made by hand."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import BOX, KINEMATIC, SPHERE, STATIC, Attractor, PhysicsSettings, PhysicsWorld
from tests.reference.naive_boxes import depth_of_overlap

DT = 1.0 / 60.0
GRAVITY = np.array([0.0, -9.81, 0.0])


class Piece(NamedTuple):
    """A box or ball of a body: mass [kg], place in the entity's space [m], half edges or radius [m]."""

    mass: float
    place: tuple[float, float, float]
    half: tuple[float, float, float] | float

    def points(self):
        """Points of equal mass (P, 3) with the second moments of the whole: a Gauss rule for squares, exact."""
        if isinstance(self.half, float):
            axes = self.half * math.sqrt(0.6) * np.eye(3)
            return np.asarray(self.place) + np.concatenate([axes, -axes])
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        return np.asarray(self.place) + signs * np.asarray(self.half) / math.sqrt(3.0)


def add(world, entity, pieces, **bodies):
    world.add_bodies([entity], mass=sum(piece.mass for piece in pieces), **bodies)
    for piece in pieces:
        is_ball = isinstance(piece.half, float)
        size = (1.0, 1.0, 1.0) if is_ball else 2.0 * np.asarray(piece.half)
        volume = 4.0 / 3.0 * math.pi * piece.half**3 if is_ball else float(np.prod(size))
        shape = {"shape": SPHERE, "radius": piece.half} if is_ball else {"shape": BOX, "size": size}
        world.add_colliders([entity], position=piece.place, density=piece.mass / volume, **shape)


def summed(world, pieces, attractors=()):
    """Kinetic and potential energy, momentum and angular momentum of all bodies in `pieces`, as sums over points."""
    kinetic = potential = 0.0
    momentum, angular = np.zeros(3), np.zeros(3)
    states = world.bodies
    for row, entity in enumerate(states.entity.tolist()):
        if entity not in pieces:
            continue
        parts = pieces[entity]
        center = sum(piece.mass * np.asarray(piece.place) for piece in parts) / sum(piece.mass for piece in parts)
        turn = Rotation.from_quat(states.rotation[row].astype(float))
        for piece in parts:
            points = piece.points()
            mass = piece.mass / len(points)
            place = states.position[row] + turn.apply(points)
            arm = turn.apply(points - center)
            velocity = states.linear_velocity[row].astype(float) + np.cross(
                states.angular_velocity[row].astype(float), arm
            )
            kinetic += 0.5 * mass * (velocity**2).sum()
            momentum += mass * velocity.sum(0)
            angular += mass * np.cross(place, velocity).sum(0)
        whole = sum(piece.mass for piece in parts)
        place = states.position[row] + turn.apply(center)
        potential -= whole * GRAVITY @ place
        for attractor in attractors:
            away = np.linalg.norm(place - attractor.position)
            potential -= whole * attractor.strength / math.hypot(away, attractor.softening)
    return kinetic, potential, momentum, angular


def assert_sums(world, pieces, attractors=()):
    found = world.diagnostics
    kinetic, potential, momentum, angular = summed(world, pieces, attractors)
    assert found.kinetic == pytest.approx(kinetic, rel=1e-6, abs=1e-9)
    assert found.potential == pytest.approx(potential, rel=1e-6)
    np.testing.assert_allclose(found.momentum, momentum, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.angular_momentum, angular, rtol=1e-6, atol=1e-5)
    return found


CUBE = [Piece(1.0, (0.0, 0.0, 0.0), (0.5, 0.5, 0.5))]


def test_energy_and_momentum_are_those_of_the_points_of_all_bodies():
    attractors = (Attractor(position=(3.0, -4.0, 2.0), strength=20.0, softening=0.5),)
    world = PhysicsWorld(PhysicsSettings(attractors=attractors))
    hammer = [Piece(2.0, (0.7, 0.1, 0.0), (0.2, 0.3, 0.4)), Piece(0.5, (-0.4, 0.0, 0.2), (0.6, 0.05, 0.05))]
    dumbbell = [Piece(3.0, (0.0, 0.6, 0.0), 0.3), Piece(1.0, (0.0, -0.6, 0.0), 0.2)]
    slab = [Piece(5.0, (0.0, 0.0, 0.0), (1.0, 0.1, 0.3))]
    turn = {"rotation": [0.1, 0.7, -0.1, math.sqrt(0.49)]}
    add(world, 3, hammer, position=[0, 6, 0], linear_velocity=[1, 2, 3], angular_velocity=[4, -1, 2], **turn)
    add(world, 1, dumbbell, position=[5, 4, -2], linear_velocity=[-2, 0, 1], angular_velocity=[1, 5, 3])
    add(world, 7, slab, position=[-4, 2, 1], angular_velocity=[0.1, 6, 0.1])
    pieces = {3: hammer, 1: dumbbell, 7: slab}
    world.add_bodies([20, 21], motion=[STATIC, KINEMATIC], position=[[0, -1, 0], [9, 0, 0]], mass=50.0)
    world.add_colliders([20], size=(60.0, 2.0, 60.0))
    world.set_velocities([21], linear=(1.0, 0.0, 0.0))
    assert_sums(world, pieces, attractors)  # before any step too
    for _ in range(40):
        world.step(DT)
        assert assert_sums(world, pieces, attractors).awake == 3
    assert world.diagnostics.contacts > 0
    world.settings = PhysicsSettings()
    assert_sums(world, pieces)


def test_bodies_that_sleep_keep_their_share():
    world = PhysicsWorld()
    world.add_bodies([100], motion=STATIC, position=[0, -1, 0])
    world.add_colliders([100], size=(60.0, 2.0, 60.0))
    pieces = {}
    for entity in range(1, 13):
        pieces[entity] = CUBE
        add(world, entity, CUBE, position=[3.0 * (entity % 4), 0.5 + entity // 4, 0.0])
    for _ in range(240):
        world.step(DT)
    assert assert_sums(world, pieces).awake == 0
    asleep = world.diagnostics
    assert asleep.contacts == 0 and asleep.kinetic == 0.0
    add(world, 50, CUBE, position=[-20, 9, 0], linear_velocity=[0, 0, 4])
    pieces[50] = CUBE
    for _ in range(60):
        world.step(DT)
        found = assert_sums(world, pieces)
        assert found.awake == found.islands == 1
        assert world.watch()[:4] == found[:4]
    world.settings = PhysicsSettings(gravity=(0.0, -19.62, 0.0))  # what is kept of sleepers is of another gravity now
    assert world.diagnostics.potential == pytest.approx(2.0 * found.potential)


def box_of(world, entity, size):
    states = world.bodies
    row = states.entity.tolist().index(entity)
    return states.position[row], states.rotation[row].astype(float), 0.5 * np.asarray(size)


def test_the_deepest_overlap_is_that_of_the_boxes_and_is_named():
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    sizes = {9: (20.0, 2.0, 20.0), 4: (1.0, 0.5, 1.0), 2: (1.5, 1.0, 0.8), 6: (1.0, 1.0, 1.0)}
    world.add_bodies(
        [9, 4, 2, 6],
        motion=[STATIC, 0, 0, 0],
        mass=[1, 1, 400, 1],
        position=[[0, -1, 0], [0, 0.25, 0], [0, 1, 0], [5, 0.5, 0]],
    )
    world.add_colliders([9, 4, 2, 6], size=list(sizes.values()))
    for _ in range(120):
        world.step(DT)
    found = world.diagnostics
    depths = {
        pair: 2.0 * depth_of_overlap(*(box_of(world, entity, sizes[entity]) for entity in pair))  # r on both sides
        for pair in ((9, 4), (4, 2), (9, 6))
    }
    deepest = max(depths, key=depths.__getitem__)
    assert set(found.deepest) == set(deepest)
    assert found.deepest_overlap == pytest.approx(depths[deepest], abs=2e-5) and found.deepest_overlap > 1e-4
    assert found.islands == 2


def test_the_residual_is_how_fast_a_corner_still_comes_nearer():
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    world.add_bodies([9, 4, 5], motion=[STATIC, 0, 0], position=[[0, -1, 0], [0, 0.5, 0], [4, 0.5, 0]])
    world.add_colliders([9, 4, 5], size=[(20.0, 2.0, 20.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)])
    for _ in range(120):
        world.step(DT)
    assert 0.0 <= world.diagnostics.residual < 1e-4
    world.set_velocities([4], linear=(0.0, -0.001, 0.0), angular=(0.002, 0.0, 0.0))
    found = world.diagnostics
    assert found.residual == pytest.approx(0.001 + 0.002 * 0.5, rel=1e-3)
    assert set(found.restless) == {9, 4}
    world.set_velocities([4], linear=(0.0, 0.5, 0.0), angular=(0.0, 0.0, 0.0))
    assert world.diagnostics.residual < 1e-4


@pytest.mark.parametrize(
    ("kind", "distance", "angle"),
    [
        ("fixed", 0.5, 0.3),
        ("ball", 0.5, 0.0),
        ("hinge", 0.5, math.acos(math.cos(0.3))),
        ("slider", 0.4, 0.3),
        ("distance", math.hypot(1.3, 0.4) - 1.0, 0.0),
        ("cone_twist", 0.5, 0.0),
    ],
)
def test_a_joint_is_off_by_as_much_as_its_bodies_were_moved(kind, distance, angle):
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies([1, 2], position=[[0, 0, 0], [1, 0, 0]])
    world.add_colliders([1, 2], position=[0.2, 0.1, 0.0], size=(0.4, 0.4, 0.6))  # centres of mass are not the entities'
    bodies = {"entity_a": 1, "entity_b": 2}
    if kind == "distance":
        world.add_joints([7], kind=kind, **bodies, anchor_a=[0, 0, 0], anchor_b=[0, 0, 0], lower=1.0, upper=1.0)
    elif kind in ("fixed", "ball"):
        world.add_joints([7], kind=kind, **bodies, anchor_a=[1, 0, 0])
    else:
        world.add_joints([7], kind=kind, **bodies, anchor_a=[1, 0, 0], axis_a=[1, 0, 0])
    still = world.diagnostics
    assert (still.joint_error, still.joint_angle_error) == pytest.approx((0.0, 0.0), abs=1e-9)
    turn = [0.0, math.sin(0.15), 0.0, math.cos(0.15)] if angle else [0.0, 0.0, 0.0, 1.0]
    world.set_poses([2], position=[1.3, 0.4, 0.0], rotation=turn)
    found = world.diagnostics
    assert found.joint_error == pytest.approx(distance, abs=1e-9) and found.joint == 7
    assert found.joint_angle_error == pytest.approx(angle, abs=1e-9) and found.turned_joint == (7 if angle else 0)
    world.remove_joints([7])
    assert world.diagnostics[8:12] == (0.0, 0.0, 0, 0)


def crowd():
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    rng = np.random.default_rng(5)
    count = 60
    grid = np.stack(np.meshgrid(range(4), range(4), range(4), indexing="ij"), axis=-1).reshape(-1, 3)[:count]
    world.add_bodies([500], motion=STATIC, position=[0, -1, 0])
    world.add_colliders([500], size=(40.0, 2.0, 40.0))
    position = grid * 1.05 + [0, 0.6, 0] + rng.uniform(-0.02, 0.02, (count, 3))
    world.add_bodies(np.arange(1, count + 1), position=position, mass=rng.uniform(0.5, 4.0, count))
    world.add_colliders(np.arange(1, count + 1))
    return world


def test_watching_finds_what_measuring_all_finds_and_changes_nothing():
    watched, alone = crowd(), crowd()
    for _ in range(150):
        watched.step(DT)
        alone.step(DT)
        watched.watch()
        watched.diagnostics  # noqa: B018  measured for its effects, which there shall be none of
    assert watched.state_hash() == alone.state_hash()
    deepest = []
    for _ in range(64):
        watched.step(DT)
        seen, whole = watched.watch(), watched.diagnostics
        deepest.append(whole.deepest_overlap)
        assert seen[:4] == whole[:4] and seen[-3:] == whole[-3:]
    assert whole.contacts > 64  # of which each step has looked at 16
    assert min(deepest) <= seen.deepest_overlap <= max(deepest)
    assert set(seen.deepest) == set(whole.deepest)


def test_islands_are_counted_anew_after_the_step_that_made_them():
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    world.add_bodies(
        [9, 1, 2, 3, 4],
        motion=[STATIC, 0, 0, 0, 0],
        position=[[0, -1, 0], [0, 0.5, 0], [0, 1.5, 0], [4, 0.5, 0], [8, 9, 0]],
    )
    world.add_colliders([9], size=(40.0, 2.0, 40.0))
    world.add_colliders([1, 2, 3, 4])
    world.step(DT)
    assert world.diagnostics.islands == 3
    world.add_bodies([5], position=[-6, 9, 0])
    assert world.diagnostics.islands == 0 and world.diagnostics.awake == 5
    world.step(DT)
    assert world.diagnostics.islands == 4
    world.settings = PhysicsSettings(sleeping=False, substeps=4)
    world.remove_bodies([2, 5])
    world.step(DT)
    assert world.diagnostics.islands == 3


def test_what_sleeps_is_measured_once_and_anew_after_every_change():
    world = PhysicsWorld()
    world.add_bodies(
        [9, 1, 2, 3], motion=[STATIC, 0, 0, 0], position=[[0, -1, 0], [0, 0.5, 0], [0, 1.5, 0], [4, 0.5, 0]]
    )
    world.add_colliders([9, 1, 2, 3], size=[(40.0, 2.0, 40.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)])
    for _ in range(240):
        world.step(DT)
        world.watch()
    assert world.watch().awake == 0
    last = world.watch()
    world.step(DT)
    assert world.watch() is last and last == world.diagnostics
    changes = (
        lambda: world.set_properties([1], mass=3.0),
        lambda: world.set_velocities([2], linear=(0.0, 0.0, 0.5)),
        lambda: world.set_poses([3], position=[4.0, 0.49, 0.0], rotation=[0.0, 0.0, 0.0, 1.0]),
        lambda: world.add_bodies([5], position=[9, 7, 0]),
        lambda: world.remove_bodies([5]),
        lambda: world.add_joints([7], kind="ball", entity_a=1, entity_b=3, anchor_a=[1, 0, 0], anchor_b=[0, 0, 0]),
        lambda: world.remove_bodies([9]),
    )
    for change in changes:
        last = world.watch()
        change()
        seen = world.watch()
        assert seen[:4] == world.diagnostics[:4]
        assert seen is not last
        for _ in range(3):
            world.step(DT)
            seen, whole = world.watch(), world.diagnostics
            assert (*seen[:4], *seen[8:]) == (*whole[:4], *whole[8:])
        for _ in range(240):
            world.step(DT)


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (1.0, 0.2, 2.0)])
def test_a_spinning_body_keeps_its_angular_momentum(size):
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies(
        [1], position=[3, -2, 1], mass=2.5, linear_velocity=(0.4, 1.0, -2.0), angular_velocity=(1.0, 2.0, -0.5)
    )
    world.add_colliders([1], size=size)
    moments = (
        2.5 / 12.0 * np.array([size[1] ** 2 + size[2] ** 2, size[0] ** 2 + size[2] ** 2, size[0] ** 2 + size[1] ** 2])
    )
    expected = np.cross([3, -2, 1], 2.5 * np.array([0.4, 1.0, -2.0])) + moments * [1.0, 2.0, -0.5]
    for _ in range(60):
        assert world.watch().angular_momentum == pytest.approx(expected, rel=1e-6)
        world.step(DT)
