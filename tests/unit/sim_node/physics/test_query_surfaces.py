"""Questions about hulls, planes, meshes and height fields: against boxes that they are the same as, and plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import BOX, HEIGHT_FIELD, HULL, MESH, PLANE, STATIC, PhysicsWorld

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
# Two triangles a side, counter-clockwise as seen from outside.
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])
SIZE = np.array((1.0, 2.0, 3.0))


def one(shape, geometry=-1, *, seed=0, make=None):
    """A world with one static shape of the extents of a box, turned and moved."""
    rng = np.random.default_rng(seed)
    world = PhysicsWorld()
    turn = Rotation.random(random_state=rng).as_quat()
    world.add_bodies([1], motion=STATIC, position=rng.normal(size=3), rotation=turn)
    if make is not None:
        geometry = make(world)
    world.add_colliders([1], shape=shape, size=2 * SIZE, geometry=geometry)
    return world


def box():
    return one(BOX)


def hull():
    return one(HULL, make=lambda world: world.add_hull(CORNERS * SIZE))


def mesh():
    return one(MESH, make=lambda world: world.add_mesh(CORNERS * SIZE, TRIANGLES))


def rays(count, seed=3, spread=8.0):
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3))
    origins *= spread / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-3, 3, (count, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def assert_same_hits(found, expected, *, exact, normals=True):
    np.testing.assert_array_equal(found.entity, expected.entity)
    met = expected.entity != 0
    assert 0 < met.sum() < len(met)
    np.testing.assert_allclose(found.distance[met], expected.distance[met], atol=exact)
    if normals:
        np.testing.assert_allclose(found.normal[met], expected.normal[met], atol=10 * exact)


@pytest.mark.parametrize("make", [hull, mesh])
def test_rays_meet_a_hull_or_mesh_of_a_box_as_the_box(make):
    question = rays(500)
    assert_same_hits(make().raycast(*question), box().raycast(*question), exact=1e-9)


@pytest.mark.parametrize("make", [hull, mesh])
def test_casts_touch_a_hull_or_mesh_of_a_box_as_the_box(make):
    question = rays(150)
    turn = Rotation.random(random_state=1).as_quat()
    asked = {
        "cast_sphere": {"radius": 0.7},
        "cast_box": {"size": (1, 2, 0.5), "rotation": turn},
        "cast_capsule": {"radius": 0.3, "half_length": 1.0, "rotation": turn},
    }
    for name, shape in asked.items():
        found, expected = (getattr(world, name)(*question, **shape) for world in (make(), box()))
        # Where an edge meets an edge or a corner the normal of either shape will do.
        assert_same_hits(found, expected, exact=1e-6, normals=name == "cast_sphere")


@pytest.mark.parametrize("make", [hull, mesh])
def test_places_near_a_hull_or_mesh_of_a_box_as_near_the_box(make):
    places = np.random.default_rng(5).uniform(-5, 5, (300, 3))
    outside = box().closest_point(places).distance > 0
    places = places[outside]
    found, expected = make().closest_point(places, 2.0), box().closest_point(places, 2.0)
    assert_same_hits(found, expected, exact=1e-9, normals=False)
    met = found.entity != 0
    np.testing.assert_allclose(found.point[met], expected.point[met], atol=1e-7)
    for ask in (
        lambda world: world.overlap_sphere(places, 1.5),
        lambda world: world.overlap_box(places, (2, 1, 3), rotation=(0, 0, 0.6, 0.8)),
        lambda world: world.overlap_capsule(places, 0.5, 1.0),
    ):
        assert ask(make()).query.tolist() == ask(box()).query.tolist()
        assert 0 < len(ask(box()).query) < len(places)


def soup(count=300, seed=7):
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-5, 5, (count, 1, 3)) + rng.normal(size=(count, 3, 3))
    return vertices.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def ray_distances(triangles, origin, direction):
    """(T,) by solving origin + t d = a + u (b - a) + v (c - a) for each."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    columns = np.stack([np.broadcast_to(-direction, a.shape), b - a, c - a], axis=-1)
    t, u, v = np.linalg.solve(columns, (origin - a)[..., None])[..., 0].T
    return np.where((t >= 0) & (u >= 0) & (v >= 0) & (u + v <= 1), t, np.inf)


def test_rays_meet_a_soup_of_triangles_from_either_side():
    vertices, triangles = soup()
    world = PhysicsWorld()
    world.add_bodies([1], motion=STATIC)
    world.add_colliders([1], shape=MESH, geometry=world.add_mesh(vertices, triangles))
    origins, directions = rays(300)
    hits = world.raycast(origins, directions)
    for r in range(300):
        expected = ray_distances(vertices[triangles], origins[r], directions[r])
        assert hits.distance[r] == pytest.approx(expected.min(), abs=1e-9)
        if hits.entity[r]:
            assert hits.normal[r] @ directions[r] < 0


