"""How the coefficients of two colliders make that of a pair, measured by how a box slows down."""

from __future__ import annotations

import math

import pytest

from elys.common.errors import PhysicsError
from elys.sim_node.physics import PLANE, PhysicsSettings, PhysicsWorld

GRAVITY = 9.81
TIME = 0.5


@pytest.mark.parametrize(
    ("rule", "coefficient"),
    [
        ("geometric_mean", math.sqrt(0.1 * 0.4)),
        ("minimum", 0.1),
        ("maximum", 0.4),
        ("average", 0.25),
        ("multiply", 0.04),
    ],
)
def test_friction_follows_the_rule_of_the_world(rule, coefficient):
    world = PhysicsWorld(PhysicsSettings(friction_rule=rule))
    world.add_bodies([1, 2], motion=[2, 0], position=[[0, 0, 0], [0, 0.5, 0]], linear_velocity=[[0, 0, 0], [5, 0, 0]])
    world.add_colliders([1], shape=PLANE, friction=0.4)
    world.add_colliders([2], size=[4.0, 1.0, 4.0], friction=0.1)
    for _ in range(round(60 * TIME)):
        world.step(1 / 60)
    assert 5.0 - world.bodies.linear_velocity[1, 0] == pytest.approx(coefficient * GRAVITY * TIME, rel=0.02)


def test_a_rule_that_is_none_is_refused():
    with pytest.raises(PhysicsError, match=r"restitution_rule must be one of .*minimum.*, not 'least'"):
        PhysicsSettings(restitution_rule="least")
