"""Shapes of the scene in physics: every form, scale, what is drawn as hull or mesh, layers, density, and what is refused."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from elys.common.assets.mesh import encode_mesh
from elys.common.assets.primitives import primitive
from elys.common.components import Collider, MeshRenderer, RigidBody, Transform
from elys.sim_node.simulation import Simulation


@pytest.fixture
def simulation() -> Simulation:
    return Simulation()


def rest(simulation: Simulation, seconds: float = 2.0) -> float:
    """The height of the one moving body after a while."""
    for _ in range(round(seconds * 60)):
        simulation.step()
    return float(simulation.moving_bodies().position[0, 1])


@pytest.mark.parametrize(
    ("collider", "mesh", "scale", "height"),
    [
        (Collider(shape="box"), "box", (1.0, 2.0, 1.0), 1.0),
        (Collider(shape="sphere"), "sphere", (2.0, 1.0, 1.0), 1.0),
        (Collider(shape="capsule", radius=0.25, half_length=0.5), "capsule", (2.0, 1.0, 1.0), 1.0),
        (Collider(shape="cylinder", half_length=0.3), "cylinder", (1.0, 2.0, 1.0), 0.6),
        (Collider(shape="hull"), "box", (1.0, 0.5, 1.0), 0.25),
        (Collider(shape="hull"), "cylinder", (1.0, 1.0, 1.0), 0.5),
    ],
)
@pytest.mark.parametrize("ground", ["box", "plane", "mesh"])
def test_every_form_comes_to_rest_at_its_scaled_height(simulation, collider, mesh, scale, height, ground) -> None:
    depth = 0.5 if ground == "box" else 0.0
    components = [Transform(position=(0.0, -depth, 0.0), scale=(20.0, 1.0, 20.0)), Collider(shape=ground)]
    simulation.world.spawn([*components, MeshRenderer(mesh="plane")], name="Ground")
    body = [Transform(position=(0.3, height + 0.01, 0.2), scale=scale), RigidBody(), collider, MeshRenderer(mesh=mesh)]
    simulation.world.spawn(body, name="Body")
    assert rest(simulation, 1.0) == pytest.approx(height, abs=0.002)
    assert simulation.take_events() == []


def test_a_hull_takes_the_mesh_asset_and_follows_when_another_is_drawn(simulation) -> None:
    reference = simulation.assets.put(encode_mesh(primitive("box")), kind="mesh")
    simulation.world.spawn([Transform(), Collider(shape="plane")], name="Ground")
    parts = [RigidBody(), Collider(shape="hull")]
    body = simulation.world.spawn(
        [Transform(position=(0.0, 0.51, 0.0)), *parts, MeshRenderer(mesh=reference)], name="Body"
    )
    assert rest(simulation) == pytest.approx(0.5, abs=0.002)
    simulation.world.set(body, Transform(position=(0.0, 0.26, 0.0), scale=(1.0, 0.5, 1.0)))
    assert rest(simulation) == pytest.approx(0.25, abs=0.002)


@pytest.mark.parametrize(
    ("components", "sentence"),
    [
        ([RigidBody(), Collider(shape="mesh"), MeshRenderer()], "'Body' collides with nothing: a mesh cannot move"),
        ([RigidBody(), Collider(shape="plane")], "'Body' collides with nothing: a plane cannot fall"),
        ([RigidBody(), Collider(shape="hull")], "'Body' collides with nothing: its shape is that of its mesh"),
        (
            [Collider(shape="height_field")],
            "'Body' collides with nothing: its shape is that of its heights, and it has none",
        ),
        (
            [RigidBody(), Collider(shape="height_field", heights="x")],
            "a height field cannot move; make its RigidBody static",
        ),
        (
            [Collider(shape="height_field", heights="blake2b:" + "0" * 32)],
            "'Body' collides with nothing: there is no asset",
        ),
        ([Collider(shape="hull"), MeshRenderer(mesh="plane")], "has all its points in a plane"),
        ([Collider(shape="hull"), MeshRenderer(mesh="blake2b:" + "0" * 32)], "'Body' collides with nothing"),
    ],
)
def test_a_form_that_cannot_be_is_told_and_the_simulation_goes_on(simulation, components, sentence) -> None:
    simulation.world.spawn([Transform(), *components], name="Body")
    simulation.step()
    (event,) = simulation.take_events()
    assert sentence in str(event.values)
    simulation.step()
    assert simulation.take_events() == []


@pytest.mark.parametrize("shape", ["mesh", "hull"])
@pytest.mark.parametrize("topology", ["lines", "points"])
def test_lines_and_points_are_collided_with_by_nobody(simulation, shape, topology) -> None:
    edges = replace(primitive("box"), topology=topology)
    reference = simulation.assets.put(encode_mesh(edges), kind="mesh")
    simulation.world.spawn([Transform(), Collider(shape=shape), MeshRenderer(mesh=reference)], name="Body")
    simulation.step()
    (event,) = simulation.take_events()
    sentence = f"its shape is that of its mesh, which consists of {topology}; choose a mesh of triangles"
    assert f"'Body' collides with nothing: {sentence}" in str(event.values)


@pytest.mark.parametrize(("x", "z"), [(6.0, -4.0), (-5.0, 3.0), (0.5, 4.5)])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_ground_after_a_file_lies_where_the_picture_shows_it(simulation, x, z, mirror) -> None:
    """z = f(x, z) rises to the right and falls towards the viewer; rows of the file run along z, columns along x."""
    across, along = np.linspace(-1.0, 1.0, 21), np.linspace(-1.0, 1.0, 11)
    file = io.BytesIO()
    np.save(file, 0.3 * across[None, :] ** 2 - 0.2 * along[:, None])
    ground = Collider(
        shape="height_field", heights=simulation.assets.put(file.getvalue(), kind="heights"), size=(10.0, 2.0, 5.0)
    )
    place = Transform(position=(0.0, 1.0, 0.0), scale=(2.0, 1.5, 2.0 * mirror))
    simulation.world.spawn([place, ground], name="Ground")
    simulation.step()
    hit = simulation.physics.raycast([[x, 9.0, z]], [[0.0, -1.0, 0.0]])
    expected = 1.0 + 3.0 * (0.3 * (x / 10.0) ** 2 - 0.2 * mirror * z / 5.0)
    assert 9.0 - hit.distance[0] == pytest.approx(expected, abs=0.003)  # a parabola between corners a metre apart
    assert hit.entity[0] == 1


def test_a_mirrored_mesh_still_faces_outward(simulation) -> None:
    ground = [Transform(scale=(-20.0, 1.0, 20.0)), Collider(shape="mesh"), MeshRenderer(mesh="plane")]
    simulation.world.spawn(ground, name="Ground")
    simulation.world.spawn([Transform(position=(0.0, 0.55, 0.0)), RigidBody(), Collider(shape="sphere")], name="Ball")
    assert rest(simulation) == pytest.approx(0.5, abs=0.002)


def test_layers_that_do_not_meet_pass_through_each_other(simulation) -> None:
    simulation.world.spawn([Transform(), Collider(shape="plane", layer=2)], name="Ground")
    body = [Transform(position=(0.0, 0.51, 0.0)), RigidBody(), Collider(mask=~2)]
    simulation.world.spawn(body, name="Ghost")
    assert rest(simulation) < -5.0


def test_density_gives_the_mass(simulation) -> None:
    body = [Transform(scale=(2.0, 1.0, 1.0)), RigidBody(), Collider(density=500.0)]
    entity = simulation.world.spawn(body, name="Body")
    simulation.step()
    before = simulation.physics.momentum().linear
    simulation.physics.set_velocities([entity], linear=[[1.0, 0.0, 0.0]])
    after = simulation.physics.momentum().linear
    np.testing.assert_allclose(after - [0.0, before[1], 0.0], [1000.0, after[1] - before[1], 0.0])
