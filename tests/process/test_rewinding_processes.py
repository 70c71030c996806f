"""A real simulation in a process of its own, rewound by the editor's model over zenoh: the same bits again, then a fork."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

import pytest

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.messages.session import Event
from elys.bus.messages.state_frame import StateFrame
from elys.editor_node.model import EditorModel

pytestmark = pytest.mark.process


class Desk:
    """An editor's model in a session, with all that it hears."""

    def __init__(self, model: EditorModel) -> None:
        self.model = model
        self.frames: list[StateFrame] = []
        self.events: list[Event] = []
        model.session.subscribe(topics.STATE, lambda frame, _: self.frames.append(frame))
        model.session.subscribe(topics.EVENTS, lambda batch, _: self.events.extend(batch.events))

    @property
    def status(self):
        return self.model.status

    async def until(self, condition) -> None:
        async with asyncio.timeout(60.0):
            while not condition():
                await asyncio.sleep(0.005)

    async def paused(self) -> int:
        """Pauses, and the tick at which it stands."""
        self.model.toggle_playing()
        await self.until(lambda: not self.status.playing and self.frames[-1].tick == self.status.tick)
        return self.status.tick

    def is_at(self, tick: int) -> bool:
        return self.status.tick == tick and self.frames[-1].tick == tick


@contextlib.asynccontextmanager
async def at_a_desk(endpoint: str) -> AsyncIterator[Desk]:
    session = await join_session(endpoint, kind="editor", timeout=30)
    model = EditorModel(session)
    running = asyncio.create_task(model.run())
    desk = Desk(model)
    try:
        await desk.until(lambda: model.scene.is_known and model.status is not None)
        yield desk
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await session.close()


def test_two_seconds_back_the_same_again_and_another_future(elys, free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "yard", "--headless", "--realtime", "--paused", "--listen", endpoint).wait_for("simulating")

    async def scenario() -> None:
        async with at_a_desk(endpoint) as desk:
            model, line = desk.model, desk.model.timeline
            assert not line.can_wind
            model.toggle_playing()
            await desk.until(lambda: desk.frames and desk.frames[-1].tick > 200)
            newest = await desk.paused()
            first = {frame.tick: frame.state_hash for frame in desk.frames}
            back = newest - 120
            line.go_to(back / 60)
            await desk.until(lambda: desk.is_at(back))
            assert line.is_rewound
            assert desk.frames[-1].state_hash == first.get(back, desk.frames[-1].state_hash)
            model.step(-1)
            await desk.until(lambda: desk.is_at(back - 1))
            desk.frames.clear()
            model.toggle_playing()
            await desk.until(lambda: desk.frames and desk.frames[-1].tick >= newest)
            await desk.paused()
            again = {frame.tick: frame.state_hash for frame in desk.frames}
            common = again.keys() & first.keys()
            assert len(common) > 60
            assert {tick: again[tick] for tick in common} == {tick: first[tick] for tick in common}
            assert not desk.events or all(event.kind != "forked" for event in desk.events)
            # Another future: one box is thrown.
            line.go_to(back / 60)
            await desk.until(lambda: desk.is_at(back))
            box = next(entity.id for entity in model.scene.mirror.entities.values() if entity.name == "Box 8")
            model.edit.set_fields([box], "RigidBody", {"linear_velocity": (0.0, 30.0, 0.0)})
            await desk.until(lambda: any(event.kind == "forked" for event in desk.events))
            await desk.until(lambda: not line.is_rewound and line.span[1] < newest / 60)
            desk.frames.clear()
            model.toggle_playing()
            await desk.until(lambda: desk.frames and desk.frames[-1].tick >= newest)
            other = {frame.tick: frame.state_hash for frame in desk.frames}
            common = {tick for tick in other.keys() & first.keys() if tick > back}
            assert common and all(other[tick] != first[tick] for tick in common)
            line.ask_for_markers()
            await desk.until(lambda: any(marker.text == "forked" for marker in line.markers))
            assert any(marker.kind == "edit" and marker.entity == box for marker in line.markers)

    asyncio.run(scenario())
