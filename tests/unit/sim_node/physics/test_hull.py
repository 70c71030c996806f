"""Hulls against scipy's, their mass properties against sampling, and what is no hull is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from elys.common.errors import PhysicsError
from elys.sim_node.physics import HULL, PhysicsWorld
from elys.sim_node.physics.hull import MOST_CORNERS, FlatPointsError, convex_hull

AWAY = np.array([5.0, -3.0, 1.0])
FAR_AWAY = np.array([1e4, 0.0, 0.0])
HALF_RIGHT = np.array([0.5, 0.0, 0.0])
HALF_UP = np.array([0.0, 0.5, 0.0])


def clouds():
    rng = np.random.default_rng(5)
    turn = Rotation.from_euler("xyz", [0.3, 1.1, -2.0])
    cube = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), -1).reshape(-1, 3) * [1.0, 0.4, 2.0]
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 3), -1).reshape(-1, 3)
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rim = np.stack([np.cos(angle), np.zeros(24), np.sin(angle)], 1)
    return {
        "tetrahedron": np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]]),
        "turned box": turn.apply(cube) + AWAY,
        "grid": turn.apply(grid),
        "cylinder": turn.apply(np.concatenate([rim + HALF_UP, rim - HALF_UP])),
        "cloud": rng.normal(size=(200, 3)),
        "ball": (lambda p: p / np.linalg.norm(p, axis=1, keepdims=True))(rng.normal(size=(150, 3))),
        "twice the same": np.repeat(cube, 3, axis=0),
        "millimetres": 1e-3 * rng.normal(size=(30, 3)),
        "kilometres": 1e3 * rng.normal(size=(30, 3)) + 1e5,
    }


@pytest.mark.parametrize("name", clouds())
def test_a_hull_is_the_one_that_scipy_finds(name):
    points = clouds()[name]
    hull, other = convex_hull(points), ConvexHull(points)
    size = np.ptp(points, axis=0).max()
    assert hull.volume == pytest.approx(other.volume, rel=1e-9)
    # Every point lies within every face's plane, and every corner is one of the points.
    offsets = np.array([hull.corners[face[0]] @ normal for face, normal in zip(hull.faces, hull.normals, strict=True)])
    assert (points @ hull.normals.T - offsets).max() < 1e-8 * size
    assert {tuple(p) for p in hull.corners} <= {tuple(p) for p in points}


@pytest.mark.parametrize("name", clouds())
def test_faces_are_flat_closed_and_counter_clockwise(name):
    hull = convex_hull(clouds()[name])
    size = np.ptp(hull.corners, axis=0).max()
    edges = set()
    for face, normal in zip(hull.faces, hull.normals, strict=True):
        corners = hull.corners[face]
        assert abs((corners - corners[0]) @ normal).max() < 1e-7 * size
        turn = np.cross(np.roll(corners, -1, 0) - corners, np.roll(corners, -2, 0) - np.roll(corners, -1, 0)) @ normal
        assert (turn > -1e-9 * size**2).all()
        assert normal @ (corners.mean(0) - hull.center) > 0.0
        edges |= {(int(p), int(q)) for p, q in zip(face, np.roll(face, -1), strict=True)}
    assert edges == {(q, p) for p, q in edges}
    assert len(hull.corners) - len(edges) // 2 + len(hull.faces) == 2  # Euler


def test_coplanar_triangles_become_one_face():
    assert sorted(len(face) for face in convex_hull(clouds()["turned box"]).faces) == [4] * 6
    assert sorted(len(face) for face in convex_hull(clouds()["cylinder"]).faces) == [4] * 24 + [24] * 2


@pytest.mark.parametrize("name", ["tetrahedron", "turned box", "cloud", "kilometres"])
def test_volume_centre_and_inertia_equal_those_of_many_small_tetrahedra(name):
    """Scipy's triangles, each cut into small ones whose masses sit in their centres."""
    points = clouds()[name]
    hull, other = convex_hull(points), ConvexHull(points)
    # Each corner of a tetrahedron from the middle, split by barycentric sampling on a fine grid.
    middle = points.mean(0)
    steps = (np.arange(24) + 0.5) / 24
    u, v, w = (g.ravel() for g in np.meshgrid(steps, steps, steps))
    s, t, r = u ** (1 / 3), v ** (1 / 2), w  # uniform in a tetrahedron
    samples, weights = [], []
    for triangle in points[other.simplices] - middle:
        a, b, c = triangle
        samples.append(s[:, None] * (a + t[:, None] * (b - a + r[:, None] * (c - b))))
        weights.append(np.full(len(s), abs(a @ np.cross(b, c)) / 6.0 / len(s)))
    p, m = np.concatenate(samples), np.concatenate(weights)
    center = (m @ p) / m.sum()
    away = p - center
    spread = (m[:, None] * away).T @ away / m.sum()
    size = np.ptp(points, axis=0).max()
    assert hull.volume == pytest.approx(m.sum(), rel=1e-9)
    np.testing.assert_allclose(hull.center, center + middle, atol=2e-3 * size)
    np.testing.assert_allclose(hull.tensor, np.trace(spread) * np.eye(3) - spread, atol=8e-3 * np.trace(spread))


