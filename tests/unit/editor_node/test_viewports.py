"""Several viewports, each with a camera, a look and pictures of its own, used as a hand uses them on the real editor."""

from __future__ import annotations

import asyncio

import msgspec
import numpy as np
import pytest

from elys.editor_node.camera import project
from elys.editor_node.events import MouseButton, MouseMoved, MousePressed, MouseReleased
from elys.editor_node.keys import Key
from elys.editor_node.preferences import SessionState
from elys.editor_node.session_state import restore_session, session_state
from elys.editor_node.ui import Tools
from elys.editor_node.viewports import MOST_VIEWPORTS
from tests.unit.editor_node.person import ALT, CTRL, SHIFT

pytestmark = pytest.mark.gl


async def see(person, *, entity: int = 0):
    """A render node, whose pictures have come in all viewports."""
    source = await person.stage.picture_source(entity=entity)
    await look_still(person)
    return source


async def look_still(person) -> None:
    """Until all cameras rest, and each picture is what its camera sees, as large as its viewport."""

    def is_still(panel) -> bool:
        shown, (_, _, width, height) = panel.stream.shown, panel.rectangle
        is_sharp = shown is not None and (shown.width, shown.height) == (int(width), int(height))
        return is_sharp and not panel.camera.is_gliding and shown.camera == panel.camera.view

    await person.frames(3)
    async with asyncio.timeout(30.0):  # four pictures at once, drawn in software
        while not all(is_still(panel) for panel in person.editor.viewports if panel.is_seen):
            await person.frames(1)
    await person.frames(3)


def pixel_of(panel, point) -> np.ndarray:
    """Where a point in the world is seen in the window, in one viewport."""
    x, y, width, height = panel.rectangle
    across, up = project(panel.stream.shown.camera, width / height, np.array(point, float))
    return np.array((x + (1 + across) / 2 * width, y + (1 - up) / 2 * height))


def views_asked_for(source) -> set[str]:
    return {request.view for request in source.requests}


async def open_second(person):
    """By the keys; the second one, in which the picture has come."""
    await person.press(Key.V, CTRL | SHIFT)
    second = next(panel for panel in person.editor.viewports if panel.number == 2)
    await look_still(person)
    return second


def test_a_second_one_is_opened_beside_the_first_and_closed_by_its_tab(at_the_editor):
    async def scenario(person):
        editor = person.editor
        source = await see(person)
        first = editor.panel
        whole = first.rectangle
        await person.click("menu/view")
        await person.click("menu/view.new_viewport")
        await look_still(person)
        second = editor.panel
        assert second.number == 2
        assert first.is_seen
        assert second.is_seen
        assert second.camera.pose == first.camera.pose
        # They share the place that the first one had.
        assert first.rectangle[2] + second.rectangle[2] == pytest.approx(whole[2], abs=12.0)
        assert second.rectangle[0] > first.rectangle[0] + first.rectangle[2] - 1.0
        assert views_asked_for(source) == {first.stream.name, second.stream.name}
        await person.click("menu/view")
        await person.click("menu/view.close_viewport")
        await look_still(person)
        assert list(editor.viewports) == [first]
        assert first.rectangle == pytest.approx(whole, abs=3.0)

        await open_second(person)  # again, and now by the cross of its tab
        await person.click("viewport2/close")
        await person.until(lambda: len(editor.viewports) == 1)
        count = len(source.requests)
        await person.until(lambda: len(source.requests) > count)
        assert source.requests[-1].view == first.stream.name

    at_the_editor(scenario)


def test_there_are_four_at_most_and_each_has_a_view_of_its_own(at_the_editor):
    async def scenario(person):
        editor = person.editor
        source = await see(person)
        for _ in range(MOST_VIEWPORTS + 2):
            await person.press(Key.V, CTRL | SHIFT)
        await look_still(person)
        assert [panel.number for panel in editor.viewports] == [1, 2, 3, 4]
        assert len(views_asked_for(source)) == MOST_VIEWPORTS
        assert not editor.ui.actions.may_run("view.new_viewport")
        with pytest.raises(ValueError, match="numbered from 1 to 4"):
            editor.viewports.open(5)
        places = [panel.rectangle for panel in editor.viewports]
        for a, b in ((places[i], places[j]) for i in range(4) for j in range(i)):
            apart = (a[0] + a[2] <= b[0], b[0] + b[2] <= a[0], a[1] + a[3] <= b[1], b[1] + b[3] <= a[1])
            assert any(apart), (a, b)

    at_the_editor(scenario)


