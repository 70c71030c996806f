"""Contacts begin, go on and end; visitors enter triggers, stay and leave. Each is told once, whatever becomes of the bodies."""

from __future__ import annotations

import numpy as np
import pytest

from elys.sim_node.physics import (
    BOX,
    DYNAMIC,
    KINEMATIC,
    MESH,
    NOTICES_ALL,
    NOTICES_MOVING,
    PLANE,
    SPHERE,
    STATIC,
    PhysicsSettings,
    PhysicsWorld,
)

DT = 1.0 / 60.0
GROUND, BALL, ZONE = 1, 2, 3
WEIGHTLESS = PhysicsSettings(gravity=(0.0, 0.0, 0.0))


def pairs_of(meetings):
    """The two entities of each row."""
    return list(zip(meetings[0].tolist(), meetings[1].tolist(), strict=True))


def told(world, *, steps):
    """What each of some steps began and ended, as (step, what, one, other)."""
    seen = []
    for step in range(steps):
        world.step(DT)
        for what, meetings in world.event_changes._asdict().items():
            seen += [(step, what, *pair) for pair in pairs_of(meetings)]
    return seen


def kinds(seen):
    return [what for _, what, *_ in seen]


def ball_over_ground(*, height, restitution=0.0, ground=BOX, **body):
    world = PhysicsWorld()
    world.add_bodies([GROUND, BALL], motion=[STATIC, DYNAMIC], position=[[0, 0, 0], [0, height, 0]], **body)
    world.add_colliders([GROUND], shape=ground, size=[[20, 2, 20]], position=[[0, -1 if ground == BOX else 0, 0]])
    world.add_colliders([BALL], shape=SPHERE, radius=0.5)
    if restitution:
        world.set_colliders([GROUND], shape=ground, size=[[20, 2, 20]], position=[[0, -1, 0]], restitution=restitution)
        world.set_colliders([BALL], shape=SPHERE, radius=0.5, restitution=restitution)
    return world


def ball_before_zone(*, velocity=(2.0, 0.0, 0.0), motion=DYNAMIC, zone_motion=STATIC, trigger=NOTICES_MOVING):
    """A ball 2 m before a trigger box of 1 m, without weight."""
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies(
        [BALL, ZONE],
        motion=[motion, zone_motion],
        position=[[-2, 0, 0], [0, 0, 0]],
        linear_velocity=[velocity, [0, 0, 0]],
    )
    world.add_colliders([BALL], shape=SPHERE, radius=0.25)
    world.add_colliders([ZONE], shape=BOX, size=[[1, 1, 1]], trigger=trigger)
    return world


# ---------------------------------------------------------------- triggers


@pytest.mark.parametrize(("motion", "zone_motion"), [(DYNAMIC, STATIC), (KINEMATIC, STATIC), (DYNAMIC, KINEMATIC)])
def test_a_ball_enters_a_trigger_stays_and_leaves_when_their_surfaces_say_so(motion, zone_motion):
    world = ball_before_zone(motion=motion, zone_motion=zone_motion)
    seen, stays = [], []
    for step in range(120):
        world.step(DT)
        triggers = world.events.triggers
        seen += [(step, what, *pair) for what in ("entered", "exited") for pair in pairs_of(getattr(triggers, what))]
        stays += [step] * len(triggers.stayed.trigger)
    # Surfaces meet after 1.25 m and part after 2.75 m, at 2 m/s: the first step that ends beyond.
    enter = int(np.floor(1.25 / 2.0 * 60))
    leave = int(np.floor(2.75 / 2.0 * 60))
    assert seen == [(enter, "entered", ZONE, BALL), (leave, "exited", ZONE, BALL)]
    assert stays == list(range(enter + 1, leave))


def test_a_trigger_pushes_nothing_and_its_events_are_no_contacts():
    world = ball_before_zone()
    for _ in range(120):
        world.step(DT)
        assert world.touching_count == 0
        assert not len(world.events.contacts.persisting.entity_a)
    np.testing.assert_allclose(world.bodies.position[0], [2.0, 0, 0], atol=1e-5)
    np.testing.assert_array_equal(world.bodies.linear_velocity[0], [2.0, 0, 0])


def test_what_is_near_a_trigger_is_not_in_it():
    world = ball_before_zone(velocity=(0.0, 0.0, 0.0))
    world.set_poses([BALL], position=[[-0.7505, 0, 0]], rotation=[[0, 0, 0, 1]])
    assert told(world, steps=3) == []
    world.set_poses([BALL], position=[[-0.7495, 0, 0]], rotation=[[0, 0, 0, 1]])
    assert told(world, steps=3) == [(0, "entered", ZONE, BALL)]


