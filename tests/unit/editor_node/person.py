"""Somebody at the editor: what a person does with it, on a window without a display."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

import pytest
from imgui_bundle import imgui

from elys.bus.session import Session
from elys.editor_node.events import (
    CharacterTyped,
    CursorEntered,
    KeyPressed,
    KeyReleased,
    Modifiers,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
)
from elys.editor_node.keys import Key

if TYPE_CHECKING:
    from elys.editor_node.node import Editor

CTRL, SHIFT, ALT = Modifiers.CTRL, Modifiers.SHIFT, Modifiers.ALT
_FOLLOWED = 10  # times that the pointer goes after something that moves
_KEY_OF = {CTRL: Key.LEFT_CTRL, SHIFT: Key.LEFT_SHIFT, ALT: Key.LEFT_ALT}


class Person:
    """Does with the editor what a person does, and waits until it was drawn."""

    def __init__(self, editor: Editor, stage) -> None:
        self.editor = editor
        self.stage = stage
        self.application = editor.application
        editor.ui.landmarks.is_wanted = True

    async def frames(self, count: int = 2) -> None:
        goal = self.application.frame_count + count
        self.application.keep_awake(5.0)
        async with asyncio.timeout(20.0):
            while self.application.frame_count < goal:
                await asyncio.sleep(0.001)

    async def until(self, condition) -> None:
        self.application.keep_awake(5.0)
        await self.stage.until(condition)

    async def do(self, *events) -> None:
        for event in events:
            self.application.offer(event)
            await self.frames(1)
        await self.frames(1)

    async def point(self, name: str) -> None:
        await self.until(lambda: name in self.editor.ui.landmarks.rectangles)
        for _ in range(_FOLLOWED):
            place = self.editor.ui.landmarks.center(name)
            await self.do(MouseMoved(*place))
            if self.editor.ui.landmarks.rectangles.get(name) is None or self.editor.ui.landmarks.center(name) == place:
                break  # windows that fit themselves to their text take their places late

    async def click(self, name: str, *, times: int = 1, held: Modifiers = Modifiers.NONE) -> None:
        await self.point(name)
        if held:
            await self.do(KeyPressed(_KEY_OF[held], held))
        io = imgui.get_io()
        patience = io.mouse_double_click_time, io.mouse_single_click_delay
        for _ in range(times):
            await self.do(MousePressed(MouseButton.LEFT, held), MouseReleased(MouseButton.LEFT, held))
            # However slowly frames are drawn here, the next one makes it a double click.
            io.mouse_double_click_time, io.mouse_single_click_delay = 60.0, 61.0
        io.mouse_double_click_time, io.mouse_single_click_delay = patience
        if held:
            await self.do(KeyReleased(_KEY_OF[held]))

    async def double_click_here(self) -> None:
        """Where the pointer is."""
        io = imgui.get_io()
        patience = io.mouse_double_click_time, io.mouse_single_click_delay
        for _ in range(2):
            await self.do(MousePressed(MouseButton.LEFT), MouseReleased(MouseButton.LEFT))
            io.mouse_double_click_time, io.mouse_single_click_delay = 60.0, 61.0
        io.mouse_double_click_time, io.mouse_single_click_delay = patience

    async def right_click(self, name: str) -> None:
        await self.point(name)
        await self.do(MousePressed(MouseButton.RIGHT), MouseReleased(MouseButton.RIGHT))

    async def press(self, key: int, held: Modifiers = Modifiers.NONE) -> None:
        keys = [_KEY_OF[modifier] for modifier in held]
        await self.do(*(KeyPressed(k) for k in keys), KeyPressed(key, held), KeyReleased(key, held))
        await self.do(*(KeyReleased(k) for k in keys))

    async def type(self, text: str) -> None:
        await self.do(*(CharacterTyped(ord(letter)) for letter in text))

    async def drag(self, name: str, x: float, y: float, *, steps: int = 6, held: Modifiers = Modifiers.NONE) -> None:
        await self.point(name)
        start_x, start_y = self.editor.ui.landmarks.center(name)
        await self.do(MousePressed(MouseButton.LEFT, held))
        for step in range(1, steps + 1):
            await self.do(MouseMoved(start_x + x * step / steps, start_y + y * step / steps))
        await self.do(MouseReleased(MouseButton.LEFT, held))

    async def drag_onto(self, name: str, target: str) -> None:
        """Drags a widget to the middle of another one."""
        await self.point(name)
        start, end = (self.editor.ui.landmarks.center(which) for which in (name, target))
        await self.drag(name, end[0] - start[0], end[1] - start[1])


@contextlib.asynccontextmanager
async def person_at(editor: Editor, stage) -> AsyncIterator[Person]:
    """Somebody whose pointer is over an editor that runs meanwhile; the editor is closed at the end."""
    running = asyncio.create_task(editor.run())
    person = Person(editor, stage)
    await person.do(CursorEntered(True))
    try:
        yield person
    finally:
        editor.application.close()
        await running


@pytest.fixture
def at_the_editor(on_stage):
    """Runs `await scenario(person)` at an editor that shows the yard."""

    def play(scenario, records=None) -> None:
        from elys.editor_node.node import Editor  # the tests of the model need no ImGui

        async def with_editor(stage):
            session = await Session.join(stage.broker.connect(), kind="editor")
            try:
                with Editor(session, null_platform=True, size=(1600, 900)) as editor:
                    async with person_at(editor, stage) as person:
                        await person.until(lambda: editor.model.scene.is_known)
                        stage.host.publish_status()
                        await person.frames(3)
                        await scenario(person)
            finally:
                await session.close()

        on_stage(with_editor, records)

    return play
