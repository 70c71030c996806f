"""The inspector by hand: the real panel in the real editor on GLFW's null platform, a small host behind it."""

from __future__ import annotations

import json
from typing import Annotated

import pytest
from imgui_bundle import imgui
from scipy.spatial.transform import Rotation

from elys.common.assets import AssetStore
from elys.common.components import Component, Light, about, component, forget
from elys.common.scene import EntityRecord, open_scene
from elys.editor_node.events import MouseButton, MousePressed, MouseReleased
from elys.editor_node.fields import DraggedAsset, drag_asset
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl


class Hand:
    """What hands do in the inspector again and again."""

    def __init__(self, person) -> None:
        self.person = person
        self.model = person.editor.model
        self.entities = person.stage.host.mirror.entities
        self.landmarks = person.editor.ui.landmarks

    def value(self, name: str, component: str, field: str):
        return getattr(self.entities[self.person.stage.named(name)].components[component], field)

    async def settle(self) -> None:
        await self.model.history.settle()
        await self.person.frames(2)

    async def enter(self, field: str, text: str) -> None:
        """Types into a number and presses Enter."""
        await self.person.click(f"inspector/{field}", times=2)
        await self.person.press(Key.A, CTRL)
        await self.person.type(text)
        await self.person.press(Key.ENTER)
        await self.settle()

    async def shown(self) -> set[str]:
        """The landmarks that are drawn now."""
        self.landmarks.rectangles.clear()
        await self.person.frames(2)
        return set(self.landmarks.rectangles)

    async def fold(self, *components: str) -> None:
        for name in components:
            await self.person.click(f"inspector/{name}")
            await self.person.frames(2)

    async def right_click(self, name: str) -> None:
        await self.person.point(name)
        await self.person.do(MousePressed(MouseButton.RIGHT), MouseReleased(MouseButton.RIGHT))
        await self.person.frames(3)

    async def carry(self, source: str, target: str) -> None:
        """Drags one widget onto another."""
        await self.person.until(lambda: target in self.landmarks.rectangles)
        start, end = self.landmarks.center(source), self.landmarks.center(target)
        await self.person.drag(source, end[0] - start[0], end[1] - start[1])
        await self.settle()


@pytest.fixture
def by_hand(at_the_editor):
    """Runs `await scenario(hand)` at an editor, with one entity selected by a click."""

    def play(scenario, select: str = "Crate", records=None) -> None:
        async def with_person(person):
            hand = Hand(person)
            if select:
                await person.click(f"hierarchy/{select}")
                await person.frames(2)
            await scenario(hand)

        at_the_editor(with_person, records)

    return play


# --- numbers -----------------------------------------------------------------------------------------------------------


def test_numbers_are_typed_with_expressions_and_units(by_hand):
    async def scenario(hand):
        await hand.enter("Transform/position/0", "30 cm")
        assert hand.value("Crate", "Transform", "position") == (0.3, 2.0, 3.0)
        await hand.enter("Transform/position/1", "+= 2*pi")
        assert hand.value("Crate", "Transform", "position")[1] == pytest.approx(8.283185307179586)
        await hand.enter("RigidBody/mass", "1.5e3 g")
        assert hand.value("Crate", "RigidBody", "mass") == 1.5
        await hand.enter("RigidBody/mass", "*2")
        assert hand.value("Crate", "RigidBody", "mass") == 3.0
        await hand.enter("RigidBody/linear_velocity/2", "72 km/h")
        assert hand.value("Crate", "RigidBody", "linear_velocity") == pytest.approx((0.0, 0.0, 20.0))
        await hand.enter("Transform/rotation/1", "pi/4 rad")
        turned = Rotation.from_quat(hand.value("Crate", "Transform", "rotation"))
        assert turned.as_euler("xyz", degrees=True) == pytest.approx((0.0, 45.0, 0.0), abs=1e-4)
        for _ in range(6):
            await hand.person.press(Key.Z, CTRL)
        await hand.settle()
        assert hand.value("Crate", "Transform", "position") == (1.0, 2.0, 3.0)
        assert hand.value("Crate", "RigidBody", "mass") == 5.0

    by_hand(scenario)


