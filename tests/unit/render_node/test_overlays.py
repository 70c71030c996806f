"""Overlays in pictures: where they are seen and where not, and that what changes is what is followed."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    SceneDelta,
    Spawned,
)
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.assets import AssetStore
from elys.common.components import (
    Camera,
    Component,
    MeshRenderer,
    Overlay,
    OverlayBar,
    OverlayImage,
    OverlayPanel,
    OverlayText,
    Transform,
    values_of,
)
from elys.common.scene import SceneSettings
from elys.render_node.camera import View
from elys.render_node.fonts import face_of
from elys.render_node.gpu import Context
from elys.render_node.offline import OfflineRenderer
from elys.render_node.overlays import NO_OVERLAYS, OverlayBoard
from elys.render_node.pass_plan import scene_passes
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneReader

WHITE_PANEL = OverlayPanel(color=(1.0, 1.0, 1.0), opacity=1.0, radius=0.0)


class Scene:
    """A mirror that is told things."""

    def __init__(self) -> None:
        self.mirror = SceneMirror()
        self.mirror.epoch = 1
        self.mirror.settings = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0))
        self._next = 1

    def tell(self, *changes: Any) -> None:
        self.mirror.apply_delta(SceneDelta(epoch=1, sequence=self.mirror.sequence + 1, tick=0, changes=tuple(changes)))

    def add(self, *components: Component, parent: int = 0) -> int:
        entity, self._next = self._next, self._next + 1
        parts = {type(part).__name__: values_of(part) for part in components}
        self.tell(Spawned(entity=entity, name=f"e{entity}", parent=parent, enabled=True, components=parts))
        return entity

    def set(self, entity: int, component: Component) -> None:
        self.tell(ComponentSet(entity=entity, component=type(component).__name__, values=values_of(component)))

    def picture(self, context: Context, width: int = 160, height: int = 90, **options: Any) -> np.ndarray[Any, Any]:
        with OfflineRenderer(self.mirror, width=width, height=height, context=context, **options) as renderer:
            return renderer.picture()[..., :3]


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_a_panel_covers_the_pixels_of_its_rectangle(scene: Scene, context: Context) -> None:
    scene.add(Overlay(anchor="bottom_right", x=-0.1, y=-0.2, width=0.5, height=0.3), WHITE_PANEL)
    picture = scene.picture(context)
    expected = np.zeros((90, 160), bool)
    expected[45:72, 106:151] = True  # 90 - 18 - 27, 160 - 9 - 45
    assert (picture[expected] == 255).all()
    assert (picture[~expected] == 0).all()


def test_half_a_pixel_is_half_covered_and_corners_are_round(scene: Scene, context: Context) -> None:
    scene.add(Overlay(x=10.25 / 90, y=10 / 90, width=20 / 90, height=20 / 90), WHITE_PANEL)
    scene.add(
        Overlay(x=60 / 90, y=10 / 90, width=40 / 90, height=40 / 90),
        OverlayPanel(color=(1.0, 1.0, 1.0), opacity=1.0, radius=1.0),
    )
    picture = scene.picture(context)[..., 0].astype(int)
    assert picture[20, [10, 30]] == pytest.approx([191, 64], abs=2)
    assert picture[30, 11:30].min() == 0
    ball = picture[10:50, 60:100] / 255.0
    assert ball.sum() == pytest.approx(np.pi * 20**2, rel=0.005)


def test_a_bar_shows_its_value_and_an_image_its_pixels(scene: Scene, context: Context) -> None:
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0], pixels[1] = (255, 0, 0, 255), (0, 0, 255, 255)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    store = AssetStore()
    reference = store.put(file.getvalue(), kind="image")
    plain = OverlayBar(value=0.25, color=(0, 1, 0), back_color=(1, 0, 0), back_opacity=1.0, radius=0.0)
    scene.add(Overlay(width=80 / 90, height=10 / 90), plain)
    scene.add(Overlay(anchor="bottom_left", width=40 / 90, height=40 / 90), OverlayImage(image=reference))
    scene.add(Overlay(anchor="bottom_right", width=20 / 90, height=20 / 90), OverlayImage(image="blake2b:" + "0" * 32))
    picture = scene.picture(context, fetch=store.get)
    assert picture[5, 10].tolist() == [0, 255, 0]
    assert picture[5, 30].tolist() == [255, 0, 0]
    assert picture[52, 20].tolist() == [255, 0, 0]  # the upper row of the file is the upper one seen
    assert picture[88, 20].tolist() == [0, 0, 255]
    assert picture[72:88, 142:158].reshape(-1, 3).max(axis=0).tolist()[0] > 200  # what cannot be had is a checker


def test_an_image_larger_than_the_card_takes_is_drawn_coarser_and_named(
    scene: Scene, context: Context, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    file = io.BytesIO()
    Image.fromarray((np.add.outer(np.arange(60), np.arange(60)) % 2 * 255).astype(np.uint8)).save(file, "png")
    store = AssetStore()
    reference = store.put(file.getvalue(), kind="image", source="map.png")
    scene.add(Overlay(width=1.0, height=1.0), OverlayImage(image=reference))
    small = OfflineRenderer(scene.mirror, store.get, width=90, height=90, context=context, source_of=store.source)
    monkeypatch.setattr(Context, "max_size", 30)
    with small as renderer:
        assert renderer.picture()[45, 45, 0] == pytest.approx(188, abs=1)  # half the light
    (told,) = [record.getMessage() for record in caplog.records]
    assert (
        told
        == f"map.png ({reference}), of an overlay, of 60 x 60 pixels is drawn with 30 x 30: this card takes edges up to 30"
    )


def test_letters_are_those_of_the_font_pixel_by_pixel(scene: Scene, context: Context) -> None:
    scene.add(Overlay(), OverlayText(text="R", size=0.5, outline=0.0))
    picture = scene.picture(context)[..., 0]
    face = face_of(45.0)
    glyph = face.glyph("R")
    assert glyph is not None
    top = int(np.floor(face.ascent + 0.5)) + glyph.top
    height, width = glyph.mask.shape
    left = glyph.left
    seen = picture[top : top + height, max(left, 0) : left + width]
    np.testing.assert_allclose(seen, glyph.mask[:, max(-left, 0) :], atol=1)


def test_overlays_are_in_no_data_and_nobody_picks_them(scene: Scene, context: Context, renderer: Renderer) -> None:
    scene.add(Transform(position=(0.0, 0.0, 8.0)), Camera())
    box = scene.add(Transform(), MeshRenderer())
    without = {}
    views = ("normals", "depth", "entity", "albedo")
    for shows in views:
        without[shows] = scene.picture(context, shows=shows)
    scene.add(Overlay(anchor="center", width=2.0, height=1.0), WHITE_PANEL, OverlayText(text="Over"))
    for shows in views:
        np.testing.assert_array_equal(scene.picture(context, shows=shows), without[shows])
    assert scene.picture(context)[45, 80].min() > 0
    with OfflineRenderer(scene.mirror, width=64, height=36, context=context) as drawn:
        light = drawn.values()
        assert (light[0, 0] == 0.0).all()
    world, reader = RenderWorld(), SceneReader(scene.mirror)
    world.read_scene(reader)
    assert renderer.pick(world, world.camera(), 160, 90, 80, 45)[0] == box


def test_a_picture_in_parts_has_its_overlays_whole(scene: Scene, context: Context) -> None:
    scene.add(
        Overlay(anchor="center", width=1.2, height=0.8), OverlayPanel(border=0.02), OverlayText(text="Whole", size=0.3)
    )
    whole = scene.picture(context, 200, 120)
    parts = scene.picture(context, 200, 120, tile_edge=64)
    np.testing.assert_allclose(parts.astype(int), whole.astype(int), atol=1)
    assert whole.max() > 200


def test_the_pass_runs_only_where_there_are_overlays_and_says_why(scene: Scene) -> None:
    def told() -> tuple[bool, str]:
        found = next(one for one in scene_passes(scene.mirror, None, 160, 90) if one.name == "overlays")
        return found.is_on, found.why

    assert told() == (False, "the scene has no overlays")
    scene.add(OverlayText(text="a"))
    assert told() == (True, "1 entity is drawn over the picture")


def test_the_board_follows_values_structure_and_switches(scene: Scene) -> None:
    board, world = OverlayBoard(scene.mirror), RenderWorld()
    assert board.shown(world) is NO_OVERLAYS
    thing = scene.add(Transform())
    version = board.version
    scene.set(thing, Transform(position=(1.0, 0.0, 0.0)))
    scene.tell(Renamed(entity=thing, name="Other"))
    assert board.version == version  # nothing of it is drawn over the picture
    panel = scene.add(Overlay(width=0.5), OverlayPanel())
    between = scene.add(Transform(), parent=panel)
    row = scene.add(OverlayText(text="a"), parent=between)
    assert [(node.entity, node.parent) for node in board.shown(world).nodes] == [(panel, -1), (row, 0)]
    nodes = board.shown(world).nodes
    scene.set(row, OverlayText(text="b"))
    assert board.shown(world).nodes is nodes  # the same list, one of it told anew
    assert nodes[1].text is not None
    assert nodes[1].text.text == "b"
    assert board.version > version
    scene.set(row, Overlay(x=0.5))
    scene.set(thing, OverlayBar(value=0.5))
    assert [node.entity for node in board.shown(world).nodes] == [thing, panel, row]
    scene.tell(EnabledSet(entity=panel, enabled=False))
    assert [node.entity for node in board.shown(world).nodes] == [thing]
    scene.tell(EnabledSet(entity=panel, enabled=True), Reparented(entity=row, parent=0, index=-1))
    assert [(node.entity, node.parent) for node in board.shown(world).nodes] == [(thing, -1), (panel, -1), (row, -1)]
    scene.tell(ComponentRemoved(entity=thing, component="OverlayBar"), Despawned(entity=panel))
    assert [node.entity for node in board.shown(world).nodes] == [row]


def test_a_label_stands_over_what_it_follows_and_goes_with_it(scene: Scene, context: Context, make_frame: Any) -> None:
    ball = scene.add(Transform())
    scene.add(Overlay(follow=ball, anchor="center", width=4 / 90, height=4 / 90), WHITE_PANEL)
    scene.add(Overlay(follow=99, anchor="center", width=4 / 90, height=4 / 90), WHITE_PANEL)  # nobody: not drawn
    camera = ViewCamera(position=(0.0, 0.0, 10.0), rotation=(0.0, 0.0, 0.0, 1.0))
    with OfflineRenderer(scene.mirror, width=160, height=90, context=context) as renderer:
        for place in ((0.0, 0.0, 0.0), (1.0, -1.0, 0.0)):
            scene.mirror.keep_frame(make_frame({ball: place}, published_at=int(place[0]) + 1, tick=int(place[0]) + 1))
            seen = renderer.picture(camera=camera)[..., 0] > 128
            rows, columns = np.nonzero(seen)
            view = View.of(camera, 160, 90)
            clip = view.clip_from_relative @ np.append(np.array(place) - view.eye, 1.0)
            expected = (clip[:2] / clip[3] * (0.5, -0.5) + 0.5) * (160, 90)
            assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx(tuple(expected), abs=0.6)
            assert seen.sum() in range(9, 26)


def test_a_view_shows_what_its_player_sees(scene: Scene, renderer: Renderer) -> None:
    for player in (0, 1, 2):
        scene.add(Overlay(x=player * 40 / 90, width=30 / 90, height=30 / 90, player=player), WHITE_PANEL)
    world, board = RenderWorld(), OverlayBoard(scene.mirror)
    world.read_scene(SceneReader(scene.mirror))
    for player, seen in ((1, [True, True, False]), (2, [True, False, True]), (3, [True, False, False])):
        overlays = board.shown(world, player=player)
        picture = renderer.draw(world, world.camera(), 160, 90, overlays=overlays)
        pixels = renderer.read_pixels(picture)
        assert [bool(pixels[15, 15 + 40 * k, 0] == 255) for k in range(3)] == seen


def test_pictures_are_the_same_each_time(scene: Scene, context: Context) -> None:
    scene.add(Overlay(anchor="center"), OverlayPanel(), OverlayText(text="{:time}\nÉtape", value=12.34, size=0.2))
    np.testing.assert_array_equal(scene.picture(context), scene.picture(context))
