"""Hands at the real editor of a real simulation, with a real render node: what they do is so, as another node sees it.

One session serves all scenarios: each opens the scene's file anew. What is waited for is waited for long: nothing here says how
fast anything is.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.messages.commands import Rename, SetPlaying
from elys.bus.messages.session import Event
from elys.common.assets import AssetStore
from elys.common.scene import EntityNode, SceneDocument, open_scene, write_scene
from elys.editor_node.camera import project
from elys.editor_node.events import CursorEntered, Modifiers, MouseButton, MouseMoved, MousePressed, MouseReleased
from elys.editor_node.keys import Key
from elys.editor_node.node import Editor
from elys.editor_node.panels import timeline
from tests.process.clients import Client, client
from tests.process.conftest import Command
from tests.process.test_editor_session import editor_at
from tests.unit.editor_node.asset_files import write_model
from tests.unit.editor_node.person import CTRL, SHIFT, Person

pytestmark = [pytest.mark.process, pytest.mark.gl]

PATIENCE = 200.0  # [s] a machine may take that compiles the physics first


def shape(x: float, y: float, z: float, **components) -> dict:
    return {"Transform": {"position": [x, y, z]}, "MeshRenderer": {}, "Material": {}, **components}


SCENE = SceneDocument(
    name="Garden",
    entities=[
        EntityNode(
            name="Ground",
            components={
                "Transform": {"position": [0, -0.1, 0], "scale": [40, 0.2, 40]},
                "Collider": {},
                "MeshRenderer": {},
            },
        ),
        EntityNode(name="Left", components=shape(-3, 1, 0)),
        EntityNode(name="Middle", components=shape(0, 1, 0)),
        EntityNode(name="Right", components=shape(3, 1, 0)),
        EntityNode(
            name="Tower",
            components=shape(-6, 2, -4),
            children=[EntityNode(name="Flag", components=shape(0, 3, 0))],
        ),
        EntityNode(name="Apple", components=shape(6, 8, -4, RigidBody={"mass": 2.0}, Collider={"shape": "sphere"})),
        EntityNode(name="Sun", components={"Transform": {"rotation": [-0.5, 0.2, 0.1, 0.8]}, "Light": {}}),
    ],
)


class House:
    """A simulation and a render node, somebody at an editor, and another node that only looks."""

    def __init__(self, editor: Editor, watcher: Client, path: Path) -> None:
        self.editor = editor
        self.model = editor.model
        self.watcher = watcher
        self.path = path
        self.person = Person(editor, self)
        self.events: list[Event] = []
        watcher.session.subscribe(topics.EVENTS, lambda batch, _: self.events.extend(batch.events))

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not condition():
                self.editor.application.request_redraw(0.05)
                await asyncio.sleep(0.005)

    async def begin(self) -> None:
        """The scene as its file first was, at rest, seen from the front."""
        person, model = self.person, self.model
        assert (await self.watcher.ask(SetPlaying(playing=False))).accepted
        await self.until(lambda: model.status is not None and not self.watcher.status.playing)
        await person.do(CursorEntered(True))
        await person.press(Key.ESCAPE)
        write_scene(SCENE, self.path)
        old = set(self.watcher.mirror.entities)
        await model.documents.open(self.path)
        await self.until(lambda: not old & set(self.watcher.mirror.entities) and "Sun" in self.names())
        await self.until(lambda: model.history.is_attached and model.file.path == self.path)
        await self.until(lambda: model.scene.mirror.sequence == self.watcher.mirror.sequence)
        assert not model.file.is_dirty
        model.selection.clear()
        self.editor.ui.tools.tool = "move"
        self.editor.ui.landmarks.rectangles.clear()
        self.editor.panel.camera.look_from((0.0, 2.5, 16.0), (0.0, -0.05, -1.0), 16.0)
        await self.look_still()
        await self.until(lambda: "hierarchy/Sun" in self.editor.ui.landmarks.rectangles)

    async def look_still(self) -> None:
        """Until the picture is what the camera sees now, in the viewport's size."""
        panel = self.editor.panel

        def is_still() -> bool:
            shown, (_, _, width, height) = panel.stream.shown, panel.rectangle
            is_whole = shown is not None and (shown.width, shown.height) == (int(width), int(height))
            return is_whole and not panel.camera.is_gliding and shown.camera == panel.camera.view

        await self.person.frames(3)
        await self.until(is_still)
        await self.person.frames(2)

    async def settle(self) -> None:
        """Until the editor's edits are answered, and the other node has heard of them."""
        await self.model.history.settle()
        await self.until(lambda: self.watcher.mirror.sequence == self.model.scene.mirror.sequence)
        await self.person.frames(2)

    def names(self) -> list[str]:
        """Of all entities, as the other node sees them."""
        return sorted(entity.name for entity in self.watcher.mirror.entities.values())

    def there(self, name: str):
        """An entity as the other node sees it; None where there is none."""
        return next((entity for entity in self.watcher.mirror.entities.values() if entity.name == name), None)

    def place(self, name: str) -> np.ndarray:
        """Where it is in the world, as the other node sees it."""
        return np.array(self.watcher.mirror.world_pose(self.there(name).id).position)

    def selected(self) -> list[str]:
        return [self.model.scene.name_of(entity) for entity in self.model.selection]

    def pixel(self, point) -> np.ndarray:
        """Where a point in the world is seen in the window."""
        panel = self.editor.panel
        x, y, width, height = panel.rectangle
        across, up = project(panel.stream.shown.camera, width / height, np.array(point, float))
        return np.array((x + (1 + across) / 2 * width, y + (1 - up) / 2 * height))

    async def seen(self, name: str) -> np.ndarray:
        """Where in the window something is seen, once the render node sees it there."""
        x, y, width, height = self.editor.panel.rectangle
        pixel, stream, entity = self.pixel(self.place(name)), self.editor.stream, self.there(name).id
        at = int((pixel[0] - x) / width * stream.shown.width), int((pixel[1] - y) / height * stream.shown.height)
        async with asyncio.timeout(PATIENCE):
            while (await stream.pick(*at)).entity != entity:
                await asyncio.sleep(0.02)
        return pixel

    async def click(self, place, *, held: Modifiers = Modifiers.NONE) -> None:
        await self.person.do(MouseMoved(*place))
        await self.person.do(MousePressed(MouseButton.LEFT, held), MouseReleased(MouseButton.LEFT, held))

    async def drag(self, start, end, *, steps: int = 4) -> None:
        await self.person.do(MouseMoved(*start))
        await self.person.frames(2)
        await self.person.do(MousePressed(MouseButton.LEFT))
        for step in range(1, steps + 1):
            await self.person.do(MouseMoved(*(np.array(start) + (np.array(end) - start) * step / steps)))
        await self.person.do(MouseReleased(MouseButton.LEFT))

    async def undo(self) -> None:
        await self.person.press(Key.Z, CTRL)
        await self.settle()

    async def enter(self, text: str) -> None:
        """In place of what a field held."""
        await self.person.press(Key.A, CTRL)
        await self.person.type(text)
        await self.person.press(Key.ENTER)
        await self.settle()

    async def rename(self, name: str, new: str) -> None:
        """In the hierarchy."""
        await self.person.click(f"hierarchy/{name}")
        await self.person.press(Key.F2)
        await self.person.frames(3)
        await self.enter(new)

    async def play_until(self, condition: Callable[[], bool]) -> None:
        """By the space bar, and by it paused again; until both nodes know where it stands."""
        await self.person.press(Key.SPACE)
        await self.until(lambda: self.watcher.status.playing and self.model.is_playing)
        await self.until(condition)
        await self.person.press(Key.SPACE)
        await self.until(lambda: not self.watcher.status.playing and not self.model.is_playing)
        await self.until(self.is_at_rest)

    def is_at_rest(self) -> bool:
        tick = self.watcher.status.tick
        return bool(self.watcher.frames) and self.watcher.frames[-1].tick == tick == self.model.status.tick