@pytest.mark.parametrize(
    ("field", "typed", "words"),
    [
        ("Transform/position/0", "3 kg", "is a mass, and this takes a length [m]"),
        ("Transform/position/0", "2*", "ends too early"),
        ("RigidBody/mass", "-1", "at least 1e-06 kg"),
        ("Transform/rotation/0", "2 m", "an angle"),
        ("Collider/restitution", "150%", "at most 1"),
    ],
)
def test_what_is_wrong_is_said_beside_the_field_and_not_sent(by_hand, field, typed, words):
    path = "inspector/" + "/".join(field.split("/")[:2])

    async def scenario(hand):
        person, received = hand.person, hand.person.stage.host.received
        if field.startswith("Collider"):
            await hand.fold("RigidBody")
        await hand.enter(field, typed)
        assert f"{path}/error" in await hand.shown()
        rows = person.editor.workspace.inspector.rows
        assert words in rows._refused[1]
        assert received == []
        assert rows._typing.text == typed  # it stays to be mended
        await person.press(Key.BACKSPACE)
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert f"{path}/error" not in await hand.shown()
        assert received == []

    by_hand(scenario)


def test_whole_numbers_stay_whole(by_hand):
    async def scenario(hand):
        await hand.fold("Transform", "RigidBody")
        await hand.enter("Collider/layer", "2^3 + 1")
        assert hand.value("Crate", "Collider", "layer") == 9
        await hand.enter("Collider/mask", "7/2")
        assert "inspector/Collider/mask/error" in await hand.shown()
        assert hand.value("Crate", "Collider", "mask") == -1
        await hand.person.press(Key.A, CTRL)
        await hand.person.type("7")
        await hand.person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Crate", "Collider", "mask") == 7
        assert "inspector/Collider/mask/error" not in await hand.shown()

    by_hand(scenario)


def test_tab_goes_on_to_the_next_number_and_shift_tab_back(by_hand):
    async def scenario(hand):
        person = hand.person
        await person.click("inspector/Transform/position/0", times=2)
        await person.press(Key.A, CTRL)
        await person.type("7")
        await person.press(Key.TAB)
        await person.frames(2)
        await person.press(Key.A, CTRL)
        await person.type("8")
        await person.press(Key.TAB)
        await person.frames(2)
        await person.press(Key.TAB, SHIFT)
        await person.frames(2)
        await person.press(Key.A, CTRL)
        await person.type("9")
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Crate", "Transform", "position") == (7.0, 9.0, 3.0)

    by_hand(scenario)


def test_a_number_half_typed_is_dropped_by_escape_and_by_another_selection(by_hand):
    async def scenario(hand):
        person = hand.person
        await person.click("inspector/RigidBody/mass", times=2)
        await person.type("99")
        await person.press(Key.ESCAPE)
        await person.click("inspector/RigidBody/mass", times=2)
        await person.type("9 kg kg kg")
        await person.press(Key.ENTER)
        assert "inspector/RigidBody/mass/error" in await hand.shown()
        await person.click("hierarchy/Box 1")
        await person.frames(3)
        assert "inspector/RigidBody/mass/error" not in await hand.shown()
        assert person.stage.host.received == []

    by_hand(scenario)


def test_a_bar_is_dragged_to_its_limit_and_not_beyond(by_hand):
    async def scenario(hand):
        await hand.fold("Transform", "RigidBody")
        await hand.person.drag("inspector/Collider/restitution", 500.0, 0.0)
        await hand.settle()
        assert hand.value("Crate", "Collider", "restitution") == 1.0
        await hand.person.press(Key.Z, CTRL)
        await hand.settle()
        assert hand.value("Crate", "Collider", "restitution") == 0.0
        assert not hand.model.history.undo_label

    by_hand(scenario)


