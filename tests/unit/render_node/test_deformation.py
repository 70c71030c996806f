"""Skins and morph targets on the card, against the same mesh deformed here, vertex by vertex."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.assets import AssetStore, Mesh, encode_mesh
from elys.common.assets.skin import SkinBinding, encode_skin
from elys.common.components import Component, Light, Material, MeshRenderer, Morph, Skin, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import framing_camera
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_tables import tables_of

RANDOM = np.random.default_rng(11)
CAMERA = framing_camera((-2.5, -1.0, -1.5), (2.5, 3.0, 1.5), aspect=1.5, direction=(-0.2, -0.3, -1.0))
WIDTH, HEIGHT = 180, 120
BIND = np.stack([np.eye(3, 4), np.eye(3, 4)])
BIND[1, 1, 3] = -1.0  # the second joint is one above the first


def tube(**more: Any) -> Mesh:
    """A bent-able tube from y = 0 to 2, the weights going over from one joint to the other."""
    angles, heights = np.linspace(0, 2 * np.pi, 17), np.linspace(0.0, 2.0, 9)
    height, angle = (grid.ravel() for grid in np.meshgrid(heights, angles, indexing="ij"))
    normals = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=1)
    positions = 0.4 * normals + np.stack([np.zeros_like(height), height, np.zeros_like(height)], axis=1)
    share = np.clip(height - 0.5, 0.0, 1.0)
    weights = np.stack([1 - share, share, 0 * share, 0 * share], axis=1)
    low = np.add.outer(17 * np.arange(8), np.arange(16)).ravel()
    quads = np.stack([low, low + 17, low + 1, low + 1, low + 17, low + 18], axis=1)
    arrays = {"positions": positions, "normals": normals, "uvs": positions[:, :2], "weights": weights}
    arrays["joints"] = np.tile((0.0, 1.0, 0.0, 0.0), (len(positions), 1))
    fields = {name: array.astype(np.float32) for name, array in (arrays | more).items()}
    return Mesh(indices=quads.ravel().astype(np.uint32), **fields)


class Show:
    """A tube with its joints over a floor, lit by a sun that throws shadows."""

    def __init__(
        self, mesh: Mesh, *components: Component, joints: tuple[Transform, ...] = (), root: Transform | None = None
    ):
        self.store, self.mesh = AssetStore(), mesh
        reference = self.store.put(encode_mesh(mesh), kind="mesh")
        names = (("A",), ("A", "B"))
        binding = SkinBinding(joints=names, joint_from_mesh=BIND.astype(np.float32))
        self.skin = self.store.put(encode_skin(binding), kind="skin")
        drawn = (Transform(), MeshRenderer(mesh=reference), Material(double_sided=True), *components)
        sun = Transform(rotation=tuple(look_rotation((-0.3, -1.0, -0.4)).tolist()))
        floor = Transform(position=(0.0, -0.6, 0.0), scale=(6.0, 1.0, 6.0))
        first, second = joints or (Transform(), Transform(position=(0.0, 1.0, 0.0)))
        self.entities = {
            "Floor": (0, (floor, MeshRenderer(mesh="plane"))),
            "Sun": (0, (sun, Light())),
            "Root": (0, (root or Transform(),)),
            "A": (3, (first,)),
            "B": (4, (second,)),
            "Tube": (3, drawn),
        }

    def world(self, *more: Component) -> RenderWorld:
        self.assets = DrawableAssets(self.store.get)
        components = [{type(value).__name__: value for value in values} for _, values in self.entities.values()]
        components[-1] |= {type(value).__name__: value for value in more}
        parents = [parent for parent, _ in self.entities.values()]
        tables = tables_of(range(1, len(parents) + 1), parents, components, names=list(self.entities))
        world = RenderWorld(self.assets)
        world.set_scene(tables)
        self.assets.settle()
        world.place_if_assets_came()
        self.assets.settle()
        world.place_if_assets_came()
        return world

    def bent_world(self) -> RenderWorld:
        return self.world(Skin(skin=self.skin, root=3))


def affine(transform: Transform) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(transform.rotation).as_matrix() @ np.diag(transform.scale)
    matrix[:3, 3] = transform.position
    return matrix


def slowly_bent(mesh: Mesh, joints: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and normals in the world, in plain loops."""
    positions, normals = [], []
    for vertex in range(mesh.vertex_count):
        total = np.zeros((4, 4))
        for slot in range(4):
            joint = int(mesh.joints[vertex, slot])
            bind = np.vstack([BIND[joint], (0, 0, 0, 1)])
            total += mesh.weights[vertex, slot] * joints[joint] @ bind
        positions.append((total @ np.append(mesh.positions[vertex], 1.0))[:3])
        normal = np.linalg.inv(total[:3, :3]).T @ mesh.normals[vertex]
        normals.append(normal / np.linalg.norm(normal))
    return np.array(positions), np.array(normals)


