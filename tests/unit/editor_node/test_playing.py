"""Keys and mouse that play the game in a viewport, and what gives them back."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from elys.bus import topics
from elys.bus.messages.commands import CommandRecord, Input
from elys.common.input_bindings import user_file
from elys.common.input_names import PAD_NAMES
from elys.editor_node.events import (
    CharacterTyped,
    KeyPressed,
    KeyReleased,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
    WindowFocused,
)
from elys.editor_node.key_bindings import Chord
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl


class Pad(NamedTuple):
    """As GLFW tells it."""

    buttons: list[int]
    axes: list[float]


class Game:
    """What the host hears of players."""

    def __init__(self, person) -> None:
        self.heard: list[Input] = []
        self.nodes: set[str] = set()
        person.stage.host.session.subscribe(topics.INPUT, self._arrived)

    def _arrived(self, message: Input, node: str) -> None:
        self.heard.append(message)
        self.nodes.add(node)

    @property
    def changes(self) -> list[tuple[str, bool]]:
        return [change for message in self.heard for change in message.changes]

    def moved(self, name: str) -> float:
        return sum(message.moved.get(name, 0.0) for message in self.heard)


async def see(person) -> Game:
    await person.stage.picture_source(entity=0)
    await person.until(lambda: person.editor.stream.shown is not None)
    return Game(person)


def test_keys_and_mouse_play_until_escape_gives_them_back(at_the_editor):
    async def scenario(person):
        editor = person.editor
        game = await see(person)
        editor.model.selection.replace((person.stage.named("Crate"),))
        pose, tool = editor.panel.camera.pose, editor.ui.tools.tool
        await person.click("toolbar/game")
        await person.until(lambda: person.stage.host.playing)
        assert editor.game.is_on
        # W, R, Ctrl+D and Delete mean much to the editor, F to the camera; none of it now.
        await person.do(KeyPressed(Key.W), KeyPressed(Key.W, repeated=True), KeyPressed(Key.R), KeyReleased(Key.R))
        await person.press(Key.F)
        await person.press(Key.D, CTRL)
        await person.press(Key.DELETE)
        await person.do(CharacterTyped(ord("é")))
        await person.until(lambda: any(message.text for message in game.heard))
        assert game.changes == [
            ("w", True),
            *(("r", True), ("r", False)),
            *(("f", True), ("f", False)),
            *(("left_control", True), ("d", True), ("d", False), ("left_control", False)),
            *(("delete", True), ("delete", False)),
        ]
        assert "".join(message.text for message in game.heard) == "é"
        await person.do(MouseMoved(500.0, 400.0), MouseMoved(507.0, 396.0), MouseMoved(512.0, 396.0))
        await person.do(MousePressed(MouseButton.LEFT), MouseReleased(MouseButton.LEFT), MouseScrolled(0.0, -2.0))
        await person.until(lambda: game.moved("wheel_y") == -2.0)
        assert (game.moved("pointer_x"), game.moved("pointer_y")) == (12.0, -4.0)
        assert game.changes[-2:] == [("mouse_left", True), ("mouse_left", False)]
        assert game.nodes == {editor.seat.node.id}
        assert (editor.panel.camera.pose, editor.ui.tools.tool) == (pose, tool)
        assert person.stage.host.received[1:] == []  # but for the command to play
        assert editor.model.selection.entities == (person.stage.named("Crate"),)

        await person.press(Key.ESCAPE)
        await person.until(lambda: game.heard[-1].lets_go)
        assert not editor.game.is_on
        assert person.stage.host.playing  # the game goes on by itself
        assert editor.model.selection.entities == (person.stage.named("Crate"),)  # Escape did nothing else
        count = len(game.heard)
        await person.do(KeyReleased(Key.W))
        await person.press(Key.R)
        assert editor.ui.tools.tool == "scale"
        assert len(game.heard) == count

    at_the_editor(scenario)


def test_what_happens_in_a_frame_is_one_message_in_order(at_the_editor):
    async def scenario(person):
        editor = person.editor
        game = await see(person)
        await person.press(Key.F5)
        assert editor.game.is_on
        await person.frames(2)
        game.heard.clear()
        for key in (Key.A, Key.S):
            editor.application.offer(KeyPressed(key))
        editor.application.offer(KeyReleased(Key.A))
        for step in range(10):
            editor.application.offer(MouseMoved(100.0 + step, 50.0))
        await person.until(lambda: game.heard)
        assert len(game.heard) == 1
        assert game.heard[0].changes == (("a", True), ("s", True), ("a", False))
        assert game.heard[0].moved == {"pointer_x": 9.0}
        await person.frames(5)
        assert len(game.heard) == 1  # and none while nothing happens

    at_the_editor(scenario)


def test_a_key_is_told_by_its_place_whatever_is_printed_on_it(at_the_editor):
    async def scenario(person):
        game = await see(person)
        await person.press(Key.F5)
        await person.do(KeyPressed(Key.Z, physical=Key.W), KeyReleased(Key.Z, physical=Key.W))  # AZERTY
        await person.until(lambda: len(game.changes) == 2)
        assert game.changes == [("w", True), ("w", False)]

    at_the_editor(scenario)


def test_gamepads_play_with_what_the_person_has_bound(at_the_editor, tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path))

    async def scenario(person):
        editor = person.editor
        game = await see(person)
        pads = {0: pad(), 1: pad()}
        editor.game._pads = lambda: pads
        editor.game._keeps_bindings = True
        user_file().write_text('[bindings]\njump = "k"\n[player.2]\njump = "pad_y"\n')
        await person.press(Key.F5)
        await person.until(lambda: game.heard)
        assert (game.heard[0].player, game.heard[0].bindings) == (1, {"jump": "k"})
        shown = editor.panel.stream.shown
        assert game.heard[0].seen_time <= shown.simulation_time
        assert game.heard[0].seen_time >= 0.0
        pads = {0: pad("pad_a"), 1: pad("pad_start")}
        await person.until(lambda: game.heard[-1].player == 2)
        bound = {message.player: message.bindings for message in game.heard if message.bindings is not None}
        assert bound == {1: {"jump": "k"}, 2: {"jump": "pad_y"}}
        assert game.changes == [("pad_a", True)]
        refused = CommandRecord(
            tick=3, origin=editor.seat.node.id, command=Input(player=2), accepted=False, reason="no such key"
        )
        person.stage.host.session.publish(topics.COMMANDS, refused)
        await person.until(lambda: "no such key" in [line.text for line in editor.model.console])
        await person.press(Key.ESCAPE)
        await person.until(lambda: game.heard[-1].lets_go and game.heard[-1].player == 2)
        user_file().write_text("[bindings]\njump = 3\n")
        await person.press(Key.F5)
        assert editor.game.is_on  # with the scene's own controls
        assert "bindings.toml:2: jump is bound to a text" in editor.model.error

    at_the_editor(scenario)


def pad(*down: str) -> Pad:
    return Pad([int(name in down) for name in PAD_NAMES], [0.0, 0.0, 0.0, 0.0, -1.0, -1.0])


@pytest.mark.parametrize("how", ["focus", "host", "closed", "hidden", "key"])
def test_keys_come_back_when_there_is_nothing_to_play(at_the_editor, how):
    async def scenario(person):
        editor = person.editor
        game = await see(person)
        await person.press(Key.V, CTRL | SHIFT)
        await person.until(lambda: editor.viewports.used.number == 2 and editor.viewports.used.is_seen)
        if how == "key":  # another one than Escape, which the game may want
            editor.ui.keys.bind("game.leave", Chord.parse("Ctrl+F12"))
        if how == "hidden":
            await person.point("viewport/picture")
        await person.press(Key.F5)
        played = editor.game.panel
        assert played is not None
        assert played.is_played
        await person.do(KeyPressed(Key.W))
        if how == "focus":
            await person.do(WindowFocused(False))
        elif how == "host":
            person.stage.host.kind = "replay"
            person.stage.host.publish_status()
            await person.until(lambda: editor.model.is_replay)
            await person.frames(2)
        elif how in ("closed", "hidden"):
            editor.workspace.close_viewport(played)
            await person.frames(2)
        else:
            await person.press(Key.ESCAPE)
            assert editor.game.is_on
            await person.press(Key.F12, CTRL)
        assert not editor.game.is_on
        assert not played.is_played
        await person.until(lambda: game.heard[-1].lets_go)
        if how != "host":
            assert editor.ui.actions.may_run("game.play")
        else:
            assert not editor.ui.actions.may_run("game.play")

    at_the_editor(scenario)


def test_a_banner_says_where_the_keys_go(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        await see(person)
        editor.screenshot(screenshot_directory / "before-playing.png")
        await person.press(Key.F5)
        await person.frames(3)
        editor.screenshot(screenshot_directory / "playing.png")
        from PIL import Image, ImageChops

        pictures = [Image.open(screenshot_directory / f"{name}.png") for name in ("before-playing", "playing")]
        x, y, width, height = (int(value) for value in editor.panel.rectangle)
        difference = ImageChops.difference(*pictures)
        assert difference.crop((x + width // 4, y + 8, x + 3 * width // 4, y + 40)).getbbox() is not None
        # A frame all around.
        for edge in ((x, y + height // 2, x + 4, y + height // 2 + 4), (x + width - 4, y + 200, x + width, y + 204)):
            assert difference.crop(edge).getbbox() is not None

    at_the_editor(scenario)
