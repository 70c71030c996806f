"""The hierarchy in the hands of a person: everything that can be done there, done with the real widgets."""

from __future__ import annotations

import asyncio
import json
import time

import pytest

from elys.bus.messages import commands as c
from elys.bus.session import Session
from elys.common.scene import EntityRecord
from elys.editor_node.events import (
    CharacterTyped,
    KeyPressed,
    KeyReleased,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
)
from elys.editor_node.keys import Key
from elys.editor_node.model import EditorModel
from elys.editor_node.tree_walk import TYPE_AHEAD_PAUSE
from tests.unit.editor_node.person import ALT, CTRL, SHIFT
from tests.unit.editor_node.scene_host import tree_of

pytestmark = pytest.mark.gl


def names_of(person) -> list[str]:
    model = person.editor.model
    return [model.scene.name_of(entity) for entity in model.selection]


def lines_of(person) -> list[str]:
    rows = person.editor.workspace.hierarchy.rows(person.editor.ui)
    return [person.editor.model.scene.name_of(entity) for entity in rows.entities]


async def search(person, text: str) -> None:
    """Types another search instead of what stands there."""
    await person.click("hierarchy/search")
    await person.press(Key.A, CTRL)
    await person.press(Key.DELETE)
    await person.type(text)
    await person.frames(2)


