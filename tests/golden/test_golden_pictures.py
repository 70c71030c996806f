"""Pictures that must stay as they are, drawn by software OpenGL; `pytest tests/golden --draw-golden` draws them anew."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.mirror import SceneMirror
from elys.common.assets import AssetStore
from elys.common.components import (
    Camera,
    Component,
    Light,
    Material,
    MeshRenderer,
    Transform,
    component_from,
    values_of,
)
from elys.common.math.matrix import look_rotation
from elys.common.scene import expand
from elys.render_node.data_colors import data_pixels, depth_unit_of
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context
from elys.render_node.offline import OfflineRenderer, load_picture, save_picture
from elys.render_node.passes.data import DATA_KINDS, DataKind
from elys.render_node.quality import FAST, FULL, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import SceneTables, tables_of
from elys.samples.registry import sample

pytestmark = pytest.mark.gl

FOLDER = Path(__file__).parent
SIZE = (320, 180)
MEAN_TOLERANCE = 1.0  # of 255, over all pixels and channels
FAR_OFF = 16  # of 255, in any channel
FAR_OFF_SHARE = 0.005  # of the pixels: edges move by a pixel between versions of Mesa


def facing(direction: Sequence[float]) -> tuple[float, float, float, float]:
    """The rotation of a lamp or camera that looks along a direction."""
    x, y, z, w = look_rotation(direction).tolist()
    return (x, y, z, w)


def checker() -> bytes:
    """A small image."""
    squares = np.indices((16, 16)).sum(axis=0) // 4 % 2
    pixels = np.where(squares[..., None] == 1, (230, 180, 60), (40, 60, 90)).astype(np.uint8)
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, format="PNG")
    return data.getvalue()


def still_life_things(store: AssetStore) -> list[Sequence[Component]]:
    """A bit of everything: metals, glass, an image, a glow, a sun with shadows, a bulb, a spot, a mirrored thing."""
    image = store.put(checker(), kind="image")
    things: list[Sequence[Component]] = [
        (Transform(position=(0, -0.1, 0), scale=(14, 0.2, 14)), MeshRenderer(), Material(base_color=(0.5, 0.5, 0.46))),
        (Transform(position=(-2.2, 0.6, 0), scale=(1.2,) * 3), MeshRenderer(), Material(base_color_texture=image)),
        *(
            (
                Transform(position=(-0.9 + 0.95 * i, 0.45, 0.6), scale=(0.9,) * 3),
                MeshRenderer(mesh="sphere"),
                Material(base_color=(0.95, 0.75, 0.35), metallic=1.0, roughness=0.15 + 0.35 * i),
            )
            for i in range(3)
        ),
        (
            Transform(position=(2.6, 0.6, -0.4), rotation=(0.0, 0.3827, 0.0, 0.9239), scale=(-0.8, 1.2, 0.8)),
            MeshRenderer(mesh="cone"),
            Material(base_color=(0.7, 0.15, 0.2), roughness=0.4),
        ),
        (
            Transform(position=(0.6, 0.7, 2.0), scale=(0.9, 1.4, 0.2)),
            MeshRenderer(cast_shadows=False),
            Material(base_color=(0.3, 0.7, 0.9), opacity=0.35, alpha_mode="blend", roughness=0.1),
        ),
        (
            Transform(position=(-1.2, 0.25, 2.0), scale=(0.5,) * 3),
            MeshRenderer(mesh="capsule"),
            Material(emissive=(0.1, 1.2, 0.4)),
        ),
        (Transform(position=(1.6, 1.2, -1.5), scale=(0.7,) * 3), MeshRenderer(mesh="cylinder")),
        (Transform(rotation=facing((-0.5, -1.0, -0.45))), Light(intensity=2.6)),
        (Transform(position=(-3.0, 1.5, 2.0)), Light(kind="point", intensity=3.0, color=(1.0, 0.5, 0.2))),
        (
            Transform(position=(3.5, 3.0, 2.0), rotation=facing((-0.4, -1.0, -0.5))),
            Light(kind="spot", intensity=12.0, color=(0.4, 0.6, 1.0), inner_cone_angle=0.2, outer_cone_angle=0.4),
        ),
        (Transform(position=(0.6, 2.6, 6.5), rotation=facing((-0.05, -0.33, -1.0))), Camera(field_of_view=0.7)),
    ]
    return things


def still_life(store: AssetStore) -> SceneTables:
    """All of them."""
    things = still_life_things(store)
    components = [{type(value).__name__: value for value in found} for found in things]
    return tables_of(range(1, len(things) + 1), [0] * len(things), components)


def still_life_mirror(store: AssetStore) -> SceneMirror:
    """The same, as the bus tells of it."""
    mirror = SceneMirror()
    changes = tuple(
        Spawned(
            entity=number,
            name="",
            parent=0,
            enabled=True,
            components={type(value).__name__: values_of(value) for value in found},
        )
        for number, found in enumerate(still_life_things(store), 1)
    )
    mirror.apply_delta(SceneDelta(epoch=0, sequence=0, tick=0, changes=changes))
    return mirror


def demo_scene(store: AssetStore) -> SceneTables:
    """The demo before its first tick."""
    document = sample("yard").build()
    records = expand(document, directory=Path(), assets=store)
    components: list[Mapping[str, Component]] = [
        {name: component_from(name, values) for name, values in record.components.items()} for record in records
    ]
    parents = [record.parent + 1 for record in records]
    enabled = [record.enabled for record in records]
    return tables_of(range(1, len(records) + 1), parents, components, enabled=enabled, settings=document.settings)


def drawn(context: Context, scene: str, quality: Quality, **marks: object) -> NDArray[np.uint8]:
    """A scene's picture."""
    store = AssetStore()
    world = RenderWorld(DrawableAssets(store.get))
    world.set_scene({"still_life": still_life, "yard": demo_scene}[scene](store))
    renderer = Renderer(context, quality=quality)
    renderer.settle(world)
    world.place()
    picture = renderer.draw(world, world.camera(SIZE[0] / SIZE[1]), *SIZE, **marks)  # type: ignore[arg-type]
    world.assets.close()
    return renderer.read_pixels(picture)[..., :3]