def test_keys_mean_the_viewport_under_the_pointer_and_menus_the_one_used_last(at_the_editor):
    async def scenario(person):
        editor = person.editor
        source = await see(person)
        second = await open_second(person)
        first = editor.viewports.first
        before = first.camera.pose
        await person.point("viewport2/picture")
        await person.press(Key.KEYPAD_7)
        await look_still(person)
        assert second.camera.pitch == pytest.approx(-np.pi / 2)
        assert first.camera.pose == before
        await person.point("viewport/picture")
        await person.press(Key.KEYPAD_1)
        await look_still(person)
        assert (first.camera.yaw, first.camera.pitch) == (0.0, 0.0)
        assert second.camera.pitch == pytest.approx(-np.pi / 2)

        assert editor.viewports.used is second  # nobody has taken hold of the first since
        await person.click("menu/view")
        await person.click("menu/show")
        await person.click("show/normals")
        await person.click("menu/view")
        await person.click("menu/view.grid")
        await person.click("menu/view")
        await person.click("menu/debug")
        await person.click("menu/debug.aabb")
        await person.press(Key.ESCAPE)
        newest = {}
        await person.frames(4)
        for request in source.requests:
            newest[request.view] = request
        there, here = newest[second.stream.name], newest[first.stream.name]
        assert (there.shows, there.grid, there.debug) == ("normals", False, ("aabb",))
        assert (here.shows, here.grid, here.debug) == ("shaded", True, ())

        # A place is kept in one and gone to in the other.
        await person.point("viewport2/picture")
        await person.press(Key.DIGIT_3, CTRL | ALT)
        await person.point("viewport/picture")
        await person.press(Key.DIGIT_3, ALT)
        await look_still(person)
        assert first.camera.pose == second.camera.pose
        editor.model.selection.replace((person.stage.named("Box 6"),))
        await person.point("viewport2/picture")
        await person.press(Key.F)
        await look_still(person)
        assert second.camera.target.tolist() == pytest.approx([6.0, 1.0, 0.0], abs=1e-6)
        assert first.camera.pose != second.camera.pose

    at_the_editor(scenario)


def test_the_mouse_works_in_the_viewport_it_is_in(at_the_editor):
    async def scenario(person):
        editor, named = person.editor, person.stage.named
        source = await see(person)
        second = await open_second(person)
        first = editor.viewports.first
        await person.press(Key.Q)
        second.camera.look_from((3.5, 1.0, 30.0), (0.0, 0.0, -1.0), 30.0)
        await look_still(person)
        pose = first.camera.pose
        # A rectangle, which the first one's camera would have seen others in.
        at = [pixel_of(second, (number, 1, 0)) for number in (1, 3)]
        reach = (pixel_of(second, (2, 1, 0)) - at[0])[0] / 2
        start, end = at[0] - reach, at[1] + reach
        await person.do(MouseMoved(*start), MousePressed(MouseButton.LEFT))
        await person.do(MouseMoved(*(start + end) / 2), MouseMoved(*end))
        assert second.selection_box is not None
        assert first.selection_box is None
        await person.do(MouseReleased(MouseButton.LEFT))
        assert editor.model.selection.entities == tuple(named(f"Box {number}") for number in (1, 2, 3))
        # A click asks for what is seen by the second one's camera.
        source.entity = named("Crate")
        await person.click("viewport2/picture")
        await person.until(lambda: editor.model.selection.entities == (source.entity,))
        assert source.picks[-1].camera == second.camera.view
        # A drag that leaves it goes on in it.
        yaw = second.camera.yaw
        x, y = editor.ui.landmarks.center("viewport2/picture")
        await person.do(MouseMoved(x, y), MousePressed(MouseButton.LEFT, ALT))
        await person.do(MouseMoved(*editor.ui.landmarks.center("viewport/picture")), MouseReleased(MouseButton.LEFT))
        assert second.camera.yaw != yaw
        assert first.camera.pose == pose
        await person.click("viewport2/cube")
        await look_still(person)
        assert first.camera.pose == pose

    at_the_editor(scenario)