def test_scale_keeps_its_proportions_with_the_chain(by_hand):
    async def scenario(hand):
        await hand.person.click("inspector/Transform/scale/chain")
        await hand.enter("Transform/scale/0", "40")
        assert hand.value("Ground", "Transform", "scale") == pytest.approx((40.0, 0.2, 40.0))
        await hand.person.drag("inspector/Transform/scale/0", -60.0, 0.0)
        await hand.settle()
        x, y, z = hand.value("Ground", "Transform", "scale")
        assert x < 40.0 and (y / x, z / x) == pytest.approx((0.005, 1.0), rel=1e-5)
        await hand.person.press(Key.Z, CTRL)
        await hand.settle()
        assert hand.value("Ground", "Transform", "scale") == pytest.approx((40.0, 0.2, 40.0))
        await hand.person.click("inspector/Transform/scale/chain")
        await hand.enter("Transform/scale/0", "10")
        assert hand.value("Ground", "Transform", "scale") == pytest.approx((10.0, 0.2, 40.0))

    by_hand(scenario, "Ground")


def test_a_turn_past_a_right_angle_goes_on(by_hand):
    async def scenario(hand):
        await hand.enter("Transform/rotation/1", "85")
        await hand.person.drag("inspector/Transform/rotation/1", 100.0, 0.0, steps=10)
        await hand.settle()
        rows = hand.person.editor.workspace.inspector.rows
        x, y, z = rows.angles._angles["inspector/Transform/rotation"]
        assert y > 110.0 and (x, z) == (0.0, 0.0)
        turned = Rotation.from_quat(hand.value("Crate", "Transform", "rotation"))
        assert turned.approx_equal(Rotation.from_euler("y", y, degrees=True), atol=1e-5)

    by_hand(scenario)


# --- several -----------------------------------------------------------------------------------------------------------