@pytest.fixture(scope="module")
def at_home(tmp_path_factory) -> Iterator[Callable]:
    """Runs `await scenario(house)` in the session of this module."""
    folder = tmp_path_factory.mktemp("home")
    path = folder / "garden.scene.json"
    write_scene(SCENE, path)
    (folder / "assets").mkdir()
    write_model(folder / "assets" / "square.gltf", size=2.0)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    hidden = {"DISPLAY", "WAYLAND_DISPLAY"}
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    own = {"ELYS_RUNTIME_DIR": str(folder / "runtime"), "ELYS_CACHE_DIR": str(folder / "cache")}
    (folder / "runtime").mkdir()
    environment |= {**own, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}
    with pytest.MonkeyPatch.context() as patch, contextlib.ExitStack() as stack:
        for name, value in own.items():
            patch.setenv(name, value)

        def start(*words: str) -> Command:
            command = Command(words, environment, folder)
            stack.callback(command.end)
            return command

        simulation = start("run", str(path), "--headless", "--realtime", "--paused", "--listen", endpoint)
        simulation.wait_for("simulating", seconds=PATIENCE)
        start("node", "render", "--connect", endpoint).wait_for("drawing views", seconds=PATIENCE)
        with asyncio.Runner() as runner:
            async_stack = contextlib.AsyncExitStack()

            async def come() -> House:
                watcher = await async_stack.enter_async_context(client(endpoint))
                editor = await async_stack.enter_async_context(editor_at(endpoint, size=(1400, 860)))
                house = House(editor, watcher, path)
                await house.until(lambda: editor.model.scene.is_known and watcher.status is not None)
                editor.assets.open(folder / "assets")
                return house

            async def visit(house: House, scenario) -> None:
                await house.begin()
                await scenario(house)

            house = runner.run(come())
            try:
                yield lambda scenario: runner.run(visit(house, scenario))
            finally:
                runner.run(async_stack.aclose())


