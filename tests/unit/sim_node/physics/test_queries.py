"""Rays, casts, overlaps and closest points against a plain search over all shapes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.errors import PhysicsError
from elys.sim_node.physics import PhysicsWorld
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, SPHERE
from tests.reference import naive_queries as naive

KINDS = (BOX, SPHERE, CAPSULE, CYLINDER)
FARTHEST = 40.0


def scene(seed=4, count=40, *, spread=7.0, smallest=0.5, largest=4.0, kinds=KINDS):
    """A world with random shapes, and the same for the plain search; entity k + 1 is shape k."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(-spread, spread, (count, 3))
    rotation = Rotation.random(count, random_state=rng)
    kind = np.resize(kinds, count)
    size = np.exp(rng.uniform(np.log(smallest), np.log(largest), (count, 3)))
    radius = 0.5 * size[:, 0]
    world = PhysicsWorld()
    entities = np.arange(1, count + 1)
    world.add_bodies(entities, position=position, rotation=rotation.as_quat())
    world.add_colliders(entities, shape=kind, size=size, radius=radius, half_length=0.5 * size[:, 1])
    half = np.where((kind != BOX)[:, None], radius[:, None], 0.5 * size)
    half[:, 1] = np.where(kind == SPHERE, radius, 0.5 * size[:, 1])
    return world, naive.Shapes(kind, position, rotation, half)


