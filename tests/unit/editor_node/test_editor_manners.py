"""Small manners of the editor: what it says and for how long, where new things go, what is in front."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from elys.bus.messages.views import ViewCamera
from elys.common.assets.store import reference_of
from elys.common.components import Collider, Joint, Light, MeshRenderer, declaration_of
from elys.common.ids import entity_of
from elys.common.scene import EntityRecord
from elys.editor_node import node
from elys.editor_node.field_values import has_effect
from elys.editor_node.fields import asset_label
from elys.editor_node.imgui_layer import ImGuiLayer
from elys.editor_node.keys import Key
from elys.editor_node.model import MESSAGE_TIME
from elys.editor_node.panels import profiler
from elys.editor_node.panels.inspector import entity_label
from elys.editor_node.panels.toolbar import pace_text
from elys.editor_node.view_stream import View, ViewStream


def test_messages_leave_after_a_while_and_at_the_next_success(on_stage):
    async def scenario(stage):
        model, now = stage.model, [100.0]
        model._clock = lambda: now[0]
        model.say("error", "no")
        now[0] += MESSAGE_TIME - 0.1
        model.fade_messages()
        assert model.error == "no"
        now[0] += 0.2
        model.fade_messages()
        assert not model.error
        model.say("error", "no")
        model.step()
        await stage.until(lambda: not model.error)
        model.say("error", "no")
        model._link_changed(True)
        assert not model.error

    on_stage(scenario)


class Texture:
    def upload(self, pixels, width, height):
        pass


def test_another_look_at_the_same_tick_is_no_older(on_stage):
    async def scenario(stage):
        source = await stage.picture_source(entity=0)
        stream = ViewStream(stage.model.session)

        async def shown_from(x: float) -> float:
            stream.want(View(ViewCamera(position=(x, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0)), 64, 32))
            await stage.until(lambda: stream._arrived is not None and stream._arrived.camera.position[0] == x)
            assert stream.upload(Texture())
            return stream.latency

        await stage.until(lambda: stream.renderer is not None)
        source.state_published_at = 1  # 1970
        first = await shown_from(1.0)
        assert first > 1e9
        assert await shown_from(2.0) == first
        source.tick += 1
        assert await shown_from(3.0) > first
        stream.close()
        await source.close()

    on_stage(scenario)
    assert pace_text(0.002, 0.0) == "interface 2.0 ms"
    assert pace_text(0.002, 0.05) == "picture 50 ms behind the simulation     interface 2.0 ms"


def test_new_bodies_stand_above_what_is_there(on_stage):
    records = [
        EntityRecord(name="Ground", components={"Transform": {"scale": [20, 1, 20]}, "Collider": {}}),
        EntityRecord(name="Crate", components={"Transform": {"position": [0, 1.5, 0], "scale": [2, 2, 2]}, "Collider": {}}),
        EntityRecord(name="Shelf", components={"Transform": {"position": [5, 4, 0]}, "MeshRenderer": {}}),
        EntityRecord(
            name="Turned",
            components={"Transform": {"position": [0, 1, 5], "rotation": [0, 0, 0.5**0.5, 0.5**0.5]},
                        "Collider": {"size": [6, 1, 1], "offset": [1, 0, 0]}},
        ),
    ]  # fmt: skip

    async def scenario(stage):
        model = stage.model

        async def height(kind: str, *at: float) -> float:
            await model.edit.spawn(kind, at=np.array(at))
            made = model.scene.component_of(model.selection.primary, "Transform").position
            await model.edit.delete()
            assert (made[0], made[2]) == (at[0], at[2])
            return made[1]

        assert await height("Box", 8.0, 0.0, 8.0) == pytest.approx(1.0, abs=0.01)  # on the ground
        assert await height("Sphere", 0.5, 0.2, 0.5) == pytest.approx(3.0, abs=0.01)  # on the crate on it
        assert await height("Box", 5.0, 0.2, 0.0) == pytest.approx(1.0, abs=0.01)  # below the shelf there is room
        assert await height("Box", 5.0, 3.8, 0.0) == pytest.approx(5.0, abs=0.01)
        assert await height("Box", 0.0, 2.0, 5.0) == pytest.approx(5.5, abs=0.01)  # it stands upright, 1 + 1 + 3 high
        assert await height("Box", 90.0, -3.0, 0.0) == 0.5
        assert await height("Box", 90.0, 7.0, 0.0) == 7.0
        assert await height("Light", 0.0, 0.0, 0.0) == 0.0

    on_stage(scenario, records)


def test_what_has_no_extent_is_looked_at_from_afar(on_stage):
    async def scenario(stage):
        model = stage.model
        assert model.bounds_of([stage.named("Sun")])[1] == pytest.approx(1.0)
        _, alone = model.bounds_of([stage.named("Crate")])
        _, with_empty_children = model.bounds_of([stage.named(name) for name in ("Crate", "Lid", "Handle")])
        assert with_empty_children == alone == pytest.approx(3**0.5 / 2)

    on_stage(scenario)


def test_words_for_ids_assets_and_fields():
    assert entity_label(entity_of(5, 0)) == "entity 5"
    assert entity_label(entity_of(5, 2)) == "entity 5 (reused 2x)"
    reference = reference_of(b"x")
    mesh, texture = declaration_of(MeshRenderer).field("mesh"), declaration_of("Material").field("normal_texture")
    assert asset_label(mesh, reference) == f"mesh {reference[8:16]}"
    assert asset_label(texture, reference) == f"image {reference[8:16]}"
    clips = declaration_of("Animation").field("clips")
    assert asset_label(clips, reference) == f"clips {reference[8:16]}"
    assert asset_label(mesh, "box") == "box"
    box, ball = Collider(), Collider(shape="sphere")
    assert [has_effect(c, f) for c in (box, ball) for f in ("size", "radius", "offset")] == [
        True, False, True, False, True, True,
    ]  # fmt: skip
    gear, hinge = Joint(kind="gear"), Joint(kind="hinge")
    assert [has_effect(c, f) for c in (gear, hinge) for f in ("ratio", "lower", "anchor")] == [
        True, False, True, False, True, True,
    ]  # fmt: skip
    effects = [
        [has_effect(Light(kind=kind), field) for field in ("range", "inner_cone_angle", "intensity")]
        for kind in ("directional", "point", "spot")
    ]
    assert effects == [[False, False, True], [True, False, True], [True, True, True]]


@pytest.mark.gl
def test_escape_closes_a_menu_before_it_deselects(at_the_editor):
    async def scenario(person):
        selection = person.editor.model.selection
        await person.click("hierarchy/Crate")
        await person.click("hierarchy/add")
        await person.frames(3)
        del person.editor.ui.landmarks.rectangles["add/Box"]
        await person.frames(2)
        assert "add/Box" in person.editor.ui.landmarks.rectangles  # it is open
        await person.press(Key.ESCAPE)
        del person.editor.ui.landmarks.rectangles["add/Box"]
        await person.frames(3)
        assert "add/Box" not in person.editor.ui.landmarks.rectangles
        assert selection
        await person.press(Key.ESCAPE)
        assert not selection

    at_the_editor(scenario)


@pytest.mark.gl
def test_a_selected_row_stays_blue_under_the_pointer(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        await person.click("hierarchy/Box 3")
        await person.frames(2)
        editor.screenshot(screenshot_directory / "editor-hovered.png")
        pixels = np.asarray(Image.open(screenshot_directory / "editor-hovered.png"))
        left, top, _, bottom = (int(edge) for edge in editor.ui.landmarks.rectangles["hierarchy/Box 3"])
        red, _, blue = pixels[(top + bottom) // 2, left + 150, :3].astype(int)
        assert blue > red + 40

    at_the_editor(scenario)


@pytest.mark.gl
def test_the_console_is_in_front_also_where_another_was_when_the_editor_was_closed(
    at_the_editor, tmp_path, monkeypatch
):
    layout_file = tmp_path / "editor.ini"
    monkeypatch.setattr(node, "ImGuiLayer", lambda *a, **named: ImGuiLayer(*a, **{**named, "layout_file": layout_file}))

    async def scenario(person):
        rectangles = person.editor.ui.landmarks.rectangles
        await person.frames(4)
        rectangles.clear()
        await person.frames(2)
        assert "console/filter" in rectangles
        imgui.set_window_focus(profiler.TITLE)
        await person.frames(4)
        rectangles.clear()
        await person.frames(2)
        assert "console/filter" not in rectangles

    at_the_editor(scenario)
    assert layout_file.exists()
    at_the_editor(scenario)


@pytest.mark.gl
def test_a_recording_says_that_it_cannot_be_edited(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        host.kind = "replay"
        host.publish_status()
        await person.until(lambda: editor.model.is_replay)
        crate = person.stage.named("Crate")
        await person.click("hierarchy/Crate")
        await person.frames(2)
        assert "inspector/recording" in editor.ui.landmarks.rectangles
        assert "inspector/add" not in editor.ui.landmarks.rectangles
        host.received.clear()
        await person.drag("inspector/Transform/position/1", 120.0, 0.0)
        await person.frames(2)
        assert host.received == []
        assert host.mirror.entities[crate].components["Transform"].position == (1.0, 2.0, 3.0)

    at_the_editor(scenario)
