"""Numbers, marks and colours of the inspector by hand: the real panel on GLFW's null platform, a small host behind it."""

from __future__ import annotations

import pytest
from scipy.spatial.transform import Rotation

from elys.common.components import declaration_of
from elys.editor_node.keys import Key
from tests.unit.editor_node.hand import by_hand as by_hand
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl


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


def test_a_click_with_ctrl_types_as_well(by_hand):
    async def scenario(hand):
        await hand.person.click("inspector/RigidBody/mass", held=CTRL)
        await hand.person.press(Key.A, CTRL)
        await hand.person.type("2 lb")
        await hand.person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Crate", "RigidBody", "mass") == pytest.approx(0.90718474)

    by_hand(scenario)


def test_tab_goes_on_to_the_next_number_and_shift_tab_back(by_hand):
    async def scenario(hand):
        person = hand.person
        await person.click("inspector/Transform/position/0", times=2)
        await person.press(Key.A, CTRL)
        await person.type("7")
        await person.press(Key.TAB)
        await hand.settle()
        await person.press(Key.A, CTRL)
        await person.type("8")
        await person.press(Key.TAB)
        await hand.settle()
        await person.press(Key.TAB, SHIFT)
        await hand.settle()
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
        position = declaration_of("Transform").field("position")
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