def aimed(rng, count, spread=7.0):
    """Rays from around the shapes to somewhere among them."""
    origins = rng.uniform(-1.5 * spread, 1.5 * spread, (count, 3))
    directions = rng.uniform(-spread, spread, (count, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def turned(rng, count):
    return Rotation.random(count, random_state=rng)


def check(hits, every, expected, touching, *, exact):
    """First hits and all hits against the distances (C,) to each shape for each question.

    `touching(question, distance, point)` says how far a point is from the shape that moved there.
    """
    met = 0
    for r, distances in enumerate(expected):
        order = [c for c in np.lexsort((np.arange(len(distances)), distances)) if np.isfinite(distances[c])]
        rows = every.query == r
        assert sorted(every.entity[rows]) == sorted(c + 1 for c in order)
        np.testing.assert_allclose(every.distance[rows], distances[order], atol=exact)
        if not order:
            assert hits.entity[r] == 0
            assert hits.distance[r] == np.inf
            assert np.isnan(hits.point[r]).all()
            assert not hits.normal[r].any()
            continue
        met += 1
        assert hits.distance[r] == pytest.approx(distances[order[0]], abs=exact)
        assert hits.entity[r] == every.entity[rows][0]
        assert np.linalg.norm(hits.normal[r]) == pytest.approx(1.0)
        if hits.distance[r] > 0:
            assert touching(r, hits.distance[r], hits.point[r]) < 2e-6
    assert met > 0
    return met


def on_surface(shapes, hits):
    """How far the points of hits lie from the shapes that were met, seen from just outside."""
    distances = []
    for entity, point in zip(hits.entity, hits.point, strict=True):
        if entity:
            distances.append(naive.point_distance(shapes, point)[entity - 1])
    return np.array(distances)


def test_rays_meet_what_a_plain_search_finds():
    world, shapes = scene()
    rng = np.random.default_rng(5)
    origins, directions = aimed(rng, 80)
    expected = [naive.cast_sphere(shapes, o, d, 0.0, FARTHEST) for o, d in zip(origins, directions, strict=True)]
    hits = world.raycast(origins, 3.0 * directions, FARTHEST)
    every = world.raycast(origins, directions, FARTHEST, all_hits=True)
    met = check(hits, every, expected, lambda r, t, p: np.linalg.norm(origins[r] + t * directions[r] - p), exact=1e-8)
    assert 20 < met < 75
    assert on_surface(shapes, hits).max() < 1e-9
    # Normals point against the ray, and a step along them leads straight away.
    outside = (hits.entity > 0) & (hits.distance > 0)
    assert ((hits.normal * directions).sum(axis=1)[outside] <= 0).all()
    for r in np.flatnonzero(outside):
        away = naive.point_distance(shapes, hits.point[r] + 0.01 * hits.normal[r])[hits.entity[r] - 1]
        assert away == pytest.approx(0.01, abs=1e-9)


def test_moving_balls_touch_what_a_plain_search_finds():
    world, shapes = scene(seed=6)
    rng = np.random.default_rng(7)
    origins, directions = aimed(rng, 40)
    radius = rng.uniform(0.0, 2.0, 40)
    expected = [
        naive.cast_sphere(shapes, o, d, r, FARTHEST) for o, d, r in zip(origins, directions, radius, strict=True)
    ]
    hits = world.cast_sphere(origins, directions, radius, FARTHEST)
    every = world.cast_sphere(origins, directions, radius, FARTHEST, all_hits=True)

    def touching(r, t, point):
        return abs(np.linalg.norm(origins[r] + t * directions[r] - point) - radius[r])

    check(hits, every, expected, touching, exact=1e-7)
    assert on_surface(shapes, hits)[hits.distance[hits.entity > 0] > 0].max() < 1e-7


def test_moving_capsules_touch_what_a_plain_search_finds():
    world, shapes = scene(seed=8, count=10)
    rng = np.random.default_rng(9)
    origins, directions = aimed(rng, 5)
    radius, half, turn = rng.uniform(0.1, 1.0, 5), rng.uniform(0.1, 2.0, 5), turned(rng, 5)
    expected = [
        naive.cast_capsule(shapes, origins[r], directions[r], radius[r], half[r], turn[r], FARTHEST) for r in range(5)
    ]
    ask = {"radius": radius, "half_length": half, "max_distance": FARTHEST, "rotation": turn.as_quat()}
    hits = world.cast_capsule(origins, directions, **ask)
    every = world.cast_capsule(origins, directions, **ask, all_hits=True)

    def touching(r, t, point):
        there = naive.Shapes(
            np.array([naive.CAPSULE]),
            (origins[r] + t * directions[r])[None],
            turn[r : r + 1],
            np.array([[radius[r], half[r], radius[r]]]),
        )
        return naive.point_distance(there, point)[0]

    check(hits, every, expected, touching, exact=1e-6)
    assert on_surface(shapes, hits)[hits.distance[hits.entity > 0] > 0].max() < 1e-5


def test_moving_boxes_touch_what_a_plain_search_finds():
    world, shapes = scene(seed=10, count=15, kinds=(BOX, SPHERE, CAPSULE))
    rng = np.random.default_rng(11)
    origins, directions = aimed(rng, 8)
    size, turn = rng.uniform(0.2, 3.0, (8, 3)), turned(rng, 8)
    expected = [naive.cast_box(shapes, origins[r], directions[r], size[r] / 2, turn[r], FARTHEST) for r in range(8)]
    ask = {"size": size, "max_distance": FARTHEST, "rotation": turn.as_quat()}
    hits = world.cast_box(origins, directions, **ask)
    every = world.cast_box(origins, directions, **ask, all_hits=True)

    def touching(r, t, point):
        there = (np.array([naive.BOX]), (origins[r] + t * directions[r])[None], turn[r : r + 1], size[r : r + 1] / 2)
        return naive.point_distance(naive.Shapes(*there), point)[0]

    check(hits, every, expected, touching, exact=1e-6)


def test_overlaps_are_what_a_plain_search_finds():
    world, shapes = scene(seed=12, count=120, spread=6.0)
    rng = np.random.default_rng(13)
    places = rng.uniform(-7, 7, (40, 3))
    radius = rng.uniform(0.0, 2.0, 40)
    found = world.overlap_sphere(places, radius)
    inside = world.overlap_point(places)
    for r in range(40):
        distance = naive.point_distance(shapes, places[r])
        assert found.entity[found.query == r].tolist() == (np.flatnonzero(distance <= radius[r]) + 1).tolist()
        assert inside.entity[inside.query == r].tolist() == (np.flatnonzero(distance == 0) + 1).tolist()
    assert len(found.query) > 40
    world, shapes = scene(seed=12, count=15, spread=3.0, kinds=(BOX, SPHERE, CAPSULE))
    places = rng.uniform(-3, 3, (6, 3))
    turn = turned(rng, 6)
    size = rng.uniform(0.5, 4.0, (6, 3))
    boxes = world.overlap_box(places, size, rotation=turn.as_quat())
    capsules = world.overlap_capsule(places, 0.5, 1.0, rotation=turn.as_quat())
    for r in range(6):
        # A shape that overlaps another touches it after no way at all.
        way = np.array([0.0, 0.0, 1.0])
        by_box = naive.cast_box(shapes, places[r], way, size[r] / 2, turn[r], 1e-9)
        by_capsule = naive.cast_capsule(shapes, places[r], way, 0.5, 1.0, turn[r], 1e-9)
        assert boxes.entity[boxes.query == r].tolist() == (np.flatnonzero(np.isfinite(by_box)) + 1).tolist()
        assert capsules.entity[capsules.query == r].tolist() == (np.flatnonzero(np.isfinite(by_capsule)) + 1).tolist()


def test_the_closest_point_is_what_a_plain_search_finds():
    world, shapes = scene(seed=14)
    places = np.random.default_rng(15).uniform(-14, 14, (60, 3))
    hits = world.closest_point(places, 5.0)
    for r in range(60):
        distance = naive.point_distance(shapes, places[r])
        if distance.min() > 5.0:
            assert hits.entity[r] == 0
            continue
        assert hits.entity[r] == distance.argmin() + 1
        assert hits.distance[r] == pytest.approx(distance.min(), abs=1e-12)
        assert np.linalg.norm(hits.point[r] - places[r]) == pytest.approx(distance.min(), abs=1e-12)
        assert naive.point_distance(shapes, hits.point[r])[hits.entity[r] - 1] < 1e-12
        np.testing.assert_allclose(hits.point[r] + hits.distance[r] * hits.normal[r], places[r], atol=1e-12)
    assert 0 < (hits.entity == 0).sum() < 60


def test_sizes_from_a_centimetre_to_a_hundred_metres():
    world, shapes = scene(seed=16, count=60, spread=150.0, smallest=0.01, largest=100.0)
    rng = np.random.default_rng(17)
    origins = rng.uniform(-300, 300, (60, 3))
    # Every ray aims at a shape, however small.
    directions = shapes.center - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    every = world.raycast(origins, directions, all_hits=True)
    for r in range(60):
        assert r + 1 in every.entity[every.query == r]
        expected = naive.cast_sphere(shapes, origins[r], directions[r], 0.0, 1000.0)
        found = every.query == r
        np.testing.assert_allclose(every.distance[found], expected[every.entity[found] - 1], atol=1e-6)


def test_far_from_the_origin_as_at_the_origin():
    world, _ = scene(seed=18)
    shift = np.array([1.0e6, -2.0e6, 3.0e6])
    far, _ = scene(seed=18)
    bodies = far.bodies
    far.set_poses(bodies.entity.copy(), position=bodies.position + shift, rotation=bodies.rotation.astype(float))
    origins, directions = aimed(np.random.default_rng(19), 200)
    near_hits, far_hits = world.raycast(origins, directions), far.raycast(origins + shift, directions)
    np.testing.assert_array_equal(near_hits.entity, far_hits.entity)
    met = near_hits.entity > 0
    np.testing.assert_allclose(near_hits.distance[met], far_hits.distance[met], atol=1e-6)


def test_rays_along_edges_and_faces_and_from_inside():
    world = PhysicsWorld()
    world.add_bodies([5], position=[0, 0, 10])
    world.add_colliders([5], shape=BOX, size=[2, 2, 2], owners=[9])
    origins = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1.0000001, 0, 0], [0, 0, 10], [0.5, 0, 9], [0.5, 0, 11], [0, 1, 9]]
    hits = world.raycast(origins, [0, 0, 1])
    assert hits.entity.tolist() == [9, 9, 9, 0, 9, 9, 9, 9]
    assert hits.distance.tolist() == [9, 9, 9, np.inf, 0, 0, 0, 0]
    assert hits.normal[4].tolist() == [0, 0, -1]
    short = world.raycast([0, 0, 0], [0, 0, 1], max_distance=[8.9]), world.raycast([0, 0, 0], [0, 0, 1], 9.0)
    assert [hits.entity[0] for hits in short] == [0, 9]