def test_several_show_where_they_differ_and_each_takes_what_is_relative(by_hand, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await person.click("hierarchy/Box 3", held=SHIFT)
        await person.frames(2)
        comparison = person.editor.workspace.inspector._comparison
        position = next(f for f in _fields("Transform") if f.name == "position")
        assert comparison.mixed("Transform", position) == (True, False, False)
        await hand.enter("Transform/position/0", "*10")
        await hand.enter("Transform/position/1", "+=50 cm")
        person.editor.screenshot(screenshot_directory / "inspector-several.png")
        assert [hand.value(f"Box {n}", "Transform", "position") for n in (1, 2, 3)] == [
            (10.0, 1.5, 0.0),
            (20.0, 1.5, 0.0),
            (30.0, 1.5, 0.0),
        ]
        await hand.enter("Transform/position/0", "")  # nothing was typed over the dash: nothing is sent
        assert hand.value("Box 1", "Transform", "position")[0] == 10.0
        await hand.enter("RigidBody/mass", "-=3")
        assert "inspector/RigidBody/mass/error" in await hand.shown()
        assert hand.value("Box 1", "RigidBody", "mass") == 1.0
        await person.press(Key.ESCAPE)
        await person.press(Key.Z, CTRL)
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert [hand.value(f"Box {n}", "Transform", "position")[0] for n in (1, 2, 3)] == [1.0, 2.0, 3.0]

    by_hand(scenario, "Box 1")


def _fields(name):
    from elys.common.components import declaration_of

    return declaration_of(name).fields


# --- marks and defaults ------------------------------------------------------------------------------------------------


def test_fields_and_components_are_reset(by_hand):
    async def scenario(hand):
        assert "inspector/RigidBody/gravity_scale/reset" not in await hand.shown()
        await hand.person.click("inspector/RigidBody/mass/reset")
        await hand.settle()
        assert hand.value("Crate", "RigidBody", "mass") == 1.0
        await hand.right_click("inspector/Transform/position/label")
        await hand.person.click("inspector/Transform/position/menu/reset")
        await hand.settle()
        assert hand.value("Crate", "Transform", "position") == (0.0, 0.0, 0.0)
        await hand.enter("RigidBody/mass", "4")
        await hand.enter("RigidBody/gravity_scale", "4")
        await hand.person.click("inspector/RigidBody/menu")
        await hand.person.click("component/reset")
        await hand.settle()
        body = hand.entities[hand.person.stage.named("Crate")].components["RigidBody"]
        assert (body.mass, body.gravity_scale) == (1.0, 1.0)

    by_hand(scenario)


def test_what_the_simulation_changed_is_marked_and_can_be_set_back(by_hand, screenshot_directory):
    async def scenario(hand):
        host, crate = hand.person.stage.host, hand.person.stage.named("Crate")
        assert "inspector/Transform/position/written" not in await hand.shown()
        host.tick += 1
        host.publish_frame({crate: (1.0, 0.5, 3.0)})
        await hand.person.frames(3)
        shown = await hand.shown()
        assert "inspector/Transform/position/written" in shown
        assert "inspector/Transform/rotation/written" not in shown
        await hand.person.point("inspector/Transform/position/written")
        await hand.person.frames(30)
        hand.person.editor.screenshot(screenshot_directory / "inspector-written.png")
        await hand.right_click("inspector/Transform/position/label")
        await hand.person.click("inspector/Transform/position/menu/take_back")
        await hand.settle()
        assert hand.value("Crate", "Transform", "position") == (1.0, 2.0, 3.0)
        assert "inspector/Transform/position/written" not in await hand.shown()

    by_hand(scenario)


def test_a_recording_shows_and_takes_nothing(by_hand):
    async def scenario(hand):
        hand.person.stage.host.kind = "replay"
        hand.person.stage.host.publish_status()
        await hand.person.until(lambda: hand.model.is_replay)
        shown = await hand.shown()
        assert "inspector/recording" in shown
        assert not {"inspector/add", "inspector/RigidBody/menu", "inspector/RigidBody/mass/reset"} & shown
        await hand.enter("RigidBody/mass", "4")
        assert hand.person.stage.host.received == []

    by_hand(scenario)


# --- colours -----------------------------------------------------------------------------------------------------------


def test_colours_are_written_as_hex_and_shine(by_hand, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await hand.fold("Transform", "RigidBody", "MeshRenderer")
        await person.click("inspector/Material/base_color/swatch")
        await person.frames(3)
        await person.click("inspector/Material/base_color/hex")
        await person.press(Key.A, CTRL)
        await person.type("#ff8000")
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Box 1", "Material", "base_color") == pytest.approx((1.0, 0.21586, 0.0), abs=1e-5)
        assert "inspector/Material/base_color/intensity" not in await hand.shown()  # no radiance
        await person.click("inspector/Material/base_color/hex")
        await person.press(Key.A, CTRL)
        await person.type("orange")
        await person.press(Key.ENTER)
        await person.frames(2)
        assert "inspector/Material/base_color/error" in await hand.shown()
        await person.press(Key.ESCAPE)

        await person.click("inspector/Material/emissive/swatch")
        await person.frames(3)
        await person.click("inspector/Material/emissive/hex")
        await person.press(Key.A, CTRL)
        await person.type("f00")
        await person.press(Key.ENTER)
        await hand.settle()
        await person.drag("inspector/Material/emissive/intensity", 150.0, 0.0)
        await hand.settle()
        person.editor.screenshot(screenshot_directory / "inspector-radiance.png")
        r, g, b = hand.value("Box 1", "Material", "emissive")
        assert r > 1.5 and (g, b) == (0.0, 0.0)

    by_hand(scenario, "Box 1")


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
        await person.click("inspector/Joint/other/follow")
        assert hand.model.selection.entities == (wall,)
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
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
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


def test_thirty_components_and_thousands_of_entities(by_hand, many_components):
    count = 300
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
        await hand.settle()
        assert {entity.components["Part00"].value_0 for entity in hand.entities.values()} == {0.0}
        await person.click("inspector/search")
        await person.type("part29")
        await person.frames(3)
        await hand.enter("Part29/value_3", "1/3")
        assert {entity.components["Part29"].value_3 for entity in hand.entities.values()} == {1.0 / 3.0}

    by_hand(scenario, "", records)