def picture(renderer, world) -> np.ndarray:
    renderer.settle(world)
    return renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT))[..., :3].astype(int)


def assert_same_picture(one: np.ndarray, other: np.ndarray) -> None:
    different = (np.abs(one - other).max(axis=-1) > 3).mean()
    assert different < 0.002  # a pixel on an edge may fall to the other side by rounding


TURN = tuple(Rotation.from_euler("zx", (0.9, 0.4)).as_quat().tolist())
BENT = (Transform(position=(0.2, 0.1, 0.0)), Transform(position=(0.0, 1.0, 0.0), rotation=TURN, scale=(1.0, 1.2, 0.8)))
ROOT = Transform(
    position=(-0.5, 0.0, 0.3), rotation=tuple(Rotation.from_euler("y", 0.5).as_quat().tolist()), scale=(1.1,) * 3
)


def world_joints() -> list[np.ndarray]:
    first = affine(ROOT) @ affine(BENT[0])
    return [first, first @ affine(BENT[1])]


def test_a_bent_mesh_is_drawn_and_shaded_and_throws_shadows_as_it_is_bent(renderer) -> None:
    show = Show(tube(), joints=BENT, root=ROOT)
    positions, normals = slowly_bent(show.mesh, world_joints())
    still = replace(
        show.mesh,
        positions=positions.astype(np.float32),
        normals=normals.astype(np.float32),
        joints=None,
        weights=None,
    )
    expected = picture(renderer, Show(still).world())
    assert_same_picture(picture(renderer, show.bent_world()), expected)
    assert (picture(renderer, Show(tube()).world()) != expected).any(
        axis=-1
    ).mean() > 0.02  # it does differ from the rest


def test_a_bent_mesh_is_picked_where_it_is_seen(renderer) -> None:
    world = Show(tube(), joints=BENT, root=ROOT).bent_world()
    renderer.settle(world)
    positions, _ = slowly_bent(tube(), world_joints())
    top = positions[-17:].mean(axis=0) * 0.9 + positions[:17].mean(axis=0) * 0.1
    camera = framing_camera(top - 0.05, top + 0.05, aspect=1.0, direction=(-0.2, -0.3, -1.0))
    entity, place = renderer.pick(world, camera, 33, 33, 16, 16)
    assert entity == 6
    assert np.linalg.norm(np.array(place) - top) < 0.7


def test_the_box_around_a_bent_mesh_holds_every_vertex() -> None:
    world = Show(tube(), joints=BENT, root=ROOT).bent_world()
    positions, _ = slowly_bent(tube(), world_joints())
    row = int(np.flatnonzero(world.entity == 6)[0])
    lower, upper = world.boxes(np.array([row]))
    assert (lower[0] <= positions.min(axis=0) + 1e-6).all()
    assert (upper[0] >= positions.max(axis=0) - 1e-6).all()
    assert np.prod(upper[0] - lower[0]) < 4.0 * np.prod(np.ptp(positions, axis=0))
    assert (np.linalg.norm(positions - world.centre[row], axis=1) <= world.radius[row] + 1e-6).all()


def test_far_from_the_origin_nothing_trembles(renderer) -> None:
    far = 200_000.0
    near, away = Show(tube(), joints=BENT), Show(tube(), joints=BENT)
    away.entities = {
        name: (parent, tuple(moved(value, far) if parent == 0 else value for value in values))
        for name, (parent, values) in away.entities.items()
    }
    expected = picture(renderer, near.bent_world())
    world = away.bent_world()
    renderer.settle(world)
    camera = type(CAMERA)(
        **{f: getattr(CAMERA, f) for f in CAMERA.__struct_fields__} | {"position": shifted(CAMERA.position, far)}
    )
    found = renderer.read_pixels(renderer.draw(world, camera, WIDTH, HEIGHT))[..., :3].astype(int)
    assert_same_picture(found, expected)