def test_a_click_in_the_picture_selects_and_delete_takes_it_out_of_the_simulation(at_home):
    async def scenario(house):
        person = house.person
        content, names = house.watcher.mirror.content, house.names()
        await person.press(Key.Q)  # no handles in the way
        await house.click(await house.seen("Left"))
        await house.until(lambda: house.selected() == ["Left"])
        await house.click(await house.seen("Right"), held=SHIFT)
        await house.until(lambda: house.selected() == ["Left", "Right"])
        assert house.watcher.mirror.content == content  # to select changes nothing
        await person.press(Key.DELETE)
        await house.settle()
        assert set(names) - set(house.names()) == {"Left", "Right"}
        assert house.selected() == []
        await house.undo()
        assert house.names() == names
        assert house.watcher.mirror.content == content
        await house.seen("Right")  # the render node has it again

    at_home(scenario)


def test_a_rectangle_selects_three_which_are_grouped(at_home):
    async def scenario(house):
        names = ("Left", "Middle", "Right")
        places = {name: house.place(name) for name in names}
        await house.person.press(Key.Q)
        low, high = (
            house.pixel(np.add(places["Left"], (-1.2, -0.8, 0))),
            house.pixel(np.add(places["Right"], (1.2, 1.2, 0))),
        )
        await house.drag(low, high)
        assert sorted(house.selected()) == sorted(names)
        await house.person.press(Key.G, CTRL)
        await house.settle()
        group = house.there("Group")
        assert sorted(house.watcher.mirror.entities[child].name for child in group.children) == sorted(names)
        for name in names:
            assert house.place(name) == pytest.approx(places[name], abs=1e-5)
        await house.until(lambda: house.selected() == ["Group"])
        await house.undo()
        assert house.there("Group") is None
        assert house.there("Left").parent == 0

    at_home(scenario)