def test_what_is_put_elsewhere_leaves():
    world = ball_before_zone(velocity=(0.0, 0.0, 0.0))
    world.set_poses([BALL], position=[[0, 0, 0]], rotation=[[0, 0, 0, 1]])
    assert kinds(told(world, steps=2)) == ["entered"]
    world.set_poses([BALL], position=[[500, 0, 0]], rotation=[[0, 0, 0, 1]])
    assert told(world, steps=2) == [(0, "exited", ZONE, BALL)]


@pytest.mark.parametrize("gone", [BALL, ZONE])
def test_a_body_that_is_removed_inside_leaves(gone):
    world = ball_before_zone(velocity=(0.0, 0.0, 0.0))
    world.set_poses([BALL], position=[[0, 0, 0]], rotation=[[0, 0, 0, 1]])
    told(world, steps=2)
    world.remove_bodies([gone])
    assert told(world, steps=2) == [(0, "exited", ZONE, BALL)]


def test_a_body_that_is_made_anew_inside_stays():
    world = ball_before_zone(velocity=(0.0, 0.0, 0.0))
    world.set_poses([BALL], position=[[0, 0, 0]], rotation=[[0, 0, 0, 1]])
    told(world, steps=2)
    world.remove_bodies([BALL])
    world.add_bodies([BALL])
    world.add_colliders([BALL], shape=SPHERE, radius=0.3)
    assert told(world, steps=2) == []
    assert pairs_of(world.events.triggers.stayed) == [(ZONE, BALL)]


def test_a_sleeping_body_stays_in_a_trigger():
    world = ball_over_ground(height=0.5)
    world.add_bodies([ZONE], motion=STATIC, position=[[0, 0.5, 0]])
    world.add_colliders([ZONE], size=[[2, 2, 2]], trigger=True)
    seen = told(world, steps=120)
    assert [row[1:] for row in seen] == [("begun", GROUND, BALL), ("entered", ZONE, BALL)]
    assert world._activity.body_count == 0  # it sleeps
    events = world.events
    assert pairs_of(events.triggers.stayed) == [(ZONE, BALL)]
    assert pairs_of(events.contacts.persisting) == [(GROUND, BALL)]
    world.apply_impulse(BALL, [0, 20, 0])
    assert kinds(told(world, steps=30)) == ["ended", "exited"]


def test_a_trigger_wakes_nobody():
    world = ball_over_ground(height=0.5)
    world.add_bodies([ZONE], motion=KINEMATIC, position=[[5, 0.5, 0]], linear_velocity=[[-2, 0, 0]])
    world.add_colliders([ZONE], size=[[2, 2, 2]], trigger=True)
    seen = told(world, steps=240)
    assert [row[1:] for row in seen] == [("begun", GROUND, BALL), ("entered", ZONE, BALL), ("exited", ZONE, BALL)]
    assert world._bodies.rows["asleep"][1] == 1
    np.testing.assert_allclose(world.bodies.position[1], [0, 0.5, 0], atol=2e-3)


@pytest.mark.parametrize(
    ("motion", "trigger", "notices"),
    [
        (KINEMATIC, NOTICES_MOVING, False),
        (KINEMATIC, NOTICES_ALL, True),
        (DYNAMIC, NOTICES_MOVING, False),
        (DYNAMIC, NOTICES_ALL, True),
    ],
)
def test_a_trigger_notices_what_is_static_where_that_is_chosen(motion, trigger, notices):
    world = ball_over_ground(height=0.5)
    world.add_bodies([ZONE], motion=motion, position=[[5, 0.5, 0]], gravity_scale=0.0)
    world.add_colliders([ZONE], size=[[2, 2, 2]], trigger=trigger)
    entered = [row[2:] for row in told(world, steps=3) if row[1] == "entered"]
    assert entered == ([(ZONE, GROUND)] if notices else [])