def test_equally_far_shapes_are_met_in_the_order_of_their_bodies():
    world = PhysicsWorld()
    world.add_bodies(np.arange(1, 10), position=[0, 0, 5])
    world.add_colliders(np.arange(9, 0, -1), shape=BOX)
    assert world.raycast([0, 0, 0], [0, 0, 1]).entity.tolist() == [1]
    assert world.raycast([0, 0, 0], [0, 0, 1], all_hits=True).entity.tolist() == list(range(1, 10))
    assert world.cast_sphere([0, 0, 0], [0, 0, 1], 0.25).entity.tolist() == [1]
    assert world.closest_point([0, 0, 0]).entity.tolist() == [1]
    assert world.overlap_point([0, 0, 5]).entity.tolist() == list(range(1, 10))


def test_what_is_filtered_is_not_met():
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], position=[[0, 0, 2], [0, 0, 4], [0, 0, 6]])
    world.add_colliders([1, 2, 3], owners=[1, 8, 3])
    ray = ([0, 0, 0], [0, 0, 1])
    assert world.raycast(*ray, exclude=[1]).entity.tolist() == [8]
    assert world.raycast(*ray, exclude=[1, 8]).entity.tolist() == [3]
    assert world.raycast(*ray, exclude=[1, 2]).entity.tolist() == [3]
    both = world.raycast([ray[0], ray[0]], ray[1], own_body=[1, 0])
    assert both.entity.tolist() == [8, 1]
    assert world.cast_box(*ray, [0.1, 0.1, 0.1], own_body=1).entity.tolist() == [8]
    assert world.overlap_sphere([0, 0, 3], 9.0, exclude=[3]).entity.tolist() == [1, 8]
    assert world.closest_point([0, 0, 0], own_body=[1]).entity.tolist() == [8]