def test_a_handle_moves_a_thing_along_its_axis(at_home):
    async def scenario(house):
        before = house.place("Middle")
        await house.person.click("hierarchy/Middle")
        await house.person.press(Key.W)
        start = house.pixel(before)
        along = house.pixel(np.add(before, (1, 0, 0))) - start
        along /= np.linalg.norm(along)
        await house.drag(start + 55.0 * along, start + 135.0 * along)
        await house.settle()
        moved = house.place("Middle") - before
        assert moved[0] > 0.3
        assert moved[1:] == pytest.approx((0.0, 0.0), abs=1e-4)
        seen = await house.seen("Middle")
        assert seen[0] > start[0] + 40.0  # and the render node draws it there
        await house.undo()
        assert house.place("Middle").tolist() == before.tolist()
        assert not house.model.history.undo_label  # one entry for the whole drag

    at_home(scenario)


def test_a_field_is_edited_undone_and_done_again_by_keys(at_home):
    async def scenario(house):
        def mass() -> float:
            return house.there("Apple").components["RigidBody"].mass

        await house.person.click("hierarchy/Apple")
        await house.person.click("inspector/RigidBody/mass", times=2)
        await house.enter("3 * 2.5")
        assert mass() == 7.5
        await house.undo()
        assert mass() == 2.0
        await house.person.press(Key.Y, CTRL)
        await house.settle()
        assert mass() == 7.5
        # What the simulation would not take does not leave the field.
        await house.person.click("inspector/RigidBody/mass", times=2)
        await house.enter("heavy")
        assert mass() == 7.5
        await house.person.press(Key.ESCAPE)
        await house.person.click("toolbar/undo")
        await house.settle()
        assert mass() == 2.0
        await house.person.click("toolbar/redo")
        await house.settle()
        assert mass() == 7.5

    at_home(scenario)


def test_the_hierarchy_renames_deletes_and_moves(at_home):
    async def scenario(house):
        await house.rename("Middle", "Mitte")
        assert house.there("Mitte") is not None
        assert house.there("Middle") is None
        before = house.place("Mitte")
        await house.person.drag_onto("hierarchy/Mitte", "hierarchy/Tower")
        await house.until(lambda: house.there("Mitte").parent == house.there("Tower").id)
        await house.settle()
        assert house.place("Mitte") == pytest.approx(before, abs=1e-5)
        await house.person.click("hierarchy/Sun/switch")
        await house.until(lambda: not house.there("Sun").enabled)
        await house.settle()
        await house.person.click("hierarchy/Tower")
        await house.person.press(Key.DELETE)
        await house.settle()
        assert not {"Tower", "Flag", "Mitte"} & set(house.names())
        for _ in range(4):
            await house.undo()
        assert house.there("Middle").parent == 0
        assert house.there("Flag").parent == house.there("Tower").id
        assert house.there("Sun").enabled

    at_home(scenario)


def test_components_are_added_and_taken_away(at_home):
    async def scenario(house):
        bodies = house.watcher.status.body_count
        await house.person.click("hierarchy/Left")
        await house.person.click("inspector/Material")  # folded, so that what is below comes into sight
        await house.person.click("inspector/MeshRenderer")
        await house.person.frames(3)
        await house.person.click("inspector/add")
        await house.person.frames(3)
        await house.person.type("rigid")
        await house.person.click("component/RigidBody")
        await house.until(lambda: "RigidBody" in house.there("Left").components)
        await house.until(lambda: house.watcher.status.body_count == bodies + 1)
        await house.settle()
        await house.person.click("inspector/RigidBody/menu")
        await house.person.frames(3)
        await house.person.click("component/remove")
        await house.until(lambda: "RigidBody" not in house.there("Left").components)
        await house.until(lambda: house.watcher.status.body_count == bodies)

    at_home(scenario)