@pytest.mark.parametrize("offset", [0.0, 0.5, 1.5])
@pytest.mark.parametrize("zone", ["box", "mesh", "moving"])
def test_a_bullet_through_a_thin_trigger_has_entered_and_left(zone, offset):
    world = PhysicsWorld(WEIGHTLESS)
    motion, velocity = (KINEMATIC, [-150, 0, 0]) if zone == "moving" else (STATIC, [0, 0, 0])
    world.add_bodies(
        [BALL, ZONE],
        motion=[DYNAMIC, motion],
        position=[[-5, offset, 0], [0, 0, 0]],
        linear_velocity=[[150, 0, 0], velocity],
    )
    world.add_colliders([BALL], shape=SPHERE, radius=0.02)
    if zone == "mesh":
        vertices, triangles = floor(4)
        turned = vertices[:, [1, 0, 2]] * [1, 0.25, 0.25]  # 2 m square, across the way
        world.add_colliders([ZONE], shape=MESH, geometry=world.add_mesh(turned, triangles), trigger=True)
    else:
        world.add_colliders([ZONE], size=[[0.01, 2, 2]], trigger=True)
    seen = told(world, steps=10)
    assert [row[1:] for row in seen] == ([("entered", ZONE, BALL), ("exited", ZONE, BALL)] if offset < 1.0 else [])
    assert world.bodies.linear_velocity[0].tolist() == [150, 0, 0]


def test_triggers_do_not_notice_one_another():
    world = ball_before_zone()
    world.set_colliders([BALL], shape=SPHERE, radius=0.25, trigger=True)
    assert told(world, steps=120) == []


def test_a_trigger_has_no_mass():
    world = ball_before_zone()
    before = world.snapshot()["inertia"][0]
    world.add_colliders([BALL], shape=BOX, size=[[30, 1, 1]], position=[[9, 0, 0]], trigger=True)
    np.testing.assert_array_equal(world.snapshot()["inertia"][0], before)
    np.testing.assert_array_equal(world.snapshot()["poses"]["center"][0], [0, 0, 0])


def test_a_mesh_as_a_trigger_is_one_trigger():
    vertices, triangles = floor(8)
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies(
        [ZONE, BALL], motion=[STATIC, DYNAMIC], position=[[0, 0, 0], [0, 2, 0]], linear_velocity=[[0, 0, 0], [0, -2, 0]]
    )
    world.add_colliders([ZONE], shape=MESH, geometry=world.add_mesh(vertices, triangles), trigger=True)
    world.add_colliders([BALL], shape=BOX, size=[[2.3, 1, 1.7]])
    assert [row[1:] for row in told(world, steps=50)] == [("entered", ZONE, BALL)]


# ---------------------------------------------------------------- contacts


def floor(count):
    """A flat square of 8 m in 2 count^2 triangles."""
    x, z = np.meshgrid(np.linspace(-4, 4, count + 1), np.linspace(-4, 4, count + 1), indexing="ij")
    vertices = np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3)
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    right, below = corner + 1, corner + count + 1
    return vertices, np.concatenate([np.stack([corner, right, below], 1), np.stack([right, below + 1, below], 1)])


