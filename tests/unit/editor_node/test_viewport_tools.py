"""The tools of the viewport, each used as a hand uses it, on the real editor."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.commands import Grab, Release
from elys.common.scene import EntityRecord
from elys.editor_node.camera import project
from elys.editor_node.events import (
    Modifiers,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
)
from elys.editor_node.keys import Key
from elys.editor_node.preferences import SessionState
from elys.editor_node.session_state import restore_session, session_state
from elys.editor_node.ui import Tools
from tests.unit.editor_node.person import ALT, CTRL, SHIFT

pytestmark = pytest.mark.gl


async def see(person, *, entity: int = 0):
    """A render node, whose picture has come."""
    source = await person.stage.picture_source(entity=entity)
    await person.until(lambda: person.editor.stream.shown is not None)
    return source


async def look_still(person) -> None:
    """Until the camera rests and the picture shown is what it sees."""
    editor = person.editor
    await person.until(lambda: not editor.panel.camera.is_gliding)
    await person.until(lambda: editor.stream.shown.camera == editor.panel.camera.view)
    await person.frames(3)


def pixel_of(editor, point) -> np.ndarray:
    """Where a point in the world is seen in the window."""
    x, y, width, height = editor.panel.rectangle
    across, up = project(editor.stream.shown.camera, width / height, np.array(point, float))
    return np.array((x + (1 + across) / 2 * width, y + (1 - up) / 2 * height))


async def drag_between(person, start, end, *, held=Modifiers.NONE) -> None:
    await person.do(MouseMoved(*start), MousePressed(MouseButton.LEFT, held))
    for step in range(1, 5):
        await person.do(MouseMoved(*(np.array(start) + (np.array(end) - start) * step / 4)))
    await person.do(MouseReleased(MouseButton.LEFT, held))


def test_a_rectangle_selects_what_is_seen_in_it(at_the_editor):
    async def scenario(person):
        editor, named = person.editor, person.stage.named
        source = await see(person)
        editor.ui.actions.run("edit.select_nothing")
        editor.panel.camera.look_from((3.5, 1.0, 30.0), (0.0, 0.0, -1.0), 30.0)
        await person.press(Key.Q)  # whose handles are in nobody's way
        await look_still(person)
        boxes = [named(f"Box {number}") for number in range(1, 7)]
        at = [pixel_of(editor, (number, 1, 0)) for number in range(1, 7)]
        gap = (at[1] - at[0])[0] / 2
        reach = np.array((gap, gap / 2))
        await drag_between(person, at[0] - reach, at[2] + reach)
        assert editor.model.selection.entities == tuple(boxes[:3])
        assert editor.panel.selection_box is None
        assert source.picks == []
        await drag_between(person, at[4] + reach, at[3] - reach, held=SHIFT)  # the other way about
        assert set(editor.model.selection) == set(boxes[:5])
        await drag_between(person, at[2] - reach, at[5] + reach, held=CTRL)
        assert set(editor.model.selection) == {*boxes[:2], boxes[5]}
        editor.model.scene.marks.set("locked", [boxes[0]], True)
        editor.model.scene.marks.set("hidden", [boxes[1]], True)
        await drag_between(person, at[0] - reach, at[2] + reach)
        assert editor.model.selection.entities == (boxes[2],)
        corner = np.array(editor.panel.rectangle[:2]) + 20.0
        await drag_between(person, corner, corner + 60.0)  # nothing there
        assert editor.model.selection.entities == ()

    at_the_editor(scenario)


def test_a_rectangle_is_drawn_while_it_is_dragged(at_the_editor, screenshot_directory):
    async def scenario(person):
        from PIL import Image

        editor = person.editor
        await see(person)
        x, y, _, _ = editor.panel.rectangle
        inside = (int(x) + 150, int(y) + 110)
        await person.do(
            MouseMoved(x + 100.0, y + 80.0), MousePressed(MouseButton.LEFT), MouseMoved(x + 200.0, y + 140.0)
        )
        editor.screenshot(screenshot_directory / "box.png")
        await person.do(MouseReleased(MouseButton.LEFT))
        await person.frames(2)
        editor.screenshot(screenshot_directory / "no-box.png")
        pixels = [Image.open(screenshot_directory / f"{name}.png").getpixel(inside) for name in ("box", "no-box")]
        assert np.abs(np.subtract(*pixels)).max() > 8

    at_the_editor(scenario)


@pytest.mark.parametrize(
    ("key", "held", "toward", "up"),
    [
        (Key.KEYPAD_7, Modifiers.NONE, (0, -1, 0), (0, 0, -1)),
        (Key.KEYPAD_7, CTRL, (0, 1, 0), (0, 0, 1)),
        (Key.KEYPAD_1, Modifiers.NONE, (0, 0, -1), (0, 1, 0)),
        (Key.KEYPAD_1, CTRL, (0, 0, 1), (0, 1, 0)),
        (Key.KEYPAD_3, Modifiers.NONE, (-1, 0, 0), (0, 1, 0)),
        (Key.KEYPAD_3, CTRL, (1, 0, 0), (0, 1, 0)),
    ],
)
def test_the_keypad_looks_along_the_axes(at_the_editor, key, held, toward, up):
    async def scenario(person):
        editor = person.editor
        source = await see(person)
        await person.press(key, held)
        await look_still(person)
        camera = source.requests[-1].camera
        assert camera.ortho_height == pytest.approx(editor.panel.camera.height)
        assert Rotation.from_quat(camera.rotation).apply(((0, 0, -1), (0, 1, 0))) == pytest.approx(
            np.array((toward, up)), abs=1e-9
        )
        height = editor.panel.rectangle[3]
        # As large as the height says, and the same near and far: nothing shrinks here.
        target = editor.panel.camera.target
        pixels = [pixel_of(editor, target + np.array(up) * e + np.array(toward) * d) for e in (0, 1) for d in (-9, 9)]
        assert pixels[0] == pytest.approx(pixels[1], abs=1e-6)
        assert np.linalg.norm(pixels[2] - pixels[0]) == pytest.approx(height / camera.ortho_height)
        await person.press(Key.KEYPAD_5)
        await person.until(lambda: source.requests[-1].camera.ortho_height == 0.0)

    at_the_editor(scenario)


def test_the_cube_takes_the_camera_to_the_side_that_is_clicked(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await see(person)
        editor.ui.actions.run("edit.select_nothing")
        camera = editor.panel.camera
        camera.look_from((8.0, 8.0, 8.0), (-1.0, -1.0, -1.0), 12.0)
        await look_still(person)
        was_parallel, distance = camera.is_parallel, camera.distance
        await person.click("viewport/cube")  # the corner in the middle: where one looks from already
        await look_still(person)
        assert camera.backward == pytest.approx(np.full(3, 3**-0.5), abs=1e-6)
        left, top, right, bottom = editor.ui.landmarks.rectangles["viewport/cube"]
        upper = ((left + right) / 2, top + (bottom - top) * 0.28)
        await person.do(MouseMoved(*upper))
        assert editor.panel.cube.pointed_at == (0.0, 1.0, 0.0)
        await person.do(MousePressed(MouseButton.LEFT), MouseReleased(MouseButton.LEFT))
        await look_still(person)
        assert camera.backward == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
        assert (camera.is_parallel, camera.distance) == (was_parallel, pytest.approx(distance))
        assert not editor.model.selection
        yaw, pitch = camera.yaw, camera.pitch
        await person.drag("viewport/cube", 0.0, -90.0)  # a drag turns
        assert camera.pitch > pitch
        assert editor.panel.selection_box is None
        await person.drag("viewport/cube", 60.0, 0.0)
        assert camera.yaw != yaw

    at_the_editor(scenario)


def test_places_are_kept_and_gone_back_to(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await see(person)
        camera = editor.panel.camera
        await person.press(Key.DIGIT_4, CTRL | ALT)
        place = camera.pose
        await person.press(Key.DIGIT_5, ALT)  # nothing is kept there
        assert not camera.is_gliding
        await person.press(Key.KEYPAD_7)
        await look_still(person)
        assert camera.pose != place
        await person.press(Key.DIGIT_4, ALT)
        await look_still(person)
        assert camera.pose == place
        await person.click("menu/view")
        await person.click("menu/camera")
        await person.click("menu/camera.top")
        await look_still(person)
        assert camera.pitch == pytest.approx(-np.pi / 2)
        state, pose, places = (
            session_state(editor.viewports, editor.ui.tools, editor.camera_views.places),
            camera.pose,
            {},
        )
        camera.orbit(300.0, 100.0)
        kept = msgspec.json.decode(msgspec.json.encode(state), type=SessionState)
        restore_session(kept, editor.viewports, Tools(), places)
        assert camera.pose == pose
        assert places == {"4": place}

    at_the_editor(scenario)


CAMERA = [
    EntityRecord(name="Mast", components={"Transform": {"position": [5, 0, 0], "rotation": [0, 0.6, 0, 0.8]}}),
    EntityRecord(
        name="Lookout",
        parent=0,
        components={"Transform": {"position": [0, 3, 1]}, "Camera": {"field_of_view": 0.5}},
    ),
]


def test_one_looks_through_the_selected_camera_and_moves_it_here(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        source = await see(person)
        lookout = person.stage.named("Lookout")
        editor.model.selection.replace((lookout,))
        pose = editor.model.scene.world_pose(lookout)
        editor.panel.camera.orbit(200.0, 50.0)
        await person.press(Key.KEYPAD_0)
        await look_still(person)
        camera = source.requests[-1].camera
        assert camera.position == pytest.approx(pose.position, abs=1e-6)
        assert Rotation.from_quat(camera.rotation).as_matrix() == pytest.approx(
            Rotation.from_quat(pose.rotation).as_matrix(), abs=1e-6
        )
        assert camera.field_of_view == 0.5
        editor.panel.camera.orbit(100.0, 30.0)
        before = host.mirror.entities[lookout].components["Transform"]
        await person.press(Key.KEYPAD_0, CTRL | ALT)
        await editor.model.history.settle()
        moved, wanted = host.mirror.world_pose(lookout), editor.panel.camera.view
        assert moved.position == pytest.approx(wanted.position, abs=1e-5)
        assert Rotation.from_quat(moved.rotation).as_matrix() == pytest.approx(
            Rotation.from_quat(wanted.rotation).as_matrix(), abs=1e-6
        )
        await person.press(Key.Z, CTRL)
        await editor.model.history.settle()
        assert host.mirror.entities[lookout].components["Transform"] == before
        editor.model.selection.replace((person.stage.named("Mast"),))
        assert not editor.ui.actions.may_run("camera.move_here")

    at_the_editor(scenario, CAMERA)


def handle_of(editor, pivot, axis, length=55.0):
    """Where in the window the handle along an axis can be taken hold of, and which way it points there."""
    ends = [pixel_of(editor, pivot), pixel_of(editor, np.array(pivot) + 0.5 * np.eye(3)[axis])]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    return ends[0] + length * along, along


async def choose(person, names, tool) -> list[int]:
    entities = [person.stage.named(name) for name in names]
    person.editor.model.selection.replace(entities)
    await person.press(Key.F)
    await person.press(tool)
    await look_still(person)
    return entities


def transforms(person, entities):
    return [person.stage.host.mirror.entities[entity].components["Transform"] for entity in entities]


@pytest.mark.parametrize("pivot", ["active", "median"])
def test_several_are_scaled_about_one_pivot(at_the_editor, pivot):
    async def scenario(person):
        editor = person.editor
        await see(person)
        chosen = await choose(person, ("Box 1", "Box 3", "Box 6"), Key.R)
        before = transforms(person, chosen)
        places = np.array([transform.position for transform in before])
        if pivot == "median":
            await person.click("toolbar/pivot")
            await person.do(MouseMoved(*(np.array(editor.panel.rectangle[:2]) + 9.0)))
        middle = places.mean(axis=0) if pivot == "median" else places[-1]
        start, along = handle_of(editor, middle, 0)
        await drag_between(person, start, start + 40.0 * along)
        await editor.model.history.settle()
        after = transforms(person, chosen)
        factors = [a.scale[0] / b.scale[0] for a, b in zip(after, before, strict=True)]
        assert factors == pytest.approx([factors[0]] * 3, rel=1e-5)
        assert factors[0] > 1.1
        wanted = middle + (places - middle) * (factors[0], 1.0, 1.0)
        assert np.array([a.position for a in after]) == pytest.approx(wanted, abs=1e-4)
        await person.press(Key.Z, CTRL)  # one entry of the history
        await editor.model.history.settle()
        assert transforms(person, chosen) == before

    at_the_editor(scenario)


def test_handles_move_in_steps_that_the_toolbar_sets(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await see(person)
        chosen = await choose(person, ("Box 2", "Box 4"), Key.W)
        before = transforms(person, chosen)
        await person.click("toolbar/snap")
        await person.click("menu/tool.snap")
        await person.click("toolbar/snap")
        await person.click("snap/move_snap", times=2)
        await person.press(Key.A, CTRL)
        await person.type("0.7")
        await person.press(Key.ENTER)
        await person.press(Key.ESCAPE)
        assert editor.ui.tools.snaps
        assert editor.ui.tools.move_snap == pytest.approx(0.7)
        start, along = handle_of(editor, before[-1].position, 0)
        await drag_between(person, start, start + 70.0 * along)
        await editor.model.history.settle()
        moved = [a.position[0] - b.position[0] for a, b in zip(transforms(person, chosen), before, strict=True)]
        assert moved[0] == pytest.approx(moved[1], abs=1e-5)
        assert moved[0] > 0.5
        assert moved[0] / 0.7 == pytest.approx(round(moved[0] / 0.7), abs=1e-4)

    at_the_editor(scenario)


STACK = [
    EntityRecord(name="Ground", components={"Transform": {"scale": [20, 0.2, 20]}, "Collider": {}}),
    EntityRecord(name="Table", components={"Transform": {"position": [0, 0.6, 0]}, "MeshRenderer": {}}),
    EntityRecord(name="Lower", components={"Transform": {"position": [0.3, 3, 0]}, "MeshRenderer": {}}),
    EntityRecord(
        name="Upper", components={"Transform": {"position": [0.3, 6, 0], "scale": [1, 2, 1]}, "MeshRenderer": {}}
    ),
    EntityRecord(name="Turned", components={"Transform": {"position": [5, 4, 0]}}),
    EntityRecord(
        name="Foot",
        parent=4,
        components={
            "Transform": {"position": [0, -1, 0], "rotation": [0, 0, 0.3826834323650898, 0.9238795325112867]},
            "MeshRenderer": {},
        },
    ),
    EntityRecord(name="Far", components={"Transform": {"position": [90, 4, 0]}, "MeshRenderer": {}}),
]


def test_what_is_dropped_stands_on_what_is_under_it(at_the_editor):
    async def scenario(person):
        editor = person.editor
        names = ("Upper", "Lower", "Turned", "Far")
        chosen = [person.stage.named(name) for name in names]
        before = transforms(person, chosen)
        editor.model.selection.replace(chosen)
        await person.press(Key.END, CTRL)
        await editor.model.history.settle()
        heights = dict(zip(names, (t.position[1] for t in transforms(person, chosen)), strict=True))
        # The table ends at 1.1, the ground at 0.1; a cube on its edge reaches half its diagonal down.
        assert heights["Lower"] == pytest.approx(1.6, abs=1e-5)
        assert heights["Upper"] == pytest.approx(3.1, abs=1e-5)
        assert heights["Turned"] == pytest.approx(0.1 + 0.5**0.5 + 1.0, abs=1e-5)
        assert heights["Far"] == pytest.approx(0.5, abs=1e-5)
        await person.press(Key.Z, CTRL)
        await editor.model.history.settle()
        assert transforms(person, chosen) == before
        editor.model.scene.marks.set("locked", chosen, True)
        await person.press(Key.END, CTRL)
        await editor.model.history.settle()
        assert transforms(person, chosen) == before

    at_the_editor(scenario, STACK)


def test_the_menu_switches_lines_over_the_picture(at_the_editor):
    async def scenario(person):
        editor = person.editor
        source = await see(person)
        crate = person.stage.named("Crate")
        assert source.requests[-1].debug == ()
        await person.click("menu/view")
        await person.click("menu/debug")
        await person.click("menu/debug.velocity")
        await person.click("menu/debug.aabb")
        await person.until(lambda: source.requests[-1].debug == ("aabb", "velocity"))
        assert source.requests[-1].debug_entities == ()
        await person.click("menu/debug.selection")  # nothing is selected: nothing is drawn of it
        await person.until(lambda: source.requests[-1].debug == ())
        editor.model.selection.replace((crate,))
        await person.until(lambda: source.requests[-1].debug_entities == (crate,))
        assert source.requests[-1].debug == ("aabb", "velocity")
        await person.click("menu/debug.aabb")
        await person.until(lambda: source.requests[-1].debug == ("velocity",))

    at_the_editor(scenario)


def test_a_hand_drags_a_body_and_lets_it_go(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        crate, ground = person.stage.named("Crate"), person.stage.named("Ground")
        source = await see(person, entity=person.stage.named("Lid"))  # a part of the crate
        source.hit = (1.2, 2.4, 3.1)
        editor.panel.camera.look_from((1.2, 2.4, 13.1), (0.0, 0.0, -1.0), 10.0)
        await look_still(person)
        await person.press(Key.G)
        start, end = pixel_of(editor, source.hit), pixel_of(editor, (2.7, 3.4, 3.1))
        await person.do(MouseMoved(*start), MousePressed(MouseButton.LEFT))
        await person.until(lambda: any(isinstance(command, Grab) for command in host.received))
        await person.do(MouseMoved(*end))
        wanted = pytest.approx((2.7, 3.4, 3.1), abs=1e-6)  # in the plane through the point that faces the camera
        await person.until(lambda: isinstance(host.received[-1], Grab) and host.received[-1].target == wanted)
        assert host.received[-1].entity == crate
        await person.until(lambda: source.requests[-1].debug == ("forces",))  # what pushes it, while it is held
        assert source.requests[-1].debug_entities == (crate,)
        assert host.received[-1].anchor == pytest.approx((0.2, 0.4, 0.1))
        await person.frames(2)
        assert editor.panel.hand_line == pytest.approx(
            (*start, *end), abs=0.1
        )  # from the crate, which nothing moves here
        await person.do(MouseReleased(MouseButton.LEFT))
        await person.until(lambda: isinstance(host.received[-1], Release))
        source.entity, count = ground, len(host.received)
        await person.do(MouseMoved(*start), MousePressed(MouseButton.LEFT))
        await person.until(lambda: "Ground" in editor.model.error)
        await person.do(MouseReleased(MouseButton.LEFT))
        assert len(host.received) == count
        assert not editor.model.selection
        assert editor.panel.hand_line is None
        await person.until(lambda: not source.requests[-1].debug)

    at_the_editor(scenario)
