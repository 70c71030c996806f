"""References, components, prefabs, names and crowds in the inspector, by hand, as in test_inspector_panel.py."""

from __future__ import annotations

import json
from typing import Annotated

import pytest
from imgui_bundle import imgui

from elys.common.assets import AssetStore
from elys.common.components import Component, Light, about, component, forget
from elys.common.scene import EntityRecord, open_scene
from elys.editor_node import prefab_values
from elys.editor_node.fields import DraggedAsset, drag_asset
from elys.editor_node.keys import Key
from tests.unit.editor_node.hand import by_hand as by_hand
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl


# --- references --------------------------------------------------------------------------------------------------------

REFERRING = [
    EntityRecord(name="Gate", components={"Transform": {}, "Joint": {}}),
    EntityRecord(name="Post ##1 日本 🙂", components={"Transform": {}}),
    EntityRecord(name="Wall", components={"Transform": {}, "MeshRenderer": {"mesh": "sphere"}, "Material": {}}),
]


def test_entities_are_dropped_picked_followed_and_cleared(by_hand, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        post, wall = (person.stage.named(name) for name in ("Post ##1 日本 🙂", "Wall"))
        await hand.carry("hierarchy/Post ##1 日本 🙂", "inspector/Joint/other")
        assert hand.value("Gate", "Joint", "other") == post
        await person.click("inspector/Joint/other/pick")
        await person.frames(3)
        await person.type("WA")
        await person.frames(2)
        person.editor.screenshot(screenshot_directory / "inspector-pick.png")
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Gate", "Joint", "other") == wall
        await person.click("inspector/Joint/other/pick")
        await person.frames(3)
        await person.click("inspector/Joint/other/pick/Gate")
        await hand.settle()
        assert hand.value("Gate", "Joint", "other") == person.stage.named("Gate")
        await person.press(Key.Z, CTRL)
        await hand.settle()
        person.stage.host.kind = "replay"
        person.stage.host.publish_status()
        await person.until(lambda: hand.model.is_replay)
        await person.frames(2)
        await person.click("inspector/Joint/other/follow")  # to look about is possible in a recording too
        assert hand.model.selection.entities == (wall,)
        person.stage.host.kind = "simulation"
        person.stage.host.publish_status()
        await person.click("hierarchy/Gate")
        await person.frames(2)
        await person.click("inspector/Joint/other/clear")
        await hand.settle()
        assert hand.value("Gate", "Joint", "other") == 0

    by_hand(scenario, "Gate", REFERRING)


def test_assets_are_dropped_picked_and_followed_to_who_uses_them(by_hand):
    async def scenario(hand):
        person = hand.person

        def browser(ui):
            if imgui.begin("Carried"):
                imgui.set_window_pos((500.0, 300.0))
                for kind, reference in (("mesh", "chair.glb#0/0"), ("image", "wood.png")):
                    imgui.button(reference)
                    ui.landmarks.note(f"carried/{reference}")
                    drag_asset(ui, DraggedAsset(reference=reference, kind=kind, name=reference))
            imgui.end()

        person.editor.workspace._panels["Carried"] = browser
        await person.frames(8)
        await hand.fold("Transform")
        await hand.carry("carried/wood.png", "inspector/MeshRenderer/mesh")
        assert hand.value("Wall", "MeshRenderer", "mesh") == "sphere"  # a picture is no mesh
        await hand.carry("carried/chair.glb#0/0", "inspector/MeshRenderer/mesh")
        assert hand.value("Wall", "MeshRenderer", "mesh") == "chair.glb#0/0"
        await hand.carry("carried/wood.png", "inspector/Material/base_color_texture")
        assert hand.value("Wall", "Material", "base_color_texture") == "wood.png"
        await person.click("inspector/MeshRenderer/mesh/pick")
        await person.frames(3)
        await person.type("caps")
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Wall", "MeshRenderer", "mesh") == "capsule"
        await person.click("inspector/MeshRenderer/mesh/follow")
        assert hand.model.selection.entities == (person.stage.named("Wall"),)
        await person.click("inspector/MeshRenderer/mesh/clear")
        await hand.settle()
        assert hand.value("Wall", "MeshRenderer", "mesh") == "box"
        await person.click("inspector/Material/normal_texture")
        await person.type("été ☀.png")
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Wall", "Material", "normal_texture") == "été ☀.png"

    by_hand(scenario, "Wall", REFERRING)


# --- components --------------------------------------------------------------------------------------------------------


def test_a_component_is_found_by_what_it_does_and_added_with_enter(by_hand):
    async def scenario(hand):
        person, sun = hand.person, hand.person.stage.named("Sun")
        await person.click("inspector/add")
        await person.frames(3)
        await person.type("by forces")  # nobody's name
        await person.press(Key.ENTER)
        await hand.settle()
        assert set(hand.entities[sun].components) == {"Transform", "Light"}
        await person.press(Key.A, CTRL)
        await person.type("point of view")
        await person.frames(2)
        await person.press(Key.ENTER)
        await hand.settle()
        assert "Camera" in hand.entities[sun].components
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert "Camera" not in hand.entities[sun].components

    by_hand(scenario, "Sun")


def test_a_component_is_switched_on_its_header(by_hand):
    async def scenario(hand):
        await hand.person.click("inspector/MeshRenderer/switch")
        await hand.settle()
        assert not hand.value("Box 1", "MeshRenderer", "visible")
        assert "inspector/RigidBody/switch" not in await hand.shown()

    by_hand(scenario, "Box 1")


def test_components_are_copied_and_pasted(by_hand):
    async def scenario(hand):
        person = hand.person
        await person.click("inspector/RigidBody/menu")
        await person.click("component/copy")
        assert json.loads(imgui.get_clipboard_text())["elys_components"]["RigidBody"]["mass"] == 5.0
        await person.click("hierarchy/Box 1")
        await person.click("hierarchy/Box 2", held=SHIFT)
        await person.frames(2)
        await person.click("inspector/RigidBody/menu")
        await person.click("component/paste")
        await hand.settle()
        assert [hand.value(f"Box {n}", "RigidBody", "mass") for n in (1, 2, 3)] == [5.0, 5.0, 1.0]
        await person.click("hierarchy/Sun")
        await person.click("inspector/Light/menu")
        await person.click("component/paste")  # no light: it is grey
        await person.press(Key.ESCAPE)
        await person.click("inspector/Light/menu")
        await person.click("component/paste_new")
        await hand.settle()
        assert hand.value("Sun", "RigidBody", "mass") == 5.0
        assert hand.value("Sun", "Light", "kind") == "directional"
        await person.click("hierarchy/Ground")
        imgui.set_clipboard_text('{"elys_components": {"Light": {"kind": "spot", "intensity": 12}}}')
        await person.click("inspector/add")
        await person.frames(3)
        await person.click("component/paste_copied")
        await hand.settle()
        assert hand.entities[person.stage.named("Ground")].components["Light"] == Light(kind="spot", intensity=12.0)

    by_hand(scenario)


def test_fields_are_filtered_and_folds_are_kept(by_hand):
    async def scenario(hand):
        person = hand.person
        await hand.fold("RigidBody")
        assert person.editor.preferences.folded == ["RigidBody"]
        shown = await hand.shown()
        assert "inspector/RigidBody" in shown and "inspector/RigidBody/mass" not in shown
        await person.press(Key.F, CTRL | SHIFT)
        await person.frames(2)
        await person.type("mass")
        shown = await hand.shown()
        assert "inspector/RigidBody/mass" in shown  # found in what is folded
        assert not {"inspector/Transform", "inspector/RigidBody/motion"} & shown
        await person.press(Key.A, CTRL)
        await person.press(Key.BACKSPACE)
        await person.press(Key.ESCAPE)
        assert "inspector/RigidBody/mass" not in await hand.shown()
        await person.click("hierarchy/Box 1")
        assert "inspector/RigidBody/mass" not in await hand.shown()
        person.editor.ui.actions.run("inspector.unfold_all")
        assert "inspector/RigidBody/mass" in await hand.shown()
        person.editor.ui.actions.run("inspector.fold_all")
        assert set(person.editor.preferences.folded) == {"Transform", "RigidBody", "MeshRenderer", "Material"}
        person.editor.ui.actions.run("inspector.add_component")
        await person.frames(3)
        assert "component/search" in await hand.shown()

    by_hand(scenario)


# --- prefabs -----------------------------------------------------------------------------------------------------------


def test_what_differs_from_the_prefab_is_marked_and_reverted(by_hand, tmp_path, monkeypatch, screenshot_directory):
    # The editor has no such file: as on another machine, all that it knows of the prefab the host has told it.
    monkeypatch.setattr(prefab_values, "modified_at", lambda path: -1.0)
    monkeypatch.setattr(prefab_values, "read_prefab", lambda path: pytest.fail(f"the editor read {path}"))
    bulb = {"Transform": {"position": [0, 1, 0]}, "Light": {"kind": "point", "intensity": 10}}
    lamp = {"name": "Lamp", "components": {"Transform": {}}, "children": [{"name": "Bulb", "components": bulb}]}
    (tmp_path / "lamp.prefab.json").write_text(json.dumps({"elys_scene": 1, "entities": [lamp]}), encoding="utf-8")
    changes = {"Bulb": {"Light": {"intensity": 50, "range": 4}}}
    placed = {
        "name": "Desk lamp",
        "prefab": "lamp.prefab.json",
        "components": {"Transform": {"position": [3, 0, 0]}},
        "overrides": changes,
    }
    (tmp_path / "room.scene.json").write_text(json.dumps({"elys_scene": 1, "entities": [placed]}), encoding="utf-8")
    records = open_scene(tmp_path / "room.scene.json", AssetStore()).records

    async def scenario(hand):
        person = hand.person
        await person.until(lambda: hand.model.prefabs.of(person.stage.named("Bulb")) is not None)
        shown = await hand.shown()
        assert {"inspector/prefab", "inspector/revert_all"} <= shown
        person.editor.screenshot(screenshot_directory / "inspector-prefab.png")
        await hand.right_click("inspector/Light/intensity/label")
        await person.click("inspector/Light/intensity/menu/revert")
        await hand.settle()
        assert hand.value("Bulb", "Light", "intensity") == 10.0
        assert hand.value("Bulb", "Light", "range") == 4.0
        await hand.enter("Transform/position/0", "2")
        await person.click("inspector/revert_all")
        await hand.settle()
        assert hand.value("Bulb", "Light", "range") == 0.0
        assert hand.value("Bulb", "Transform", "position") == (0.0, 1.0, 0.0)
        assert "inspector/revert_all" not in await hand.shown()
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert hand.value("Bulb", "Transform", "position") == (2.0, 1.0, 0.0)
        await person.click("hierarchy/Desk lamp")
        assert "inspector/revert_all" not in await hand.shown()  # where it stands is its own

    by_hand(scenario, "Bulb", records)


# --- names and crowds --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Дом", "日本語", "🙂🚀", "a##b###c", "100 % {x}", "  naïve  ", "שלום", "e\u0301"])
def test_any_name_is_taken_as_it_is(by_hand, name):
    async def scenario(hand):
        crate = hand.person.stage.named("Crate")
        await hand.person.click("inspector/name")
        await hand.person.press(Key.A, CTRL)
        await hand.person.type(name)
        await hand.person.press(Key.ENTER)
        await hand.person.until(lambda: hand.entities[crate].name == name.strip())
        await hand.shown()
        await hand.person.press(Key.Z, CTRL)
        await hand.person.until(lambda: hand.entities[crate].name == "Crate")

    by_hand(scenario)


@pytest.fixture
def many_components():
    """Thirty components of four fields, known while the test runs."""
    made = []
    for number in range(30):
        fields = {f"value_{place}": Annotated[float, about("Anything.", unit="m")] for place in range(4)}
        namespace = {"__annotations__": fields, "__doc__": "Of a test.", **dict.fromkeys(fields, 0.0)}
        made.append(component(type(Component)(f"Part{number:02}", (Component,), namespace, frozen=True)))
    yield [struct.__name__ for struct in made]
    for struct in made:
        forget(struct)


def test_thirty_components_of_many_entities(by_hand, many_components):
    count = 120
    parts = {name: {} for name in many_components}
    records = [EntityRecord(name=f"Thing {n}", components={"Transform": {}, **parts}) for n in range(count)]

    async def scenario(hand):
        person = hand.person
        await person.press(Key.A, CTRL)
        await person.until(lambda: len(hand.model.selection) == count)
        await person.frames(3)
        shown = [name for name in await hand.shown() if name.endswith("/value_0")]
        assert 3 <= len(shown) < 15  # what is out of sight is not drawn
        await hand.enter("Part00/value_0", "2")
        assert {entity.components["Part00"].value_0 for entity in hand.entities.values()} == {2.0}
        await person.press(Key.Z, CTRL)
        await person.until(lambda: {e.components["Part00"].value_0 for e in hand.entities.values()} == {0.0})
        await person.click("inspector/search")
        await person.type("part29")
        await person.frames(3)
        await hand.enter("Part29/value_3", "1/3")
        assert {entity.components["Part29"].value_3 for entity in hand.entities.values()} == {1.0 / 3.0}

    by_hand(scenario, "", records)