def test_each_bounce_begins_and_ends_with_the_impulse_that_turned_the_ball():
    world = ball_over_ground(height=2.0, restitution=0.8, mass=[1.0, 3.0])
    bounces = 0
    seen = []
    speed = np.sqrt(2 * 9.81 * 1.5)
    for _ in range(150):
        before = world.bodies.linear_velocity[1, 1].copy()
        world.step(DT)
        changes = world.event_changes
        seen += ["begun"] * len(changes.begun.entity_a) + ["ended"] * len(changes.ended.entity_a)
        if not len(changes.begun.entity_a):
            continue
        begun = changes.begun
        dv = world.bodies.linear_velocity[1, 1] - before
        np.testing.assert_allclose(begun.normal_impulse, [3.0 * (dv + 9.81 * DT)], rtol=1e-5)
        np.testing.assert_allclose(begun.normal, [[0, 1, 0]], atol=1e-6)
        np.testing.assert_allclose(begun.speed, [speed], rtol=2e-3)
        np.testing.assert_allclose(begun.point, [[0, 0, 0]], atol=0.05)
        assert pairs_of(begun) == [(GROUND, BALL)]
        assert pairs_of(begun[2:4]) == [(GROUND, BALL)]
        speed *= 0.8
        bounces += 1
    assert bounces >= 3
    assert seen == ["begun", "ended"] * (len(seen) // 2) + ["begun"] * (len(seen) % 2)


def test_nothing_begins_within_the_margin():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([GROUND, BALL], motion=[STATIC, DYNAMIC], position=[[0, -1, 0], [0, 0.51, 0]])
    world.add_colliders([GROUND, BALL], shape=[BOX, SPHERE], size=[[20, 2, 20], [1, 1, 1]], radius=0.5)
    assert told(world, steps=5) == []
    assert world.touching_count == 1


@pytest.mark.parametrize("ground", [BOX, PLANE])
def test_a_contact_goes_on_with_the_weight_it_carries(ground):
    world = ball_over_ground(height=0.5, ground=ground, mass=[1.0, 2.0])
    assert kinds(told(world, steps=20)) == ["begun"]
    persisting = world.events.contacts.persisting
    assert pairs_of(persisting) == [(GROUND, BALL)]
    np.testing.assert_allclose(persisting.normal_impulse, [2.0 * 9.81 * DT], rtol=1e-3)
    np.testing.assert_allclose(persisting.point, [[0, 0, 0]], atol=2e-3)


def test_a_contact_is_either_begun_or_goes_on():
    world = ball_over_ground(height=0.5)
    world.step(DT)
    contacts = world.events.contacts
    assert pairs_of(contacts.begun) == [(GROUND, BALL)]
    assert pairs_of(contacts.persisting) == []


@pytest.mark.parametrize(
    "end",
    [
        lambda world: world.remove_bodies([GROUND]),
        lambda world: world.remove_bodies([BALL]),
        lambda world: world.remove_colliders([BALL]),
        lambda world: world.set_colliders([GROUND], size=[[20, 2, 20]], position=[[0, -1, 0]], layer=2, mask=2),
        lambda world: world.set_poses([BALL], position=[[0, 50, 0]], rotation=[[0, 0, 0, 1]]),
        lambda world: world.set_poses([GROUND], position=[[0, -50, 0]], rotation=[[0, 0, 0, 1]]),
        lambda world: world.set_velocities([BALL], linear=[[0, 200, 0]]),
    ],
    ids=["ground removed", "ball removed", "collider removed", "layers", "ball put", "ground put", "shot away"],
)
@pytest.mark.parametrize("asleep", [False, True])
def test_a_contact_ends_once_however_it_ends(end, asleep):
    world = ball_over_ground(height=0.5)
    told(world, steps=120 if asleep else 5)
    assert (world._activity.body_count == 0) == asleep
    end(world)
    assert [row[1:] for row in told(world, steps=4)] == [("ended", GROUND, BALL)]


def test_a_collider_that_becomes_a_trigger_ends_its_contact_and_is_entered():
    world = ball_over_ground(height=0.499)
    told(world, steps=5)
    world.set_colliders([GROUND], size=[[20, 2, 20]], position=[[0, -1, 0]], trigger=True)
    assert told(world, steps=2) == [(0, "ended", GROUND, BALL), (0, "entered", GROUND, BALL)]


def test_a_body_that_changes_its_motion_keeps_its_contacts():
    world = ball_over_ground(height=0.5)
    told(world, steps=5)
    world.set_properties([GROUND], motion=[KINEMATIC])
    assert told(world, steps=3) == []
    assert pairs_of(world.events.contacts.persisting) == [(GROUND, BALL)]


def test_a_box_that_slides_over_a_mesh_has_one_contact():
    vertices, triangles = floor(20)
    world = PhysicsWorld()
    world.add_bodies(
        [GROUND, BALL],
        motion=[STATIC, DYNAMIC],
        position=[[0, 0, 0], [-3, 0.5, 0.1]],
        linear_velocity=[[0, 0, 0], [3, 0, 0.5]],
    )
    world.add_colliders([GROUND], shape=MESH, geometry=world.add_mesh(vertices, triangles), friction=0.05)
    world.add_colliders([BALL], size=[[1.1, 1, 0.9]], friction=0.05)
    seen = told(world, steps=60)
    assert [row[1:] for row in seen] == [("begun", GROUND, BALL)]
    persisting = world.events.contacts.persisting
    assert pairs_of(persisting) == [(GROUND, BALL)]
    np.testing.assert_allclose(persisting.normal_impulse, [9.81 * DT], rtol=0.02)
    world.set_velocities([BALL], linear=[[0, 300, 0]])
    assert kinds(told(world, steps=2)) == ["ended"]


def test_a_contact_is_handed_from_one_triangle_of_a_mesh_to_another():
    """From the floor to the wall, which was within the margin before: the two stay one contact."""
    floor_corners = [[-4, 0, -8], [-4, 0, 8], [4, 0, -8]]
    wall_corners = [[0.51, -1, -9], [0.51, -1, 1], [0.51, 9, -4]]
    world = PhysicsWorld()
    world.add_bodies([GROUND, BALL], motion=[STATIC, DYNAMIC], position=[[0, 0, 0], [0, 0.5, -4]])
    mesh = world.add_mesh(floor_corners + wall_corners, [[0, 1, 2], [3, 4, 5]])
    world.add_colliders([GROUND], shape=MESH, geometry=mesh)
    world.add_colliders([BALL])
    assert kinds(told(world, steps=5)) == ["begun"]
    assert world.touching_count == 2
    world.set_poses([BALL], position=[[0.011, 3.5, -4]], rotation=[[0, 0, 0, 1]])
    assert told(world, steps=1) == []
    np.testing.assert_allclose(world.events.contacts.persisting.normal, [[-1, 0, 0]], atol=1e-6)


@pytest.mark.parametrize(("gap", "ends"), [(5e-7, False), (5e-6, True)])
def test_a_gap_that_is_nothing_but_rounding_ends_no_contact(gap, ends):
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([GROUND, BALL], motion=[STATIC, DYNAMIC], position=[[0, -1, 0], [0, 0.5, 0]])
    world.add_colliders([GROUND, BALL], shape=[BOX, SPHERE], size=[[20, 2, 20], [1, 1, 1]], radius=0.5)
    assert kinds(told(world, steps=5)) == ["begun"]
    world.set_poses([BALL], position=[[0, 0.5 + gap, 0]], rotation=[[0, 0, 0, 1]])
    world.set_velocities([BALL], linear=[[0, 0, 0]])
    assert kinds(told(world, steps=1)) == (["ended"] if ends else [])


def test_the_colliders_own_entities_are_told_and_their_bodies():
    world = PhysicsWorld()
    world.add_bodies([GROUND, BALL], motion=[STATIC, DYNAMIC], position=[[0, -1, 0], [0, 0.5, 0]])
    world.add_colliders(
        [GROUND, BALL, BALL],
        size=[[20, 2, 20], [0.5, 1, 0.5], [0.5, 1, 0.5]],
        owners=[GROUND, 7, 8],
        position=[[0, 0, 0], [-1, 0, 0], [1, 0, 0]],
    )
    world.step(DT)
    begun = world.event_changes.begun
    assert pairs_of(begun) == [(GROUND, 7), (GROUND, 8)]
    assert pairs_of(begun[2:4]) == [(GROUND, BALL)] * 2


def test_events_are_sorted_by_their_colliders():
    rng = np.random.default_rng(3)
    world = PhysicsWorld()
    entities = rng.permutation(np.arange(2, 60))
    world.add_bodies([1], motion=[STATIC], position=[[0, -1, 0]])
    world.add_colliders([1], size=[[40, 2, 40]])
    world.add_bodies(entities, position=rng.uniform([-3, 0.5, -3], [3, 6, 3], (len(entities), 3)))
    world.add_colliders(entities, shape=SPHERE, radius=0.4)
    count = 0
    for step in range(90):
        if step == 60:
            world.remove_bodies(entities[:20])
        world.step(DT)
        for meetings in (*world.events.contacts,):
            assert pairs_of(meetings) == sorted(pairs_of(meetings))
            count += len(meetings.entity_a)
    assert count > 100


def test_events_can_be_switched_off_and_on():
    world = ball_over_ground(height=0.5)
    told(world, steps=5)
    on = world.settings
    world.settings = PhysicsSettings(events=False)
    assert told(world, steps=3) == []
    assert pairs_of(world.events.contacts.persisting) == []
    world.settings = on
    assert [row[1:] for row in told(world, steps=3)] == [("begun", GROUND, BALL)]


def test_whether_events_are_told_changes_no_bit_of_the_motion():
    hashes = set()
    for events in (True, False):
        rng = np.random.default_rng(5)
        world = PhysicsWorld(PhysicsSettings(events=events))
        world.add_bodies([GROUND, ZONE], motion=STATIC, position=[[0, -1, 0], [0, 1, 0]])
        world.add_colliders([GROUND, ZONE], size=[[40, 2, 40], [3, 1, 3]], trigger=[False, True])
        entities = np.arange(10, 60)
        world.add_bodies(entities, position=rng.uniform([-2, 0.5, -2], [2, 8, 2], (50, 3)))
        world.add_colliders(entities, shape=entities % 2, size=[0.6, 0.5, 0.7], radius=0.3, restitution=0.4)
        for _ in range(150):
            world.step(DT)
        hashes.add(world.state_hash())
    assert len(hashes) == 1
