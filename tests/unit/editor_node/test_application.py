"""The stack of layers: who hears what, in which order, and when frames are drawn."""

from __future__ import annotations

import asyncio

import pytest

from elys.editor_node.application import Application
from elys.editor_node.events import (
    CharacterTyped,
    CursorEntered,
    KeyPressed,
    KeyReleased,
    Modifiers,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
    WindowFocused,
    WindowResized,
)
from elys.editor_node.keys import Key
from elys.editor_node.window import Window

import glfw  # isort: skip  after the window's module, which loads ImGui's own


class Recorder:
    def __init__(self, name: str, log: list, *, consumes: type | tuple[type, ...] = ()) -> None:
        self.name, self.log, self.consumes = name, log, consumes

    def on_event(self, event) -> bool:
        self.log.append((self.name, event))
        return isinstance(event, self.consumes)

    def update(self, elapsed: float) -> None:
        self.log.append((self.name, "update"))


class CountingWindow(Window):
    """Tells how often the application looked for events: each time it could have drawn as well."""

    look_count = 0

    def poll(self) -> None:
        self.look_count += 1
        super().poll()

    async def looked_at(self, times: int = 4) -> None:
        """Returns after so many further looks."""
        goal = self.look_count + times
        while self.look_count < goal:
            await asyncio.sleep(0.001)


@pytest.fixture
def stacked():
    """Runs `await scenario(application, log)` with three layers, the middle one of which consumes keys."""

    def play(scenario) -> None:
        async def main() -> None:
            window = CountingWindow("test", (64, 64), null_platform=True)
            log: list = []
            try:
                application = Application(window)
                for name, consumes in (("bottom", ()), ("middle", KeyPressed), ("top", WindowResized)):
                    application.push_layer(Recorder(name, log, consumes=consumes))
                await scenario(application, log)
            finally:
                window.close()

        asyncio.run(main())

    return play


def test_events_go_from_the_top_down_until_one_consumes_them(stacked):
    async def scenario(application, log):
        moved, pressed, resized = MouseMoved(1.0, 2.0), KeyPressed(65), WindowResized(3, 4)
        assert not application.offer(moved)
        assert application.offer(pressed)
        assert application.offer(resized)
        assert log == [
            ("top", moved),
            ("middle", moved),
            ("bottom", moved),
            ("top", pressed),
            ("middle", pressed),
            ("top", resized),
        ]

    stacked(scenario)


def heard_from_glfw(window: Window, name: str):
    """The function that GLFW calls for events of a kind; it stays in its place."""
    setter = getattr(glfw, f"set_{name}_callback")
    callback = setter(window._window, None)
    setter(window._window, callback)
    return lambda *heard: callback(window._window, *heard)


def test_what_glfw_tells_goes_down_the_stack_and_stops_where_it_is_consumed(stacked):
    """A resize that GLFW makes itself; keys, buttons and the rest through the functions that were given to GLFW."""

    async def scenario(application, log):
        window = application.window
        heard_from_glfw(window, "cursor_pos")(3.0, 4.0)
        moved = MouseMoved(3.0, 4.0)
        assert log == [("top", moved), ("middle", moved), ("bottom", moved)]
        log.clear()
        heard_from_glfw(window, "key")(glfw.KEY_A, 38, glfw.PRESS, glfw.MOD_CONTROL)
        pressed = KeyPressed(glfw.KEY_A, Modifiers.CTRL, physical=glfw.KEY_A)
        assert log == [("top", pressed), ("middle", pressed)]  # the middle one consumes keys
        log.clear()
        glfw.set_window_size(window._window, 320, 200)
        window.poll()
        assert [(name, event) for name, event in log if isinstance(event, WindowResized)] == [
            ("top", WindowResized(320, 200))
        ]
        log.clear()
        for name, arguments, event in (
            ("key", (glfw.KEY_A, 38, glfw.RELEASE, 0), KeyReleased(glfw.KEY_A, Modifiers.NONE, physical=glfw.KEY_A)),
            ("mouse_button", (1, glfw.PRESS, 0), MousePressed(1, Modifiers.NONE)),
            ("mouse_button", (1, glfw.RELEASE, 0), MouseReleased(1, Modifiers.NONE)),
            ("scroll", (0.0, -1.0), MouseScrolled(0.0, -1.0)),
            ("char", (0x1F642,), CharacterTyped(0x1F642)),
            ("cursor_enter", (1,), CursorEntered(True)),
            ("window_focus", (1,), WindowFocused(True)),
        ):
            heard_from_glfw(window, name)(*arguments)
            assert log == [(layer, event) for layer in ("top", "middle", "bottom")], name
            log.clear()
        application.close()
        heard_from_glfw(window, "key")(glfw.KEY_UNKNOWN, 0, glfw.PRESS, 0)
        assert log == []

    stacked(scenario)


@pytest.mark.gl
def test_the_editors_layers_keep_what_is_theirs(at_the_editor):
    """What is typed into a widget is no shortcut, and what no widget wants is."""

    async def scenario(person):
        editor = person.editor
        kinds = [type(layer).__name__ for layer in editor.application.layers]
        assert kinds.index("ShortcutLayer") < kinds.index("ViewportLayer") < kinds.index("ImGuiLayer")
        press = heard_from_glfw(editor.window, "key")
        typed = heard_from_glfw(editor.window, "char")

        async def key(letter: str) -> None:
            press(ord(letter.upper()), 0, glfw.PRESS, 0)
            typed(ord(letter))
            await person.frames(2)
            press(ord(letter.upper()), 0, glfw.RELEASE, 0)
            await person.frames(2)

        await key("e")
        assert editor.ui.tools.tool == "rotate"
        await person.click("hierarchy/search")
        await person.frames(2)
        await key("r")
        assert editor.ui.tools.tool == "rotate" and editor.workspace.hierarchy._search == "r"
        await person.press(Key.ESCAPE)
        await person.press(Key.ESCAPE)
        await person.frames(2)
        await key("r")
        assert editor.ui.tools.tool == "scale"

    at_the_editor(scenario)


def test_frames_update_from_the_bottom_up(stacked):
    async def scenario(application, log):
        await application.run(frames=2)
        assert log == [(name, "update") for name in ("bottom", "middle", "top")] * 2

    stacked(scenario)


def test_a_layer_may_leave_while_it_hears(stacked):
    async def scenario(application, log):
        class Leaver(Recorder):
            def on_event(self, event) -> bool:
                application.pop_layer(self)
                return super().on_event(event)

        application.push_layer(Leaver("leaver", log))
        application.offer(MouseMoved(0.0, 0.0))
        application.offer(MouseMoved(1.0, 1.0))
        assert [name for name, _ in log] == ["leaver", "top", "middle", "bottom", "top", "middle", "bottom"]

    stacked(scenario)


def test_frames_come_only_when_they_are_asked_for(stacked):
    async def scenario(application, log):
        running = asyncio.create_task(application.run())
        await application.window.looked_at()
        assert application.frame_count == 1  # the first, and then nobody asked
        application.request_redraw()
        await application.window.looked_at()
        assert application.frame_count == 2
        application.request_redraw(within=300.0)
        await application.window.looked_at()
        assert application.frame_count == 2
        application.close()
        await running

    stacked(scenario)


def test_closing_may_be_put_off(stacked):
    async def scenario(application, log):
        answers = [False, True]
        application.on_close = lambda: answers.pop(0)
        application.window.request_close()
        await application.run(frames=1)
        assert answers == [True]
        application.window.request_close()
        await application.run(frames=1)
        assert answers == [] and application.frame_count == 1

    stacked(scenario)