def test_the_tree_follows_what_moves_comes_and_goes():
    rng = np.random.default_rng(20)
    world, shapes = scene(seed=21)
    origins, directions = aimed(rng, 50)
    for _ in range(4):
        position = rng.uniform(-10, 10, (40, 3))
        world.set_poses(np.arange(1, 41), position=position, rotation=shapes.rotation.as_quat())
        fresh = PhysicsWorld()
        fresh.add_bodies(np.arange(1, 41), position=position, rotation=shapes.rotation.as_quat())
        sizes = {"size": 2 * shapes.half, "radius": shapes.half[:, 0], "half_length": shapes.half[:, 1]}
        fresh.add_colliders(np.arange(1, 41), shape=shapes.kind, **sizes)
        for one, other in zip(world.raycast(origins, directions), fresh.raycast(origins, directions), strict=True):
            np.testing.assert_array_equal(one, other)
    world.remove_bodies(np.arange(2, 41))
    assert set(world.raycast(origins, directions).entity) <= {0, 1}
    world.remove_bodies([1])
    assert not world.raycast(origins, directions).entity.any()


def test_asking_changes_nothing():
    def run(ask):
        world, _ = scene()
        for _ in range(20):
            world.step(1 / 60)
            if ask:
                world.raycast([0, 20, 0], [0, -1, 0])
                world.overlap_sphere([0, 0, 0], 3.0)
        return world.state_hash()

    assert run(True) == run(False)


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda w: w.raycast([0, 0, 0], [0, 0, 0]), "length 0"),
        (lambda w: w.raycast([np.nan, 0, 0], [0, 0, 1]), "finite origins"),
        (lambda w: w.raycast([0, 0, 0], [0, np.inf, 1]), "finite directions"),
        (lambda w: w.raycast([0, 0], [0, 1]), "shape"),
        (lambda w: w.raycast(np.zeros((2, 3)), np.ones((3, 3))), "2 and 3"),
        (lambda w: w.raycast([0, 0, 0], [0, 0, 1], -1.0), "0 m or more"),
        (lambda w: w.raycast([0, 0, 0], [0, 0, 1], np.nan), "0 m or more"),
        (lambda w: w.raycast([0, 0, 0], [0, 0, 1], own_body=[7]), "entity 7"),
        (lambda w: w.cast_sphere([0, 0, 0], [0, 0, 1], -1.0), "radius"),
        (lambda w: w.cast_box([0, 0, 0], [0, 0, 1], [1, 1]), "size"),
        (lambda w: w.cast_box([0, 0, 0], [0, 0, 1], [1, 1, 1], rotation=[0, 0, 0, 2]), "rotation"),
        (lambda w: w.cast_capsule([0, 0, 0], [0, 0, 1], 1.0, np.inf), "half_length"),
        (lambda w: w.overlap_point([0, np.nan, 0]), "finite centers"),
        (lambda w: w.closest_point([["a", 0, 0]]), "points as numbers"),
    ],
)
def test_bad_questions_are_refused(ask, sentence):
    with pytest.raises(PhysicsError, match=sentence):
        ask(PhysicsWorld())


def test_an_empty_world_and_no_questions_give_nothing():
    empty, (world, _) = PhysicsWorld(), scene()
    assert empty.raycast([0, 0, 0], [1, 0, 0]).entity.tolist() == [0]
    assert empty.closest_point([0, 0, 0]).distance.tolist() == [np.inf]
    assert len(empty.overlap_point([0, 0, 0]).query) == 0
    assert len(empty.raycast([0, 0, 0], [1, 0, 0], all_hits=True).query) == 0
    none = np.zeros((0, 3))
    assert len(world.raycast(none, none).query) == len(world.cast_sphere(none, none, 1.0, all_hits=True).query) == 0
    assert len(world.overlap_sphere(none, 1.0).query) == len(world.closest_point(none).query) == 0


def test_directions_of_any_length():
    world = PhysicsWorld()
    world.add_bodies([1], position=[0, 0, 5])
    world.add_colliders([1])
    assert world.raycast([0, 0, 0], [[0, 0, 1e-300], [0, 0, 1e300], [1e-320, 0, 1]]).distance.tolist() == [4.5] * 3


def test_a_zero_of_either_sign_leads_the_same_way():
    world = PhysicsWorld()
    world.add_bodies([1], position=[(0.0, 0.0, 3.0)])
    world.add_colliders([1], size=(20.0, 6.0, 1.0))
    for zero in (0.0, -0.0):
        assert world.raycast((0.0, 0.0, 0.0), (zero, zero, 1.0), 4.0).distance == pytest.approx(2.5)
        assert world.cast_sphere((0.0, 0.0, 0.0), (zero, zero, 1.0), 0.5, 4.0).distance == pytest.approx(2.0)