def test_an_asset_is_dropped_where_the_picture_shows_a_thing(at_home):
    async def scenario(house):
        editor, person = house.editor, house.person
        editor.workspace.assets.search()
        await house.until(lambda: editor.assets.folder is not None and editor.assets.folder.is_known)
        await house.until(lambda: "assets/square.gltf" in editor.ui.landmarks.rectangles)
        [file] = [file for file in editor.assets.listing.files if file.name == "square.gltf"]
        await house.until(lambda: editor.assets.content(file) is not None)
        await person.frames(3)
        count = len(house.names())
        onto = await house.seen("Right")
        start = np.array(editor.ui.landmarks.center("assets/square.gltf"))
        await person.do(MouseMoved(*start), MousePressed(MouseButton.LEFT), MouseMoved(start[0] + 12.0, start[1]))
        await person.do(MouseMoved(*onto), MouseMoved(onto[0] + 1.0, onto[1]))
        await person.frames(2)
        await person.do(MouseReleased(MouseButton.LEFT))
        await house.until(lambda: len(house.names()) > count)
        await house.settle()
        [new] = [entity for entity in house.watcher.mirror.entities.values() if "square" in entity.name.lower()][:1]
        # It stands on the front of the cube that was pointed at: half a metre before its middle.
        place = house.place(new.name)
        assert place[2] == pytest.approx(0.5, abs=0.1)
        assert place[0] == pytest.approx(3.0, abs=0.3)
        assert house.selected() == [new.name]
        await house.undo()
        assert len(house.names()) == count

    at_home(scenario)


def test_time_goes_on_stands_still_and_goes_one_tick(at_home):
    async def scenario(house):
        start = house.place("Apple")[1]
        await house.play_until(lambda: house.place("Apple")[1] < start - 0.5)
        tick, height = house.watcher.status.tick, house.place("Apple")[1]
        await house.person.click("toolbar/step")
        await house.until(lambda: house.watcher.status.tick == tick + 1)
        await house.until(house.is_at_rest)
        assert house.watcher.status.tick == tick + 1
        assert house.place("Apple")[1] < height
        assert house.model.scene.world_pose(house.there("Apple").id).position[1] == pytest.approx(
            house.place("Apple")[1]
        )
        await house.person.click("toolbar/play")
        await house.until(lambda: house.watcher.status.playing)
        await house.until(lambda: house.model.is_playing)
        await house.person.click("toolbar/play")
        await house.until(lambda: not house.watcher.status.playing)

    at_home(scenario)


def test_one_goes_back_in_time_and_begins_another_future(at_home):
    async def scenario(house):
        start, line = house.place("Apple")[1], house.model.timeline
        begun = house.watcher.status.tick
        await house.play_until(lambda: house.watcher.status.tick > begun + 60)
        newest, fallen = house.watcher.status.tick, house.place("Apple")[1]
        house.editor.workspace.show(timeline.TITLE)
        await house.until(lambda: "timeline/bar" in house.editor.ui.landmarks.rectangles)
        await house.person.frames(3)
        left, top, right, _ = house.editor.ui.landmarks.rectangles["timeline/bar"]
        first, last = line.span
        back, rate = begun + 30, house.watcher.status.tick_rate
        x = left + line.x_of(back / rate, right - left)
        nearly = back + 2 + int(2 * (last - first) * rate / (right - left))  # some pixels are many ticks
        await house.drag((right - 2.0, top + 3.0), (x, top + 3.0), steps=3)
        await house.until(lambda: house.watcher.status.tick <= nearly and house.is_at_rest())
        assert house.watcher.status.is_rewound
        here = house.watcher.status.tick
        assert begun < here < newest
        assert fallen < house.place("Apple")[1] <= start
        assert house.model.timeline.is_rewound
        assert house.watcher.status.end_time == pytest.approx(last)  # the future is kept
        # An edit there makes another future, in which it falls upwards, and which forgets the first.
        house.events.clear()
        await house.person.click("hierarchy/Apple")
        await house.person.click("inspector/RigidBody/gravity_scale", times=2)
        await house.enter("-1")
        await house.until(lambda: any(event.kind == "forked" for event in house.events))
        await house.until(lambda: not house.watcher.status.is_rewound and not house.model.timeline.is_rewound)
        assert house.watcher.status.tick == here
        assert first < house.watcher.status.end_time < last
        await house.play_until(lambda: house.watcher.status.tick > newest)
        assert house.place("Apple")[1] > fallen + 1.0
        # And without an edit: it goes on from where it was gone back to.
        newest = house.watcher.status.tick
        await house.person.click("timeline/step_back")
        await house.until(lambda: house.watcher.status.tick == newest - 1 and house.model.timeline.is_rewound)
        await house.person.click("timeline/resume")
        await house.until(lambda: not house.watcher.status.is_rewound and house.watcher.status.playing)
        await house.until(lambda: house.watcher.status.tick > newest)

    at_home(scenario)


