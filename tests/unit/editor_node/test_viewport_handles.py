"""What a hand selects and turns in the picture: clicks with Shift and Ctrl, the outline, handles in both kinds of axes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.scene import EntityRecord
from elys.editor_node.camera import project
from elys.editor_node.events import KeyPressed, KeyReleased, MouseButton, MouseMoved, MousePressed, MouseReleased
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl

_RING = 0.078  # radius of the turning handles, in widths of the picture: 1.2 times half of what gizmo.py asks for
_PIXEL = 1.5  # [degrees] that a pixel or two of the ring are
_TILT = Rotation.from_euler("z", 30, degrees=True)
THINGS = [
    EntityRecord(
        name="Tilted", components={"Transform": {"position": [1, 2, 0], "rotation": _TILT.as_quat().tolist()}}
    ),
    EntityRecord(name="Mast", components={"Transform": {"position": [4, 1, 0], "rotation": [0, 0.6, 0, 0.8]}}),
    EntityRecord(
        name="Flag", parent=1, components={"Transform": {"position": [0, 3, 1], "rotation": [0.28, 0, 0, 0.96]}}
    ),
    EntityRecord(name="Left", components={"Transform": {"position": [-3, 0, 0]}}),
    EntityRecord(name="Right", components={"Transform": {"position": [-1, 1, 0]}}),
]


async def look_from_the_front(person, *names: str) -> list[int]:
    """At some entities, which are selected, along -z and without perspective: x is to the right, y is up."""
    editor = person.editor
    await person.stage.picture_source(entity=0)
    chosen = [person.stage.named(name) for name in names]
    editor.model.selection.replace(chosen)
    await person.press(Key.F)
    await person.press(Key.KEYPAD_1)
    await person.until(lambda: editor.stream.shown is not None and not editor.panel.camera.is_gliding)
    await person.until(lambda: editor.stream.shown.camera == editor.panel.camera.view)
    await person.frames(3)
    return chosen


def pixel_of(editor, point) -> np.ndarray:
    x, y, width, height = editor.panel.rectangle
    across, up = project(editor.stream.shown.camera, width / height, np.array(point, float))
    return np.array((x + (1 + across) / 2 * width, y + (1 - up) / 2 * height))


def placed(person, entity: int) -> tuple[np.ndarray, Rotation]:
    """Where something stands in the world, and how it is turned there, as the host has it."""
    pose = person.stage.host.mirror.world_pose(entity)
    return np.array(pose.position), Rotation.from_quat(pose.rotation)


async def go(person, *places) -> None:
    """Drags from the first place through the others."""
    await person.do(MouseMoved(*places[0]))
    await person.frames(2)
    assert person.editor.panel.gizmo.is_over
    await person.do(MousePressed(MouseButton.LEFT))
    await person.do(*(MouseMoved(*place) for place in places[1:]))
    await person.do(MouseReleased(MouseButton.LEFT))
    await person.editor.model.history.settle()
    await person.frames(2)


async def pull(person, pivot, toward, *, length: float = 60.0) -> None:
    """Drags the handle that points some way, that way."""
    start = pixel_of(person.editor, pivot)
    along = pixel_of(person.editor, pivot + toward) - start
    along /= np.linalg.norm(along)
    await go(person, *(start + along * (55.0 + length * step / 4) for step in range(5)))


async def turn(person, pivot, *, degrees: float, begin: float = 40.0) -> None:
    """Drags the ring that faces the camera, counter-clockwise from `begin`."""
    middle, radius = pixel_of(person.editor, pivot), _RING * person.editor.panel.rectangle[2]
    angles = np.radians(begin + degrees * np.arange(6) / 5)
    await go(person, *(middle + radius * np.array((np.cos(angle), -np.sin(angle))) for angle in angles))


def degrees_between(before: Rotation, after: Rotation) -> np.ndarray:
    """The turn in the world, as a vector along its axis."""
    return np.degrees((after * before.inv()).as_rotvec())


@pytest.mark.parametrize("held", [SHIFT, CTRL])
def test_a_click_with_shift_or_ctrl_turns_the_selection_of_one_about(at_the_editor, held):
    async def scenario(person):
        selection, named = person.editor.model.selection, person.stage.named
        first, second, third = (named(name) for name in ("Box 1", "Box 2", "Box 3"))
        source = await person.stage.picture_source(entity=first)
        await person.until(lambda: person.editor.stream.shown is not None)
        await person.press(Key.Q)  # no handles in the way

        async def click(entity, *, held=held) -> None:
            source.entity, count = entity, len(source.picks)
            await person.click("viewport/picture", held=held)
            await person.until(lambda: len(source.picks) > count)

        await click(first)
        await person.until(lambda: selection.entities == (first,))
        await click(second)
        await person.until(lambda: selection.entities == (first, second))
        await click(third)
        await person.until(lambda: selection.entities == (first, second, third))
        await click(second)
        await person.until(lambda: selection.entities == (first, third))
        await click(0)  # nothing is there: nothing is lost
        await person.frames(3)
        assert selection.entities == (first, third)
        await click(second, held=held.NONE)
        await person.until(lambda: selection.entities == (second,))
        await click(0, held=held.NONE)
        await person.until(lambda: selection.entities == ())

    at_the_editor(scenario)


def test_what_is_selected_is_asked_for_with_its_outline(at_the_editor):
    async def scenario(person):
        crate, box = (person.stage.named(name) for name in ("Crate", "Box 3"))
        source = await person.stage.picture_source(entity=box)
        await person.until(lambda: person.editor.stream.shown is not None)
        assert source.requests[-1].selection == ()
        await person.click("hierarchy/Crate")
        await person.until(lambda: source.requests[-1].selection == (crate,))
        await person.press(Key.Q)
        await person.click("viewport/picture", held=SHIFT)
        await person.until(lambda: source.requests[-1].selection == (crate, box))
        # The picture without the outline is not what is wanted: another one comes though no time goes on.
        asked = [request for request in source.requests if request.selection == (crate, box)]
        assert asked[0].newer_than_tick < 0
        await person.until(lambda: asked[0].sequence in source.sent)
        person.editor.model.selection.clear()
        await person.until(lambda: source.requests[-1].selection == ())

    at_the_editor(scenario)


@pytest.mark.parametrize("way", ["button", "action"])
def test_handles_stand_along_the_worlds_axes_or_the_entitys_own(at_the_editor, way):
    async def scenario(person):
        editor = person.editor
        [tilted] = await look_from_the_front(person, "Tilted")
        await person.press(Key.W)

        async def change_axes() -> None:
            if way == "button":
                await person.click("toolbar/space")
            else:
                editor.ui.actions.run("tool.local")
            await person.frames(2)

        async def moved_by_pulling(toward) -> np.ndarray:
            before, _ = placed(person, tilted)
            await pull(person, before, np.array(toward, float))
            after, _ = placed(person, tilted)
            await person.press(Key.Z, CTRL)
            await editor.model.history.settle()
            await person.frames(2)
            return after - before

        moved = await moved_by_pulling((1, 0, 0))
        assert moved[0] > 0.1
        assert moved[1:] == pytest.approx((0.0, 0.0), abs=1e-4)
        await change_axes()
        own = _TILT.apply((1.0, 0.0, 0.0))
        moved = await moved_by_pulling(own)
        assert moved @ own > 0.1
        assert moved == pytest.approx((moved @ own) * own, abs=1e-4)
        await change_axes()
        moved = await moved_by_pulling((0, 1, 0))
        assert moved[1] > 0.1
        assert moved[::2] == pytest.approx((0.0, 0.0), abs=1e-4)

    at_the_editor(scenario, THINGS)


def test_the_ring_turns_what_is_selected_as_far_as_the_pointer_goes(at_the_editor):
    async def scenario(person):
        [tilted] = await look_from_the_front(person, "Tilted")
        await person.press(Key.E)
        place, before = placed(person, tilted)
        await turn(person, place, degrees=37.0)
        there, after = placed(person, tilted)
        assert degrees_between(before, after) == pytest.approx((0.0, 0.0, 37.0), abs=_PIXEL)
        assert there.tolist() == place.tolist()
        await turn(person, place, degrees=-20.0)
        assert degrees_between(after, placed(person, tilted)[1]) == pytest.approx((0.0, 0.0, -20.0), abs=_PIXEL)
        await person.press(Key.Z, CTRL)  # one entry of the history each
        await person.editor.model.history.settle()
        assert degrees_between(after, placed(person, tilted)[1]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)

    at_the_editor(scenario, THINGS)


def test_what_stands_under_something_turned_turns_in_the_world(at_the_editor):
    async def scenario(person):
        [flag] = await look_from_the_front(person, "Flag")
        await person.press(Key.E)
        place, before = placed(person, flag)
        await turn(person, place, degrees=50.0)
        there, after = placed(person, flag)
        assert degrees_between(before, after) == pytest.approx((0.0, 0.0, 50.0), abs=_PIXEL)
        assert there == pytest.approx(place, abs=1e-5)

    at_the_editor(scenario, THINGS)


def test_several_turn_about_the_one_selected_last(at_the_editor):
    async def scenario(person):
        left, right = await look_from_the_front(person, "Left", "Right")
        await person.press(Key.E)
        before = placed(person, left)[0]
        pivot = placed(person, right)[0]
        await turn(person, pivot, degrees=60.0)
        turned = placed(person, right)[1]
        assert turned.as_rotvec(degrees=True) == pytest.approx((0.0, 0.0, 60.0), abs=_PIXEL)
        assert placed(person, right)[0] == pytest.approx(pivot, abs=1e-5)
        there, alike = placed(person, left)
        assert there == pytest.approx(pivot + turned.apply(before - pivot), abs=1e-4)
        assert degrees_between(turned, alike) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)

    at_the_editor(scenario, THINGS)


@pytest.mark.parametrize("way", ["ctrl", "switched on", "switched on and ctrl"])
def test_the_ring_turns_in_steps(at_the_editor, way):
    async def scenario(person):
        editor = person.editor
        [tilted] = await look_from_the_front(person, "Tilted")
        await person.press(Key.E)
        if way != "ctrl":
            editor.ui.actions.run("tool.snap")
        place, before = placed(person, tilted)
        if "ctrl" in way:
            await person.do(KeyPressed(Key.LEFT_CTRL, CTRL))
        await turn(person, place, degrees=40.0)
        if "ctrl" in way:
            await person.do(KeyReleased(Key.LEFT_CTRL))
        wanted, error = (40.0, _PIXEL) if way == "switched on and ctrl" else (45.0, 1e-3)  # steps of 15, or none
        assert degrees_between(before, placed(person, tilted)[1]) == pytest.approx((0.0, 0.0, wanted), abs=error)

    at_the_editor(scenario, THINGS)
