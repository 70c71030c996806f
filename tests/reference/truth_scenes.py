"""Two scenes whose pictures are known: 49 spheres of all kinds under a sun and a bulb, and a ball and a block on a floor."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore, Mesh, encode_mesh
from elys.common.components import Component, Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.common.scene import SceneSettings
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context
from elys.render_node.quality import EXACT, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of
from tests.reference.traced_pictures import Block, Seen, Sphere, Surface, rays, shrunk, traced, traced_by_lamp

SIDE = 7
COLOR = (0.75, 0.4, 0.15)
SUN_WAY, BULB = (-0.35, -0.55, -0.75), (4.5, 4.0, 6.0)
LAMP_PLACE = (1.9, 3.6, 1.1)
GRAZING = 0.15  # cosine of the angle of view under which a mesh's edges show


class Staged(NamedTuple):
    """A scene for the renderer beside what is to be seen."""

    world: RenderWorld
    camera: ViewCamera
    truth: Seen


def spheres(size: int) -> Staged:
    """Metallic 0 to 1 upwards, roughness 0.1 to 1 to the right."""
    shapes: list[Sphere | Block] = []
    things: list[tuple[Component, ...]] = []
    store = AssetStore()
    ball = store.put(encode_mesh(fine_ball()), kind="mesh")
    for row in range(SIDE):
        for column in range(SIDE):
            surface = Surface(COLOR, row / (SIDE - 1), 0.1 + 0.9 * column / (SIDE - 1))
            place = ((column - SIDE // 2) * 1.05, (row - SIDE // 2) * 1.05, 0.0)
            shapes.append(Sphere(place, 0.45, surface))
            material = Material(base_color=COLOR, metallic=surface.metallic, roughness=surface.roughness)
            # They throw no shadows, neither here nor there.
            renderer = MeshRenderer(mesh=ball, cast_shadows=False)
            things.append((Transform(position=place, scale=(0.45,) * 3), renderer, material))
    things.append((Transform(rotation=facing(SUN_WAY)), Light(intensity=2.0)))
    things.append((Transform(position=BULB), Light(kind="point", intensity=60.0)))
    camera = ViewCamera(position=(0.0, 0.0, 14.0), rotation=(0.0, 0.0, 0.0, 1.0), field_of_view=0.6)
    truth = traced(
        shapes,
        rays(size, 0.6, np.eye(3)),
        camera.position,
        sun=(SUN_WAY, 2.0),
        bulbs=[(BULB, 60.0)],
        shadows=False,
    )
    return Staged(staged(things, store), camera, truth)


def hard_shadow(size: int, lamp: Light | None = None, *, far_things: bool = False) -> Staged:
    """Of the sun, or of a lamp at LAMP_PLACE that shines at the middle, and, if wanted, with things far behind and below, which
    are not seen. The floor is shape 0.
    """
    surface = Surface((0.8, 0.8, 0.8), 0.0, 0.9)
    material = Material(base_color=(0.8, 0.8, 0.8), roughness=0.9)
    shapes: list[Sphere | Block] = [
        Block((-4.0, -0.2, -4.0), (4.0, 0.0, 4.0), surface),
        Sphere((-1.2, 1.0, 0.0), 0.7, surface),
        Block((0.6, 0.0, -0.6), (1.8, 1.2, 0.6), surface),
    ]
    way = (-0.5, -1.0, -0.35)
    store = AssetStore()
    ball = store.put(encode_mesh(fine_ball()), kind="mesh")
    things: list[tuple[Component, ...]] = [
        (Transform(position=(0.0, -0.1, 0.0), scale=(8.0, 0.2, 8.0)), MeshRenderer(), material),
        (Transform(position=(-1.2, 1.0, 0.0), scale=(0.7,) * 3), MeshRenderer(mesh=ball), material),
        (Transform(position=(1.2, 0.6, 0.0), scale=(1.2, 1.2, 1.2)), MeshRenderer(), material),
        (Transform(rotation=facing(way)), Light(intensity=3.0))
        if lamp is None
        else (Transform(position=LAMP_PLACE, rotation=facing(-np.array(LAMP_PLACE))), lamp),
    ]
    if far_things:
        things += [
            (Transform(position=(side * 150.0, -40.0, -100.0 * row)), MeshRenderer(), material)
            for side in (-1, 1)
            for row in range(1, 5)
        ]
    pitch = -0.62
    turned = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    rotation = (float(np.sin(pitch / 2)), 0.0, 0.0, float(np.cos(pitch / 2)))
    camera = ViewCamera(position=(0.0, 5.0, 7.0), rotation=rotation, field_of_view=0.7)
    seen_along = rays(size, 0.7, turned)
    truth = (
        traced(shapes, seen_along, camera.position, sun=(way, 3.0))
        if lamp is None
        else traced_by_lamp(
            shapes,
            seen_along,
            camera.position,
            LAMP_PLACE,
            lamp.intensity,
            np.pi if lamp.kind == "point" else lamp.inner_cone_angle,
        )
    )
    return Staged(staged(things, store), camera, truth)


def counted(truth: Seen) -> np.ndarray[Any, Any]:
    """Pixels (H, W) that are judged: two inside the silhouettes, not seen grazingly."""
    return shrunk(truth.hit >= 0, 2) & (truth.facing > GRAZING)


def drawn_light(context: Context, scene: Staged, size: int, *, quality: Quality = EXACT) -> np.ndarray[Any, Any]:
    """The renderer's linear picture (H, W, 3)."""
    renderer = Renderer(context, quality=quality)
    renderer.settle(scene.world)
    scene.world.place()
    renderer.draw(scene.world, scene.camera, size, size)
    return renderer.read_light(size, size)[..., :3]


def staged(things: list[tuple[Component, ...]], store: AssetStore) -> RenderWorld:
    """A world of these entities before black, without light from around."""
    world = RenderWorld(DrawableAssets(store.get))
    components = [{type(value).__name__: value for value in found} for found in things]
    black = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0))
    world.set_scene(tables_of(range(1, len(things) + 1), [0] * len(things), components, settings=black))
    return world


def fine_ball(around: int = 128, down: int = 80) -> Mesh:
    """A ball of radius 1 whose facets do not show."""
    latitude, longitude = np.meshgrid(
        np.linspace(0, np.pi, down + 1), np.linspace(0, 2 * np.pi, around + 1), indexing="ij"
    )
    normals = np.stack(
        [np.sin(latitude) * np.cos(longitude), np.cos(latitude), -np.sin(latitude) * np.sin(longitude)], axis=-1
    ).reshape(-1, 3)
    corner = (np.arange(down)[:, None] * (around + 1) + np.arange(around)).reshape(-1, 1)
    quads = corner + np.array([[0, around + 1, around + 2, 0, around + 2, 1]])
    return Mesh(
        positions=normals.astype(np.float32),
        normals=normals.astype(np.float32),
        uvs=np.zeros((len(normals), 2), np.float32),
        indices=quads.reshape(-1).astype(np.uint32),
    )


def facing(direction: Any) -> tuple[float, float, float, float]:
    """The rotation of a lamp that shines along a direction."""
    x, y, z, w = look_rotation(direction).tolist()
    return (x, y, z, w)