def test_what_is_saved_is_what_is_there_and_is_found_again(at_home):
    async def scenario(house):
        person, file = house.person, house.model.file
        await house.rename("Left", "Port")
        await person.click("inspector/Transform/position/1", times=2)
        await house.enter("2.5")
        assert file.is_dirty
        await person.press(Key.S, CTRL)
        await house.until(lambda: not file.is_dirty)
        saved = {record.name: record for record in open_scene(house.path, AssetStore()).records}
        assert sorted(saved) == house.names()
        assert saved["Port"].components["Transform"]["position"] == [-3.0, 2.5, 0.0]
        # An edit that is given up: the file is what counts.
        await house.rename("Right", "Wrong")
        assert file.is_dirty
        old = house.there("Wrong").id
        await person.click("menu/file")
        await person.click("menu/file.revert")
        await person.click("lose/lose")
        await house.until(lambda: old not in house.watcher.mirror.entities and house.there("Right") is not None)
        await house.until(lambda: house.model.history.is_attached and not file.is_dirty)
        assert house.there("Wrong") is None
        assert house.place("Port").tolist() == [-3.0, 2.5, 0.0]
        await house.until(lambda: "hierarchy/Port" in house.editor.ui.landmarks.rectangles)

    at_home(scenario)


def test_what_another_one_does_is_seen_and_is_not_mine_to_undo(at_home):
    async def scenario(house):
        await house.rename("Left", "Mine")
        reply = await house.watcher.ask(Rename(entity=house.there("Right").id, name="Theirs"))
        assert reply.accepted
        await house.until(lambda: "hierarchy/Theirs" in house.editor.ui.landmarks.rectangles)
        await house.undo()
        assert house.there("Left") is not None
        assert house.there("Theirs") is not None
        await house.person.click("hierarchy/Theirs")
        assert house.selected() == ["Theirs"]

    at_home(scenario)


def test_several_are_edited_in_one_go(at_home):
    async def scenario(house):
        await house.person.click("hierarchy/Left")
        await house.person.click("hierarchy/Right", held=SHIFT)
        assert house.selected() == ["Left", "Middle", "Right"]
        await house.person.click("inspector/Transform/position/1", times=2)
        await house.enter("4")
        heights = [house.place(name) for name in ("Left", "Middle", "Right")]
        assert np.array(heights).tolist() == [[-3, 4, 0], [0, 4, 0], [3, 4, 0]]
        await house.person.press(Key.D, CTRL)
        await house.until(lambda: len(house.selected()) == 3 and "Left" not in house.selected())
        await house.settle()
        copies = house.selected()
        assert {tuple(house.place(name)) for name in copies} == {tuple(place) for place in heights}
        await house.undo()
        await house.undo()
        assert not set(copies) & set(house.names())
        assert house.place("Middle").tolist() == [0, 1, 0]

    at_home(scenario)