@pytest.mark.parametrize(
    ("name", "scene", "quality", "marks"),
    [
        ("still_life", "still_life", FULL, {}),
        ("still_life_fast", "still_life", FAST, {}),
        ("still_life_edited", "still_life", FULL, {"selection": (3, 6), "grid": True}),
        ("yard", "yard", FULL, {}),
    ],
)
def test_pictures_stay_as_they_are(
    context: Context, request: pytest.FixtureRequest, name: str, scene: str, quality: Quality, marks: dict[str, object]
) -> None:
    picture = drawn(context, scene, quality, **marks)
    path = FOLDER / f"{name}.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    far_off = float((difference.max(axis=-1) > FAR_OFF).mean())
    assert difference.mean() <= MEAN_TOLERANCE, f"{name} differs by {difference.mean():.2f} on average"
    assert far_off <= FAR_OFF_SHARE, f"{far_off:.2%} of the pixels of {name} are far off"


def test_a_changed_scene_would_be_noticed(context: Context) -> None:
    """The tolerance is not so wide that everything passes: without its shadows the picture is refused."""
    store = AssetStore()
    tables = still_life(store)
    for row, light in list(tables.lights.items()):
        tables.lights[row] = Light(**{**{f: getattr(light, f) for f in light.__struct_fields__}, "cast_shadows": False})
    world = RenderWorld(DrawableAssets(store.get))
    world.set_scene(tables)
    renderer = Renderer(context, quality=FULL)
    renderer.settle(world)
    world.place()
    picture = renderer.read_pixels(renderer.draw(world, world.camera(SIZE[0] / SIZE[1]), *SIZE))[..., :3]
    world.assets.close()
    difference = np.abs(picture.astype(int) - load_picture(FOLDER / "still_life.png").astype(int))
    assert (difference.max(axis=-1) > FAR_OFF).mean() > FAR_OFF_SHARE


@pytest.mark.parametrize("kind", DATA_KINDS)
def test_pictures_of_data_stay_as_they_are(context: Context, request: pytest.FixtureRequest, kind: DataKind) -> None:
    store = AssetStore()
    world = RenderWorld(DrawableAssets(store.get))
    world.set_scene(still_life(store))
    renderer = Renderer(context, quality=FULL)
    renderer.settle(world)
    world.place()
    values = renderer.draw_data(world, world.camera(SIZE[0] / SIZE[1]), *SIZE, kind)
    world.assets.close()
    picture = data_pixels(values, kind, depth_unit=depth_unit_of(values) if kind == "depth" else 1.0)
    path = FOLDER / f"still_life_{kind}.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    assert difference.mean() <= MEAN_TOLERANCE, f"{kind} differs by {difference.mean():.2f} on average"
    assert (difference.max(axis=-1) > FAR_OFF).mean() <= FAR_OFF_SHARE


def test_a_picture_of_classes_stays_as_it_is(context: Context, request: pytest.FixtureRequest) -> None:
    store = AssetStore()
    mirror = still_life_mirror(store)
    with OfflineRenderer(
        mirror, store.get, width=SIZE[0], height=SIZE[1], shows="segmentation", context=context
    ) as renderer:
        picture = renderer.picture()[..., :3]
    path = FOLDER / "still_life_segmentation.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    assert difference.mean() <= MEAN_TOLERANCE
    assert (difference.max(axis=-1) > FAR_OFF).mean() <= FAR_OFF_SHARE