def test_searching_with_filters_and_examples(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        await search(person, "t:Light")
        assert lines_of(person) == ["Sun"]
        await search(person, "c:RigidBody !box")
        assert lines_of(person) == ["Crate"]
        editor.screenshot(screenshot_directory / "hierarchy-search.png")
        await search(person, "c:RigidBdy")
        assert "hierarchy/problem" in editor.ui.landmarks.rectangles
        assert "did you mean RigidBody" in str(editor.workspace.hierarchy._problem)
        editor.screenshot(screenshot_directory / "hierarchy-problem.png")
        await person.click("hierarchy/filters")
        await person.frames(2)
        editor.screenshot(screenshot_directory / "hierarchy-filters.png")
        await person.click("filters/0")  # all lights
        await person.frames(2)
        assert lines_of(person) == ["Sun"]
        await person.click("hierarchy/Sun/switch")
        await person.until(lambda: not person.stage.host.mirror.entities[person.stage.named("Sun")].enabled)
        await search(person, "!enabled")
        assert lines_of(person) == ["Sun"]
        await person.click("hierarchy/Sun")
        await person.press(Key.A, CTRL)
        assert names_of(person) == ["Sun"]  # all that is found, and not what hides it
        await person.press(Key.I, CTRL)
        assert names_of(person) == []
        await person.click("hierarchy/filters")
        await person.click("filters/none")
        await person.frames(2)
        assert len(lines_of(person)) > 8
        await person.press(Key.F, CTRL)
        await person.frames(2)
        await person.type("hand")
        await person.frames(2)
        assert lines_of(person) == ["Crate", "Lid", "Handle"]

    at_the_editor(scenario)


def test_sorting_is_only_a_view_and_forbids_dropping_between_lines(at_the_editor):
    async def scenario(person):
        mirror = person.stage.host.mirror
        in_scene = lines_of(person)
        await person.click("hierarchy/order")
        await person.click("order/name")
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert lines_of(person)[:3] == ["Box 1", "Box 2", "Box 3"]
        before = tree_of(mirror)
        start = person.editor.ui.landmarks.center("hierarchy/Box 4")
        left, top, _, _ = person.editor.ui.landmarks.rectangles["hierarchy/Sun"]
        await person.drag("hierarchy/Box 4", left + 60.0 - start[0], top + 1.0 - start[1])  # the edge between two lines
        await person.until(lambda: mirror.entities[person.stage.named("Box 4")].parent == person.stage.named("Sun"))
        await person.press(Key.Z, CTRL)
        await person.until(lambda: tree_of(mirror) == before)
        await person.click("hierarchy/order")
        await person.click("order/kind")
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert lines_of(person)[0] == "Crate"  # Body, Collider, Light, Mesh
        await person.click("hierarchy/order")
        await person.click("order/scene")
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert lines_of(person) == in_scene

    at_the_editor(scenario)


def test_walking_with_keys(at_the_editor):
    async def scenario(person):
        await person.click("hierarchy/Crate")
        await person.press(Key.DOWN_ARROW)
        assert names_of(person) == ["Lid"]
        await person.press(Key.RIGHT_ARROW)
        await person.frames(2)
        assert "Handle" in lines_of(person)
        await person.press(Key.RIGHT_ARROW)
        assert names_of(person) == ["Handle"]
        await person.press(Key.LEFT_ARROW)
        await person.press(Key.LEFT_ARROW)
        assert names_of(person) == ["Lid"] and "Handle" not in lines_of(person)
        await person.press(Key.UP_ARROW)
        await person.press(Key.DOWN_ARROW, SHIFT)
        await person.press(Key.DOWN_ARROW, SHIFT)
        assert names_of(person) == ["Crate", "Lid", "Sun"]
        await person.press(Key.UP_ARROW, SHIFT)
        assert names_of(person) == ["Crate", "Lid"]
        await person.press(Key.END)
        assert names_of(person) == ["Box 6"]
        await person.press(Key.HOME, SHIFT)
        assert len(names_of(person)) == len(lines_of(person))
        await person.press(Key.HOME)
        assert names_of(person) == ["Ground"]
        await person.press(Key.LEFT_ARROW, ALT)  # what was selected before
        assert len(names_of(person)) == len(lines_of(person))
        await person.press(Key.RIGHT_ARROW, ALT)
        assert names_of(person) == ["Ground"]

        # A name; o is no key of its own, and within a name those that are belong to it.
        tool = person.editor.ui.tools.tool
        for letter in "box 4":
            key = ord(letter.upper())
            await person.do(KeyPressed(key), CharacterTyped(ord(letter)), KeyReleased(key))
        assert names_of(person) == ["Box 4"]
        assert person.editor.ui.tools.tool == tool and not person.stage.host.playing
        # With another panel in hand the arrows are not the tree's.
        await person.click("inspector/Transform/position/1", times=1)
        await person.press(Key.ESCAPE)
        selected = names_of(person)
        await person.press(Key.DOWN_ARROW)
        assert names_of(person) in (selected, [])

    at_the_editor(scenario)


class Hitch:
    """A layer that makes the next frame take long, once."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def on_event(self, event) -> bool:
        return False

    def update(self, elapsed: float) -> None:
        time.sleep(self.seconds)
        self.seconds = 0.0


def test_a_frame_that_takes_long_is_no_pause_in_a_name(at_the_editor):
    """Who types on was not heard meanwhile: on a slow machine every frame is like that."""

    async def scenario(person):
        hitch = Hitch()
        person.application.push_layer(hitch)

        async def type_ahead(text: str) -> None:
            for letter in text:
                key = ord(letter.upper())
                await person.do(KeyPressed(key), CharacterTyped(ord(letter)), KeyReleased(key))

        await person.click("hierarchy/Ground")
        await type_ahead("bo")
        hitch.seconds = TYPE_AHEAD_PAUSE + 0.2
        await person.frames(2)
        assert person.editor.model.walk.is_typing
        await type_ahead("x 4")
        assert names_of(person) == ["Box 4"]
        person.application.listened += TYPE_AHEAD_PAUSE  # and this is one
        assert not person.editor.model.walk.is_typing
        await type_ahead("c")
        assert names_of(person) == ["Crate"]

    at_the_editor(scenario)


def test_renaming_takes_any_letters(at_the_editor):
    async def scenario(person):
        entities = person.stage.host.mirror.entities
        crate = person.stage.named("Crate")
        for name in ("Truhe mit Bändern", "宝箱", "صندوق", "x" * 200, '"quoted" / slashed\\'):
            await person.click(f"hierarchy/{entities[crate].name}")
            await person.press(Key.F2)
            await person.frames(3)
            await person.type(name)
            await person.press(Key.ENTER)
            await person.until(lambda name=name: entities[crate].name == name)
            await person.frames(2)
        await person.press(Key.F2)
        await person.frames(3)
        await person.type("   ")
        await person.press(Key.ENTER)
        await person.press(Key.F2)
        await person.frames(3)
        await person.type("never")
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert entities[crate].name == '"quoted" / slashed\\'

    at_the_editor(scenario)


def test_cut_copy_and_paste_from_one_editor_to_another(at_the_editor):
    async def scenario(person):
        stage, editor = person.stage, person.editor
        await person.click("hierarchy/Crate")
        await person.press(Key.C, CTRL)
        text = editor.window.read()
        assert json.loads(text)["entities"][0]["children"][0]["name"] == "Lid"
        # The other editor is a model on the same host: it takes what the system's clipboard holds.
        stage.model.tree.clipboard.write(text)
        stage.model.selection.replace([stage.named("Box 2")])
        outcome = await stage.model.tree.paste(directory=stage_directory)
        assert outcome.accepted
        await person.until(lambda: "Crate 2" in lines_of(person))
        assert lines_of(person).index("Crate 2") == lines_of(person).index("Box 2") + 1

        count = len(stage.host.mirror.entities)
        await person.press(Key.X, CTRL)
        await person.until(lambda: len(stage.host.mirror.entities) == count - 3)
        await person.click("hierarchy/Sun")
        await person.press(Key.V, CTRL)
        await person.until(lambda: len(stage.host.mirror.entities) == count)
        await person.until(lambda: names_of(person) == ["Crate"])
        editor.window.write("no scene at all")
        await person.press(Key.V, CTRL)
        await person.until(lambda: editor.model.error.startswith("cannot paste: the clipboard holds no entities"))
        assert len(stage.host.mirror.entities) == count

    from pathlib import Path

    stage_directory = Path()
    at_the_editor(scenario)


def test_several_are_dragged_at_once_but_never_below_themselves(at_the_editor):
    async def scenario(person):
        mirror = person.stage.host.mirror
        sun, crate, lid = (person.stage.named(name) for name in ("Sun", "Crate", "Lid"))
        boxes = [person.stage.named(f"Box {number}") for number in (2, 3)]
        places = {box: mirror.world_pose(box).position for box in boxes}
        await person.click("hierarchy/Box 2")
        await person.click("hierarchy/Box 3", held=CTRL)
        # By the other one: pressed again at once, this one would be clicked twice.
        await person.drag_onto("hierarchy/Box 2", "hierarchy/Crate")
        await person.until(lambda: all(mirror.entities[box].parent == crate for box in boxes))
        await person.editor.model.history.settle()
        assert {box: mirror.world_pose(box).position for box in boxes} == places
        await person.press(Key.Z, CTRL)
        await person.until(lambda: all(mirror.entities[box].parent == 0 for box in boxes))
        await person.editor.model.history.settle()
        await person.frames(3)

        received = len(person.stage.host.received)
        await person.drag_onto("hierarchy/Crate", "hierarchy/Lid")  # below itself
        await person.frames(3)
        assert len(person.stage.host.received) == received
        await person.click("hierarchy/Ground")  # in between, lest the next be the second of two clicks
        await person.click("hierarchy/Crate")
        await person.click("hierarchy/Sun", held=CTRL)
        await person.drag_onto("hierarchy/Crate", "hierarchy/Lid")  # one of the two can go there
        await person.until(lambda: mirror.entities[sun].parent == lid)
        await person.editor.model.history.settle()
        assert mirror.entities[crate].parent == 0

    at_the_editor(scenario)


def test_grouping_and_selecting_relatives_through_the_menu(at_the_editor, screenshot_directory):
    async def scenario(person):
        mirror, landmarks = person.stage.host.mirror, person.editor.ui.landmarks
        await person.click("hierarchy/Box 2")
        await person.click("hierarchy/Box 4", held=SHIFT)
        await person.press(Key.G, CTRL)
        await person.until(lambda: names_of(person) == ["Group"])
        await person.editor.model.history.settle()
        assert [mirror.entities[e].name for e in mirror.children_of(person.stage.named("Group"))] == [
            "Box 2",
            "Box 3",
            "Box 4",
        ]

        async def choose(name: str, action: str) -> None:
            landmarks.rectangles.pop("menu/select", None)
            await person.right_click(f"hierarchy/{name}")
            await person.frames(2)
            await person.point("menu/select")
            await person.frames(30)
            await person.click(f"menu/{action}")
            await person.frames(2)

        await choose("Group", "select.children")
        assert names_of(person) == ["Box 2", "Box 3", "Box 4"]
        person.editor.screenshot(screenshot_directory / "hierarchy-selected.png")
        await choose("Box 3", "select.parent")
        assert names_of(person) == ["Group"]
        await choose("Box 1", "select.same_components")
        assert sorted(names_of(person)) == [f"Box {number}" for number in range(1, 7)]
        await choose("Box 1", "select.inverse")
        assert "Sun" in names_of(person) and "Box 1" not in names_of(person)

    at_the_editor(scenario)


def test_opening_and_closing_all(at_the_editor):
    async def scenario(person):
        await person.click("hierarchy/order")
        await person.click("menu/tree.expand_all")
        await person.frames(2)
        assert "Handle" in lines_of(person)
        await person.click("hierarchy/order")
        await person.click("menu/tree.collapse_all")
        await person.frames(2)
        assert "Lid" not in lines_of(person)
        await person.right_click("hierarchy/Crate")
        await person.click("menu/tree.open_below")
        await person.frames(2)
        assert lines_of(person)[1:4] == ["Crate", "Lid", "Handle"]

    at_the_editor(scenario)


def test_what_is_locked_is_not_picked_and_what_is_hidden_not_drawn(at_the_editor, screenshot_directory):
    async def scenario(person):
        model, sun, crate = person.editor.model, person.stage.named("Sun"), person.stage.named("Crate")
        source = await person.stage.picture_source(entity=crate)
        await person.until(lambda: person.editor.stream.shown is not None)
        await person.click("viewport/picture")
        await person.until(lambda: names_of(person) == ["Crate"])
        await person.click("hierarchy/Crate/lock")
        await person.click("hierarchy/Sun/eye")
        await person.frames(3)
        assert model.scene.marks.own("locked") == (crate,)
        await person.until(lambda: source.requests[-1].hidden == (sun,))
        person.editor.screenshot(screenshot_directory / "hierarchy-marks.png")
        assert not person.editor.panel.gizmo._targets(person.editor.ui)  # nothing to drag
        await person.click("hierarchy/Sun")
        await person.press(Key.Q)  # no handles in the way
        picks = len(source.picks)
        await person.click("viewport/picture")
        await person.until(lambda: len(source.picks) > picks)
        assert source.picks[-1].passed_over == (crate, sun)
        await person.until(lambda: names_of(person) == [])  # this render node passes over nobody: its answer is refused
        await search(person, "locked")
        assert lines_of(person) == ["Crate", "Lid", "Handle"]
        await search(person, "")
        await person.click("hierarchy/Crate")
        await person.press(Key.L, CTRL)
        assert model.scene.marks.own("locked") == ()
        await person.press(Key.H, CTRL)
        assert model.scene.marks.own("hidden") == (sun, crate)
        await person.press(Key.H, CTRL | SHIFT)
        assert model.scene.marks.own("hidden") == ()
        await source.close()

    at_the_editor(scenario)


def test_what_one_drags_another_may_delete(at_the_editor):
    async def scenario(person):
        stage, editor = person.stage, person.editor
        session = await Session.join(stage.broker.connect(), kind="editor")
        other = EditorModel(session)
        running = asyncio.create_task(other.run())
        await person.until(lambda: other.scene.is_known)
        landmarks = editor.ui.landmarks

        async def delete(name: str) -> None:
            entity = stage.named(name)
            other.selection.replace([entity])
            while not (
                await other.edit.delete()
            ).accepted:  # refused while it is new there that the first has changed it
                await person.frames(1)
            await person.until(lambda: entity not in editor.model.scene.mirror.entities)

        # A line of the tree, on its way to another.
        await person.point("hierarchy/Box 1")
        await person.do(MousePressed(MouseButton.LEFT))
        x, y = landmarks.center("hierarchy/Crate")
        await person.do(MouseMoved(x, y + 60.0), MouseMoved(x, y))
        await delete("Box 1")
        await person.do(MouseMoved(x + 1.0, y), MouseReleased(MouseButton.LEFT))
        await person.frames(3)
        assert not any(isinstance(command, c.Reparent) for command in stage.host.received)

        # The line that it would be dropped on.
        await person.point("hierarchy/Box 2")
        await person.do(MousePressed(MouseButton.LEFT))
        x, y = landmarks.center("hierarchy/Box 6")
        await person.do(MouseMoved(x, y - 30.0), MouseMoved(x, y))
        await delete("Box 6")
        await person.do(MouseReleased(MouseButton.LEFT))
        await person.frames(3)
        assert stage.host.mirror.entities[stage.named("Box 2")]

        # A field in the inspector.
        await person.click("hierarchy/Box 3")
        await person.frames(2)
        await person.point("inspector/Transform/position/1")
        x, y = landmarks.center("inspector/Transform/position/1")
        await person.do(MousePressed(MouseButton.LEFT), MouseMoved(x + 10.0, y), MouseMoved(x + 40.0, y))
        await delete("Box 3")
        await person.do(MouseMoved(x + 60.0, y), MouseReleased(MouseButton.LEFT))
        await person.frames(3)
        assert names_of(person) == []
        # A name that is being typed.
        await person.click("hierarchy/Box 4")
        await person.press(Key.F2)
        await person.frames(3)
        await delete("Box 4")
        await person.type("Too late")
        await person.press(Key.ENTER)
        await person.frames(3)
        # And all of it is still there to be worked with.
        await person.click("hierarchy/Sun")
        await person.press(Key.F2)
        await person.frames(3)
        await person.type("Star")
        await person.press(Key.ENTER)
        await person.until(lambda: stage.named("Star"))
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await session.close()

    at_the_editor(scenario)


def test_a_scene_of_thousands_is_walked_to_its_end(at_the_editor):
    records = [EntityRecord(name=f"Thing {number}") for number in range(3000)]

    async def scenario(person):
        await person.click("hierarchy/Thing 3")
        await person.press(Key.END)
        await person.frames(3)
        assert names_of(person) == ["Thing 2999"]
        _, top, _, bottom = person.editor.ui.landmarks.rectangles["hierarchy/Thing 2999"]
        assert 0.0 < top < bottom < 900.0
        await person.press(Key.PAGE_UP)
        assert 2900 < int(names_of(person)[0].removeprefix("Thing ")) < 2999
        await person.press(Key.DELETE)
        await person.until(lambda: len(person.stage.host.mirror.entities) == 2999)

    at_the_editor(scenario, records)