@pytest.mark.parametrize("number", [1, 2])
def test_handles_are_dragged_in_one_and_seen_in_both(at_the_editor, number):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        await see(person)
        await open_second(person)
        crate = person.stage.named("Crate")
        editor.model.selection.replace((crate,))
        for panel in editor.viewports:
            await person.point(panel.landmark("picture"))
            await person.press(Key.F)
        await person.press(Key.W)
        await look_still(person)
        panel = next(panel for panel in editor.viewports if panel.number == number)
        other = next(panel for panel in editor.viewports if panel.number != number)
        before = host.mirror.entities[crate].components["Transform"].position
        ends = [pixel_of(panel, before), pixel_of(panel, np.add(before, (0.5, 0.0, 0.0)))]
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        start = ends[0] + 40.0 * along
        await person.do(MouseMoved(*start), MousePressed(MouseButton.LEFT))
        for step in range(1, 5):
            await person.do(MouseMoved(*(start + 10.0 * step * along)))
            assert panel.gizmo.is_used
            assert not other.gizmo.is_used
        await person.do(MouseReleased(MouseButton.LEFT))
        await editor.model.history.settle()
        after = host.mirror.entities[crate].components["Transform"].position
        # As far as the pointer went in that viewport's own picture, and along x alone.
        length = 40.0 / np.linalg.norm(pixel_of(panel, np.add(before, (1.0, 0.0, 0.0))) - ends[0])
        assert after[0] - before[0] == pytest.approx(length, rel=0.2)
        assert after[1:] == pytest.approx(before[1:], abs=1e-4)
        await person.press(Key.Z, CTRL)
        await editor.model.history.settle()
        assert host.mirror.entities[crate].components["Transform"].position == before

    at_the_editor(scenario)


def test_who_is_not_seen_asks_for_no_pictures(at_the_editor):
    async def scenario(person):
        editor = person.editor
        source = await see(person)
        second = await open_second(person)
        first = editor.viewports.first
        await person.click("menu/view")
        await person.click("panel item/Viewport")
        await person.frames(3)
        assert not first.is_seen
        assert editor.viewports.current is second
        assert first.stream.next_deadline == float("inf")
        count = len(source.requests)
        second.camera.orbit(30.0, 0.0)
        first.camera.orbit(30.0, 0.0)
        await look_still(person)
        later = source.requests[count:]
        assert {request.view for request in later} == {second.stream.name}
        await person.press(Key.V, CTRL | SHIFT)  # the first comes back before a third is opened
        await look_still(person)
        assert first.is_seen
        assert first.stream.shown.camera == first.camera.view
        assert len(editor.viewports) == 2

    at_the_editor(scenario)


def test_four_views_look_along_the_axes_and_are_found_again(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await see(person)
        editor.panel.look.shows = "albedo"
        await person.click("menu/view")
        await person.click("menu/layout")
        await person.click("menu/view.four_views")
        await look_still(person)
        first, *others = editor.viewports
        assert not first.camera.is_parallel
        backward = [panel.camera.backward for panel in others]
        assert np.array(backward) == pytest.approx(np.array([(0, 1, 0), (0, 0, 1), (1, 0, 0)]), abs=1e-9)
        assert all(panel.camera.is_parallel for panel in others)
        assert len({panel.rectangle[:2] for panel in editor.viewports}) == 4
        others[0].look.shows, others[1].look.debug = "wireframe", ("contacts",)

        layout = editor.workspace.layout()
        state = session_state(editor.viewports, editor.ui.tools, {})
        kept = msgspec.json.decode(msgspec.json.encode(state), type=SessionState)
        places = [panel.rectangle for panel in editor.viewports]
        await person.click("menu/view")
        await person.click("menu/layout")
        await person.click("menu/view.reset_layout")
        await look_still(person)
        assert list(editor.viewports) == [first]
        editor.workspace.layouts._use(layout)  # as from the menu
        await look_still(person)
        assert np.array([panel.rectangle for panel in editor.viewports]) == pytest.approx(np.array(places), abs=2.0)

        editor.ui.actions.run("view.reset_layout")
        await person.frames(3)
        restore_session(kept, editor.viewports, Tools(), {})
        await look_still(person)
        assert editor.viewports.states() == kept.views
        assert [panel.look.shows for panel in editor.viewports] == ["albedo", "wireframe", "albedo", "albedo"]
        restore_session(SessionState(), editor.viewports, Tools(), {})
        await person.frames(3)
        assert list(editor.viewports) == [first]

    at_the_editor(scenario)


def test_a_still_scene_with_two_viewports_costs_no_pictures(at_the_editor):
    async def scenario(person):
        source = await see(person)
        await open_second(person)
        await person.frames(10)
        waiting = {}
        for request in source.requests:
            waiting[request.view] = request
        # Each has one request under way, for what would be other than what is seen; more frames ask for nothing more.
        assert all(request.newer_than_tick >= 0 for request in waiting.values())
        count, drawn = len(source.requests), len(source.sent)
        await person.frames(20)
        assert all(request.newer_than_tick >= 0 for request in source.requests[count:])  # after seconds they ask again
        assert len(source.sent) == drawn

    at_the_editor(scenario)