def shifted(position: tuple[float, ...], far: float) -> tuple[float, ...]:
    return (position[0] + far, *position[1:])


def moved(value: Component, far: float) -> Component:
    if not isinstance(value, Transform):
        return value
    return Transform(position=shifted(value.position, far), rotation=value.rotation, scale=value.scale)


def test_without_a_joint_the_mesh_rests(renderer, caplog: pytest.LogCaptureFixture) -> None:
    show = Show(tube())
    expected = picture(renderer, show.world())
    show.entities = {("Gone" if name == "B" else name): value for name, value in show.entities.items()}
    assert_same_picture(picture(renderer, show.bent_world()), expected)
    assert "nobody is at 'A/B' below its root" in caplog.text


def targets(count: int) -> dict[str, np.ndarray]:
    vertex_count = tube().vertex_count
    return {
        "target_positions": RANDOM.normal(scale=0.1, size=(count, vertex_count, 3)),
        "target_normals": RANDOM.normal(scale=0.3, size=(count, vertex_count, 3)),
    }


def slowly_morphed(mesh: Mesh, weights: np.ndarray) -> Mesh:
    positions, normals = mesh.positions.astype(float), mesh.normals.astype(float)
    for target, weight in enumerate(weights):
        positions = positions + weight * mesh.target_positions[target]
        normals = normals + weight * mesh.target_normals[target]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    arrays = {"positions": positions.astype(np.float32), "normals": normals.astype(np.float32)}
    return replace(mesh, **arrays, target_positions=None, target_normals=None)


@pytest.mark.parametrize("count", [1, 5])
def test_a_morphed_mesh_is_drawn_as_it_is_morphed(renderer, count: int) -> None:
    show = Show(tube(**targets(count)))
    weights = np.array((0.5, 0.0, -0.25, 1.5, 0.75))[:count]
    expected = picture(renderer, Show(slowly_morphed(show.mesh, weights)).world())
    text = " ".join(map(str, weights))
    assert_same_picture(picture(renderer, show.world(Morph(weights=text))), expected)
    rest = picture(renderer, show.world(Morph()))
    assert_same_picture(rest, picture(renderer, Show(tube()).world()))
    assert (rest != expected).any(axis=-1).mean() > 0.02


def test_frames_animate_weights_and_what_is_between_them_is_mixed(renderer, make_frame) -> None:
    show = Show(tube(**targets(2)))
    world = show.world(Morph(weights="0.9 0.9"))

    def told(weights: tuple[float, ...], **header: Any):
        columns = {"weight": np.array(weights, np.float32), "weight_entity": np.array((6, 6, 99), np.uint32)}
        return replace(make_frame({}, **header), **columns, weight_target=np.array((0, 1, 0), np.uint32))

    world.take_state(told((0.0, 1.0, 5.0)), 0.0)
    world.take_state(told((1.0, 0.5, 5.0), tick=1, simulation_time=0.1, published_at=10**8), 0.1)
    world.place(simulation_time=0.025)
    np.testing.assert_allclose(world.pose_texels[0], (0.25, 0.875, 0.0, 0.0), atol=1e-6)
    expected = picture(renderer, Show(slowly_morphed(show.mesh, np.array((0.25, 0.875)))).world())
    assert_same_picture(picture(renderer, world), expected)


def test_a_mesh_is_morphed_before_it_is_bent_and_its_box_holds_it(renderer) -> None:
    show = Show(tube(**targets(2)), Morph(weights="1 -0.5"), joints=BENT, root=ROOT)
    morphed = slowly_morphed(show.mesh, np.array((1.0, -0.5)))
    positions, normals = slowly_bent(morphed, world_joints())
    arrays = {"positions": positions.astype(np.float32), "normals": normals.astype(np.float32)}
    still = replace(morphed, **arrays, joints=None, weights=None)
    world = show.bent_world()
    assert_same_picture(picture(renderer, world), picture(renderer, Show(still).world()))
    lower, upper = world.boxes(np.flatnonzero(world.entity == 6))
    assert (lower[0] <= positions.min(axis=0) + 1e-6).all()
    assert (upper[0] >= positions.max(axis=0) - 1e-6).all()
