"""The stack of layers: who hears what, in which order, and when frames are drawn."""

from __future__ import annotations

import asyncio

import pytest

from elys.editor_node.application import Application
from elys.editor_node.events import KeyPressed, MouseMoved, WindowResized
from elys.editor_node.window import Window


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
