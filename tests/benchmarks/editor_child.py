"""A real editor without a display that does what its standard input says, line by line, and answers each line with one of JSON.

python -m tests.benchmarks.editor_child

    attach ENDPOINT   joins the session there; answers when its scene is known
    detach            leaves it
    begin             forgets the frames and the processor time until now
    report            tells of both since `begin`
    rest              turns it no more
    turn              turns the camera a little in each frame from now on, as somebody does who looks around
    end               closes the window
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from typing import Any

from elys.common.garbage import keep_searches_short
from elys.editor_node.events import Event
from elys.editor_node.node import Editor


class FrameClock:
    """A layer that notes when frames are drawn, and turns the camera if it shall."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.turns = False
        self.times: list[float] = []  # [s]

    def on_event(self, event: Event) -> bool:
        """Leaves it to others."""
        return False

    def update(self, elapsed: float) -> None:
        """Notes a frame."""
        self.times.append(time.monotonic())
        if self.turns:
            self._editor.panel.camera.orbit(2.0, 0.0)
            self._editor.application.keep_awake(1.0)


class Child:
    """Does what it is told."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self._clock = FrameClock(editor)
        self._began = (0.0, 0.0, 0.0)
        editor.application.push_layer(self._clock)

    async def follow(self) -> None:
        """Reads lines until the last one."""
        lines = asyncio.StreamReader()
        loop = asyncio.get_running_loop()
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
        print(json.dumps("ready"), flush=True)
        while line := (await lines.readline()).decode().split():
            answer = await self._do(*line)
            print(json.dumps(answer), flush=True)
            if line[0] == "end":
                break
        self._editor.application.close()

    async def _do(self, word: str, *words: str) -> Any:
        editor = self._editor
        match word:
            case "attach":
                editor.attachments.connect(words[0])
                while not editor.model.connected or not editor.model.scene.is_known:
                    await asyncio.sleep(0.01)
            case "detach":
                editor.attachments.detach()
            case "turn":
                self._clock.turns = True
                editor.application.keep_awake(1.0)
            case "rest":
                self._clock.turns = False
                await asyncio.sleep(2.0)  # what was asked for until now is drawn
            case "begin":
                self._clock.times.clear()
                self._began = (time.monotonic(), time.process_time(), time.thread_time())
            case "report":
                wall, process, thread = self._began
                return {
                    "seconds": time.monotonic() - wall,
                    "process": time.process_time() - process,
                    "main_thread": time.thread_time() - thread,
                    "frames": self._clock.times,
                    "entities": len(editor.model.scene.mirror.entities),
                }
        return word


async def main() -> None:
    """Opens the window and listens."""
    with Editor(null_platform=True, size=(1280, 720)) as editor:
        async with asyncio.TaskGroup() as group:
            group.create_task(editor.run())
            group.create_task(Child(editor).follow())


if __name__ == "__main__":
    keep_searches_short()
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    if core := os.environ.get("ELYS_BENCH_CORE"):
        os.sched_setaffinity(0, {int(core)})
    asyncio.run(main())
