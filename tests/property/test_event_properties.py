"""What holds for any sequence of events: nothing begins twice, nothing that did not begin ends, and a restored world agrees."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from elys.sim_node.physics import BOX, KINEMATIC, SPHERE, STATIC, PhysicsWorld

DT = 1.0 / 60.0
COUNT = 14
GROUND, ZONE, LIFT = 1, 2, 3
FIRST = 4

seeds = st.integers(0, 2**32 - 1)
# Something done to a body between two steps: which, what, and before which step.
edits = st.lists(
    st.tuples(
        st.integers(FIRST, FIRST + COUNT - 1),
        st.sampled_from(["remove", "put", "anew", "trigger", "push"]),
        st.integers(0, 79),
    ),
    max_size=8,
)


def build(seed):
    """Balls and boxes that fall onto a ground through a trigger, and a platform that moves among them."""
    rng = np.random.default_rng(seed)
    world = PhysicsWorld()
    world.add_bodies(
        [GROUND, ZONE, LIFT],
        motion=[STATIC, STATIC, KINEMATIC],
        position=[[0, -1, 0], [0, 1, 0], [-4, 0.8, 0]],
        linear_velocity=[[0, 0, 0], [0, 0, 0], [1.5, 0, 0]],
    )
    world.add_colliders(
        [GROUND, ZONE, LIFT], size=[[40, 2, 40], [3, 0.8, 3], [1, 0.3, 1]], trigger=[False, True, False]
    )
    for entity in range(FIRST, FIRST + COUNT):
        add(world, entity, rng.uniform([-1.5, 0.5, -1.5], [1.5, 4, 1.5]), rng)
    return world


def add(world, entity, position, rng, *, trigger=False):
    world.add_bodies([entity], position=[position], linear_velocity=[rng.normal(0, 1, 3)])
    kind = SPHERE if entity % 2 else BOX
    world.add_colliders([entity], shape=kind, size=[[0.6, 0.5, 0.7]], radius=0.3, restitution=0.3, trigger=trigger)


def edit(world, entity, what, rng):
    if not world.has([entity])[0]:
        add(world, entity, rng.uniform([-1, 1, -1], [1, 4, 1]), rng)
    elif what == "remove":
        world.remove_bodies([entity])
    elif what == "put":
        world.set_poses([entity], position=[rng.uniform([-1, 1, -1], [1, 4, 1])], rotation=[[0, 0, 0, 1]])
    elif what == "push":
        world.apply_impulse(entity, rng.normal(0, 3, 3))
    else:
        place = world.bodies.position[np.flatnonzero(world.bodies.entity == entity)[0]].copy()
        world.remove_bodies([entity])
        add(world, entity, place, rng, trigger=what == "trigger")


def rows(meetings):
    return list(zip(meetings[0].tolist(), meetings[1].tolist(), strict=True))


@settings(max_examples=25, deadline=None)
@given(seeds, edits)
def test_what_goes_on_is_what_began_and_did_not_end(seed, planned):
    world = build(seed)
    rng = np.random.default_rng(seed + 1)
    touching, inside = set(), set()
    for step in range(80):
        for entity, what, at in planned:
            if at == step:
                edit(world, entity, what, rng)
        world.step(DT)
        contacts, triggers = world.events
        for current, (begun, going_on, ended) in ((touching, contacts), (inside, triggers)):
            assert not current & set(rows(begun))
            assert set(rows(ended)) <= current | set(rows(begun))  # what went through a trigger has done both
            assert current - set(rows(ended)) == set(rows(going_on))
            current.update(rows(begun))
            current.difference_update(rows(ended))
        # Where something is told to touch or carries an impulse, and where a point says so, is the same.
        points = world.contacts
        assert set(rows(points)) <= {tuple(pair) for pair in touching}


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(0, 60), edits)
def test_a_restored_world_tells_the_same(seed, at, planned):
    world = build(seed)
    rng = np.random.default_rng(seed + 1)
    for _ in range(at):
        world.step(DT)
    for entity, what, _ in planned:
        edit(world, entity, what, rng)
    other = build(seed + 5)
    other.step(DT)
    other.restore(world.snapshot())
    for _ in range(25):
        world.step(DT)
        other.step(DT)
        for one, two in zip(
            (*world.events.contacts, *world.events.triggers),
            (*other.events.contacts, *other.events.triggers),
            strict=True,
        ):
            for mine, theirs in zip(one, two, strict=True):
                np.testing.assert_array_equal(mine, theirs)
