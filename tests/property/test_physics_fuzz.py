"""Random scenes of extreme bodies, put into each other: nothing crashes, nothing stops being a number, and the bits are the same
however they are come by."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import (
    BOX,
    CAPSULE,
    CYLINDER,
    HEIGHT_FIELD,
    HULL,
    MESH,
    PLANE,
    SPHERE,
    STATIC,
    Attractor,
    PhysicsSettings,
    PhysicsWorld,
)

DT = 1.0 / 60.0
DYNAMIC_SHAPES = (BOX, SPHERE, CAPSULE, CYLINDER, HULL)
TETRAHEDRON = ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))


JOINTS = ("fixed", "ball", "hinge", "slider", "distance", "cone_twist", "motor")


def scene(
    seed: int,
    count: int,
    *,
    order: np.ndarray | None = None,
    extreme: bool = True,
    joints: int = 0,
    rigid: bool = False,
    rings: bool = False,
) -> PhysicsWorld:
    """`count` moving bodies over static ground of every kind, spawned in an order (count,); sizes and masses are log-uniform.

    `joints` of them are joined to others nearby, to the world or to the ground, softly or `rigid`; with `rings` also in rings.
    They are of more everyday sizes and masses then.
    """
    rng = np.random.default_rng(seed)
    settings = PhysicsSettings(
        gravity=tuple(rng.normal([0.0, -9.81, 0.0], 5.0)),
        attractors=(Attractor(position=(0.0, 5.0, 0.0), strength=20.0, softening=1.0),) if rng.random() < 0.3 else (),
        sleeping=bool(rng.random() < 0.5),
    )
    world = PhysicsWorld(settings)
    add_ground(world, rng)
    size = 10.0 ** rng.uniform(-2.0, 2.0 if extreme else 0.0, (count, 1)) * rng.uniform(0.3, 1.0, (count, 3))
    size = np.maximum(size, 0.01)
    if joints:  # joints between a gram and a kiloton, or on arms a thousand times their bodies, are another story
        size = rng.uniform(0.3, 1.0, (count, 3))
    spread = 0.5 * np.cbrt((size.prod(1)).sum()) + 1.0
    entities = np.arange(101, 101 + count)
    kinds = rng.choice(DYNAMIC_SHAPES, count)
    geometry = np.full(count, -1)
    for place in np.flatnonzero(kinds == HULL):
        geometry[place] = world.add_hull(rng.normal(0.0, 0.3, (12, 3)) * size[place])
    bodies = {
        "motion": rng.choice([0, 1], count, p=[0.95, 0.05]),
        "position": rng.normal([0.0, spread, 0.0], spread, (count, 3)),
        "rotation": Rotation.random(count, random_state=rng).as_quat(),
        "linear_velocity": rng.normal(0.0, 10.0, (count, 3)),
        "angular_velocity": rng.normal(0.0, 5.0, (count, 3)),
        "mass": 10.0 ** (rng.uniform(-0.5, 1.0, count) if joints else rng.uniform(-3.0, 6.0, count)),
        "locked": rng.random((count, 6)) < 0.03,
        "linear_damping": rng.choice([0.0, 0.5], count),
    }
    shapes = {
        "shape": kinds,
        "size": size,
        "radius": 0.5 * size[:, 0],
        "half_length": 0.5 * size[:, 1],
        "geometry": geometry,
        "friction": rng.uniform(0.0, 1.5, count),
        "restitution": rng.choice([0.0, 0.5, 1.0], count),
        "rolling_friction": rng.choice([0.0, 0.01], count),
        "spin_friction": rng.choice([0.0, 0.01], count),
    }
    for chosen in (np.arange(count),) if order is None else np.array_split(order, 3):
        world.add_bodies(entities[chosen], **{name: column[chosen] for name, column in bodies.items()})
        world.add_colliders(entities[chosen], **{name: column[chosen] for name, column in shapes.items()})
    world.set_forces(entities[: count // 10], force=rng.normal(0.0, 5.0, 3), torque=rng.normal(0.0, 1.0, 3))
    if joints:
        add_joints(world, np.random.default_rng([seed, 1]), entities, joints, order is not None, rigid, rings)
    return world


def add_joints(
    world: PhysicsWorld,
    rng: np.random.Generator,
    entities: np.ndarray,
    count: int,
    shuffled: bool,
    rigid: bool,
    rings: bool,
) -> None:
    """Joints of all kinds with random limits, springs, motors and loads at which they break, and gears between some."""
    described = []
    place = world.bodies.position[np.isin(world.bodies.entity, entities)]
    for k, b in enumerate(rng.choice(entities[4:], count, replace=False).tolist()):
        others = entities != b if rings else entities < b  # of which no joints close a ring
        near = entities[others][np.argsort(np.linalg.norm(place[others] - place[entities == b], axis=1))[:2]]
        a = int(rng.choice([0, 1, *near, *near]))
        kind = str(rng.choice(JOINTS))
        joint = {"kind": kind, "entity_a": a, "entity_b": b, "axis_a": rng.normal(0.0, 1.0, 3)}
        frequency = float(rng.choice([2.0, 5.0]))
        joint["frequency"] = 0.0 if rigid else frequency
        joint["collide_connected"] = bool(rng.random() < 0.3)
        joint["anchor_b"] = rng.normal(0.0, 0.5, 3)
        if rng.random() < 0.2:
            joint["rest_rotation"] = Rotation.random(random_state=rng).as_quat()
        if rng.random() < 0.4:
            lower = 1.0 if kind == "distance" else -rng.uniform(0.0, 1.0)
            joint |= {"lower": lower, "upper": lower + rng.choice([0.0, 1.0])}
        if rng.random() < 0.3:
            joint |= {"spring_frequency": rng.uniform(0.2, 20.0), "spring_damping": rng.uniform(0.0, 1.0)}
        if rng.random() < 0.3:
            joint |= {"motor_speed": rng.normal(0.0, 5.0), "motor_limit": 10.0 ** rng.uniform(-1.0, 3.0)}
        if kind == "motor":
            joint |= {"drive_velocity": rng.normal(0.0, 1.0, 6), "drive_force": 50.0, "drive_torque": 5.0}
        if rng.random() < 0.3:
            joint |= {"break_force": 10.0 ** rng.uniform(0.0, 4.0), "break_torque": 10.0 ** rng.uniform(0.0, 4.0)}
        described.append((1000 + 2 * k, joint))
    driven = [joint for joint, values in described if values["kind"] in ("hinge", "slider", "cone_twist")]
    gears = [(driven[k], driven[k + 1], rng.uniform(-2.0, 2.0)) for k in range(0, len(driven) - 1, 4)]
    for place in rng.permutation(count).tolist() if shuffled else range(count):
        joint, values = described[place]
        world.add_joints([joint], **values)
    for one, two, ratio in gears:
        world.add_joints([one + 1], kind="gear", joint_a=one, joint_b=two, ratio=ratio)


def add_ground(world: PhysicsWorld, rng: np.random.Generator) -> None:
    """A plane, and on it a wall, a hill of a mesh and a height field."""
    world.add_bodies([1, 2, 3, 4], motion=STATIC, position=[[0, -3, 0], [20, 0, 0], [0, -1, 0], [-40, -1, 0]])
    tip = [[-9, -1, -9], [9, -1, -9], [0, -1, 9], [0, 4, 0]]
    hill = world.add_mesh(tip, TETRAHEDRON)
    field = world.add_height_field(rng.uniform(-1.0, 1.0, (12, 14)), (30.0, 40.0))
    world.add_colliders(
        [1, 2, 3, 4],
        shape=[PLANE, BOX, MESH, HEIGHT_FIELD],
        size=(1.0, 10.0, 40.0),
        geometry=[-1, -1, hill, field],
    )


def assert_sound(world: PhysicsWorld) -> None:
    bodies = world.bodies
    for column in (bodies.position, bodies.rotation, bodies.linear_velocity, bodies.angular_velocity):
        assert np.isfinite(column).all()
    assert np.abs(np.linalg.norm(bodies.rotation, axis=1) - 1.0).max() < 1e-5
    assert [problem.text for problem in world.take_problems() if problem.cause == "not_finite"] == []


@pytest.mark.parametrize("seed", range(4))
def test_a_scene_stays_finite(seed, soak):
    world = scene(seed, 1000 if soak else 60)
    for _ in range(1000 if soak else 120):
        world.step(DT)
        assert_sound(world)


@pytest.mark.parametrize("seed", range(6))
def test_a_scene_full_of_joints_stays_finite(seed):
    world = scene(seed, 60, joints=30)
    for _ in range(120):
        world.step(DT)
        assert_sound(world)


@pytest.mark.parametrize("rings", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_rigid_joints_that_cannot_all_be_met_stay_finite(seed, rings):
    """Deep in each other, held by what moves apart, in rings that do not close: what happens to them is told, and ends."""
    world = scene(seed, 60, joints=30, rigid=True, rings=rings)
    for _ in range(120):
        world.step(DT)
        assert_sound(world)


@pytest.mark.parametrize("joints", [0, 30])
@pytest.mark.parametrize("seed", range(2))
def test_restoring_at_any_tick_gives_the_same_bits(seed, joints, soak):
    count, steps = (1000, 200) if soak else (60, 60)
    world = scene(seed, count, joints=joints)
    rng = np.random.default_rng(seed)
    ticks = set(rng.integers(1, steps, 5).tolist())
    kept, hashes = {}, []
    for tick in range(steps):
        if tick in ticks:
            kept[tick] = world.snapshot()
        world.step(DT)
        hashes.append(world.state_hash())
    for tick, snapshot in kept.items():
        other = PhysicsWorld(world.settings)
        other.restore(snapshot)
        for expected in hashes[tick : tick + 20]:
            other.step(DT)
            assert other.state_hash() == expected


@pytest.mark.parametrize("joints", [0, 30])
def test_the_order_of_spawning_does_not_matter(joints, soak):
    count, steps = (1000, 200) if soak else (60, 80)
    plain = scene(7, count, joints=joints)
    shuffled = scene(7, count, order=np.random.default_rng(1).permutation(count), joints=joints)
    for _ in range(steps):
        plain.step(DT)
        shuffled.step(DT)
        assert plain.state_hash() == shuffled.state_hash()


@pytest.mark.parametrize("joints", [0, 30])
def test_another_process_gives_the_same_bits(joints, soak):
    count, steps = (1000, 200) if soak else (60, 80)
    world = scene(11, count, joints=joints)
    for _ in range(steps):
        world.step(DT)
    assert int(run_elsewhere(f"run(11, {count}, {steps}, joints={joints}).state_hash()")) == world.state_hash()


def test_without_the_compiler_the_motion_is_the_same():
    world = run(5, 10, 12, extreme=False)
    printed = run_elsewhere("run(5, 10, 12, extreme=False).bodies.position.tolist()", NUMBA_DISABLE_JIT="1")
    interpreted = np.array(json.loads(printed))
    assert len(world.contacts.point) > 0
    np.testing.assert_allclose(interpreted, world.bodies.position, atol=1e-5)


def run(seed: int, count: int, steps: int, *, extreme: bool = True, joints: int = 0) -> PhysicsWorld:
    """A scene, some steps on."""
    world = scene(seed, count, extreme=extreme, joints=joints)
    for _ in range(steps):
        world.step(DT)
    return world


def run_elsewhere(expression: str, **environment: str) -> str:
    """What a fresh process prints for an expression of this module."""
    program = f"from tests.property.test_physics_fuzz import run; print({expression})"
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        env={**os.environ, "PYTHONPATH": str(root), **environment},
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout
