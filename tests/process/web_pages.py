"""A real browser at a real `elys web`: Chromium without a window, driven as a hand and a keyboard would."""

from __future__ import annotations

import asyncio
import base64
import concurrent.futures
import contextlib
import io
import os
import shutil
import socket
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from PIL import Image

from tests.process.clients import Client, client
from tests.process.conftest import Command

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 30.0  # [s] far beyond what anything here takes; a failure, not a measure
T = TypeVar("T")


def chromium() -> str:
    """Where the browser is: ELYS_CHROMIUM, or on the path. Skips where there is none."""
    found = os.environ.get("ELYS_CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), "")
    if not found:
        pytest.skip("there is no Chromium here: apt install chromium, or name one with ELYS_CHROMIUM")
    return found


@contextlib.contextmanager
def open_browser() -> Iterator[Any]:
    """A Chromium of playwright's."""
    driver = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install playwright")
    path = chromium()
    with driver.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


class Page:
    """A page of the web node, and what a person sees on it."""

    def __init__(self, context: Any) -> None:
        self.tab = context.new_page()
        self.said: list[str] = []  # errors and warnings of the browser's console
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("console", lambda line: line.type in ("error", "warning") and self.said.append(line.text))

    def until(self, condition: Callable[[], Any], *, seconds: float = PATIENCE) -> Any:
        """Waits for a condition and returns what it gave; fails with what the page shows when it does not come true."""
        deadline = time.monotonic() + seconds
        while not (found := condition()):
            if time.monotonic() > deadline:
                pytest.fail(f"it did not come true; the page shows: {self.tab.inner_text('body')!r}; {self.said}")
            self.tab.wait_for_timeout(20)  # the browser tells us nothing: there is nothing to wait on but the clock
        return found

    def text(self, selector: str) -> str:
        return str(self.tab.inner_text(selector)) if self.tab.is_visible(selector) else ""

    def picture_of(self, selector: str = "#picture") -> np.ndarray:
        """The pixels of an element as it is seen: (H, W, 3)."""
        return np.asarray(Image.open(io.BytesIO(self.tab.locator(selector).screenshot())).convert("RGB")).astype(int)

    def wait_for_picture(self) -> None:
        """Until there is one: a canvas that has drawn nothing is black."""
        self.until(lambda: self.canvas().max() > 0)

    def canvas(self) -> np.ndarray:
        """The pixels that were drawn, without what lies over them: (H, W, 3)."""
        code = self.tab.evaluate("document.getElementById('picture').toDataURL('image/png')")
        picture = Image.open(io.BytesIO(base64.b64decode(code.partition(",")[2])))
        return np.asarray(picture.convert("RGB")).astype(int)

    def rest(self) -> np.ndarray:
        """The pixels that were drawn, once they stay what they are while the browser draws some more frames."""

        def two() -> tuple[np.ndarray, np.ndarray]:
            before = self.canvas()
            self.tab.wait_for_timeout(500)
            return before, self.canvas()

        self.until(lambda: np.array_equal(*two()))
        return self.canvas()

    def point(self, x: float, y: float) -> tuple[float, float]:
        """A place of the view, by shares of its width and height, as the mouse needs it."""
        box = self.tab.locator("#picture").bounding_box()
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """With the left button over the view, by shares of its width and height."""
        self.tab.mouse.move(*self.point(*start))
        self.tab.mouse.down()
        self.tab.mouse.move(*self.point(*end), steps=6)
        self.tab.mouse.up()

    @property
    def tick(self) -> int:
        """As the clock tells it; -1 before it does."""
        words = self.text("#clock").split()
        return int(words[-1]) if words and words[-1].isdecimal() else -1


class Served:
    """Commands that belong together, in a runtime directory of their own: a host, and `elys web` beside it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "runtime").mkdir()
        hidden = {"DISPLAY", "WAYLAND_DISPLAY"}
        kept = {name: value for name, value in os.environ.items() if name not in hidden}
        self._environment = {**kept, "ELYS_RUNTIME_DIR": str(folder / "runtime"), "PYTHONUNBUFFERED": "1"}
        self._started: list[Command] = []
        self.endpoint = f"tcp/127.0.0.1:{unused_port()}"
        self.addresses: dict[str, str] = {}  # by what they are for: watch, play, edit

    def start(self, *words: str | Path) -> Command:
        command = Command(tuple(map(str, words)), self._environment, self.folder)
        self._started.append(command)
        return command

    def host(self, *words: str | Path, says: str = "simulating") -> Command:
        """A host at the endpoint."""
        command = self.start(*words, "--listen", self.endpoint)
        command.wait_for(says, seconds=120)
        return command

    def serve(self, *words: str) -> Command:
        """A render node and the web node."""
        self.start("node", "render", "--connect", self.endpoint).wait_for("drawing views")
        command = self.start("web", "--connect", self.endpoint, "--port", str(unused_port()), *words)
        command.wait_for("to edit|for everybody")
        for line in command.lines:
            for what in ("watch", "play", "edit"):
                if line.strip().startswith(f"to {what}"):
                    self.addresses[what] = line.split()[-1]
        return command

    @property
    def url(self) -> str:
        """Without any secret."""
        return self.addresses["watch"].partition("#")[0]

    def ask(self, question: Callable[[Client], Awaitable[T]]) -> T:
        """What another node of the session finds out, in a thread of its own: the browser's driver has a loop in this one."""

        async def work() -> T:
            async with client(self.endpoint) as joined:
                return await question(joined)

        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            return pool.submit(asyncio.run, work()).result(60)

    def end(self) -> None:
        for command in reversed(self._started):
            command.end()


def component_of(served: Served, entity: str, component: str) -> Any:
    """As another node of the session has it."""

    async def look(joined: Client) -> Any:
        return joined.mirror.entities[joined.entity(entity)].components[component]

    return served.ask(look)


def names_of(served: Served) -> Sequence[str]:
    """Of all entities, as another node of the session has them."""

    async def look(joined: Client) -> list[str]:
        return [entity.name for entity in joined.mirror.in_order()]

    return served.ask(look)


def unused_port() -> int:
    """A port of loopback that nobody uses now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