def test_a_box_has_the_textbook_tensor_wherever_it_is():
    corners = np.stack(np.meshgrid([-1, 1], [-2, 2], [-3, 3]), -1).reshape(-1, 3) + FAR_AWAY
    hull = convex_hull(corners)
    np.testing.assert_allclose(hull.center, [1e4, 0, 0], rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(hull.tensor, np.diag([4 + 9, 1 + 9, 1 + 4]) / 3.0, atol=1e-9)
    assert hull.volume == pytest.approx(48.0)


def test_of_too_many_points_those_that_matter_most_are_kept():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    hull = convex_hull(points)
    assert len(hull.corners) <= MOST_CORNERS
    assert hull.volume > 0.94 * 4.0 / 3.0 * np.pi


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (np.zeros((0, 3)), "shape"),
        (np.zeros((8, 2)), "shape"),
        (np.zeros((8, 3)), "1 different points"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "3 different points"),
        ([[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]], "on a line"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-13]], "in a plane"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]], "point 3"),
        ("points", "numbers"),
    ],
)
def test_what_spans_no_volume_is_refused_with_a_sentence(points, sentence):
    with pytest.raises(PhysicsError, match=sentence):
        PhysicsWorld().add_hull(points)


def test_equal_points_give_one_hull_and_a_body_takes_its_centre_of_mass():
    world = PhysicsWorld()
    points = clouds()["tetrahedron"]
    handle = world.add_hull(points)
    assert world.add_hull(points.tolist()) == handle
    assert world.add_hull(points + 1.0) != handle
    world.add_bodies([1], angular_velocity=[[0.0, 0.0, 0.0]])
    world.add_colliders([1], shape=HULL, geometry=handle)
    world.apply_impulse(1, [1.0, 0.0, 0.0], points.mean(0))  # at the centroid of a tetrahedron: no turning
    np.testing.assert_allclose(world.bodies.angular_velocity[0], 0.0, atol=1e-6)


def test_a_collider_without_its_geometry_is_refused():
    world = PhysicsWorld()
    world.add_bodies([7])
    with pytest.raises(PhysicsError, match="entity 7 has a hull without its geometry"):
        world.add_colliders([7], shape=HULL)


def test_the_box_of_a_turned_hull_is_the_smallest_around_its_corners():
    world = PhysicsWorld()
    points = clouds()["cloud"]
    turn = Rotation.from_euler("xyz", [0.3, 1.1, -2.0])
    world.add_bodies([1], motion=2, position=[AWAY], rotation=[turn.as_quat()])
    world.add_colliders([1], shape=HULL, geometry=world.add_hull(points), position=HALF_RIGHT)
    world.step(1.0 / 60.0)
    there = turn.apply(points + HALF_RIGHT) + AWAY
    (box,) = world._colliders.rows["box"]
    np.testing.assert_allclose(box, [*there.min(0), *there.max(0)], atol=1e-9)


@pytest.mark.parametrize("seed", range(200))
@pytest.mark.timeout(20)
def test_points_that_are_nearly_flat_have_their_hull_or_are_said_to_have_none(seed: int) -> None:
    """Stretching multiplies a volume: that of the points as they were is by Qhull."""
    rng = np.random.default_rng(seed)
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    points = rng.normal(size=(rng.integers(4, 30), 3)) if seed % 2 else cube
    stretch = 10.0 ** rng.uniform(-10, 1, 3)
    thinnest, *_, widest = sorted(stretch)
    try:
        hull = convex_hull(Rotation.random(random_state=seed).apply(points * stretch))
    except FlatPointsError:
        assert thinnest / widest < 1e-4
    else:
        assert thinnest / widest > 1e-6 and len(hull.faces) >= 4
        assert hull.volume == pytest.approx(ConvexHull(points).volume * np.prod(stretch), rel=1e-3)