def test_no_ray_slips_through_the_edges_of_a_mesh():
    world = mesh()
    position, rotation = world.bodies.position[0], Rotation.from_quat(world.bodies.rotation[0])
    # From inside through every corner, and through points along every edge and diagonal.
    targets = [w * CORNERS[a] + (1 - w) * CORNERS[b] for t in TRIANGLES for a, b in zip(t, np.roll(t, 1), strict=True)
               for w in np.linspace(0, 1, 9)]  # fmt: skip
    directions = rotation.apply(np.array(targets) * SIZE)
    assert world.raycast(position, directions).entity.all()


def test_a_height_field_is_met_where_it_is():
    heights = np.random.default_rng(11).uniform(0, 2, (9, 7))
    world = PhysicsWorld()
    world.add_bodies([1], motion=STATIC, position=[0, 0.5, 0])
    world.add_colliders([1], shape=HEIGHT_FIELD, geometry=world.add_height_field(heights, (8.0, 6.0)))
    x, z = np.meshgrid(np.arange(9) - 4.0, np.arange(7) - 3.0, indexing="ij")
    inner = (slice(1, -1), slice(1, -1))
    origins = np.stack([x[inner], np.full_like(x[inner], 10.0), z[inner]], -1).reshape(-1, 3)
    hits = world.raycast(origins, [0, -1, 0])
    np.testing.assert_allclose(hits.point[:, 1], heights[inner].ravel() + 0.5, atol=1e-6)
    assert (hits.normal[:, 1] > 0).all()
    rolled = world.cast_sphere(origins, [0, -1, 0], 0.4)
    assert (rolled.distance <= hits.distance - 0.4 + 1e-9).all()
    assert not world.raycast([20, 10, 0], [0, -1, 0]).entity.any()


def test_a_plane_has_no_end_and_everything_below_is_inside():
    world = PhysicsWorld()
    tilt = np.array([0, 0, np.sin(0.1), np.cos(0.1)])
    world.add_bodies([1], motion=STATIC, position=[0, 1, 0], rotation=tilt)
    world.add_colliders([1], shape=PLANE)
    normal = Rotation.from_quat(tilt).apply([0, 1, 0])
    rng = np.random.default_rng(13)
    origins, directions = rng.uniform(-30, 30, (200, 3)), rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    height = (origins - (0, 1, 0)) @ normal
    approach = -(directions @ normal)
    hits, balls = world.raycast(origins, directions), world.cast_sphere(origins, directions, 2.0)
    sizes = {"size": (2, 4, 6), "rotation": (0.5, 0.5, 0.5, 0.5)}
    boxes = world.cast_box(origins, directions, **sizes)
    half = Rotation.from_quat(sizes["rotation"]).apply(np.diag((1, 2, 3)))
    reach = abs(half @ normal).sum()
    for found, less in ((hits, 0.0), (balls, 2.0), (boxes, reach)):
        gap = height - less
        with np.errstate(divide="ignore"):
            expected = np.where(gap <= 0, 0.0, np.where(approach > 0, gap / approach, np.inf))
        np.testing.assert_allclose(found.distance, expected, atol=1e-9)
        assert 0 < (found.entity != 0).sum() < 200
    closest = world.closest_point(origins)
    np.testing.assert_allclose(closest.distance, np.maximum(height, 0.0), atol=1e-12)
    assert world.overlap_sphere(origins, 3.0).query.tolist() == np.flatnonzero(height <= 3.0).tolist()
    assert world.overlap_box(origins, **sizes).query.tolist() == np.flatnonzero(height <= reach).tolist()


def test_layers_and_triggers():
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], position=[[0, 0, 2], [0, 0, 4], [0, 0, 6]])
    world.add_colliders([1, 2, 3], layer=[1, 2, 4], trigger=[True, False, False])
    ray = ([0, 0, 0], [0, 0, 1])
    assert world.raycast(*ray).entity.tolist() == [2]
    assert world.raycast(*ray, include_triggers=True).entity.tolist() == [1]
    assert world.raycast(*ray, mask=4).entity.tolist() == [3]
    assert world.raycast(*ray, mask=1).entity.tolist() == [0]
    assert world.raycast(*ray, mask=5, include_triggers=True, all_hits=True).entity.tolist() == [1, 3]
