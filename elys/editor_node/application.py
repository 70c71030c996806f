"""The Application: a window and a stack of layers.

Events go down the stack, from the top layer, until one of them consumes it; each frame updates the layers in order, from the
bottom up. A frame is only drawn when something asked for it: an input, new data from the bus or an animation.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import Callable
from typing import Final, Protocol

from elys.editor_node.events import Event
from elys.editor_node.window import Window

FRAME_INTERVAL: Final = 1 / 60  # [s] shortest time between two frames
POLL_INTERVAL: Final = 1 / 60  # [s] between two looks at the window's events while something goes on
POLL_INTERVAL_IDLE: Final = 1 / 30  # [s] the same when nobody has touched anything for a while
POLL_INTERVAL_UNFOCUSED: Final = 1 / 15  # [s] the same while another window has the keyboard
AWAKE_AFTER_INPUT: Final = 0.6  # [s] of frames after an input: hover delays and tooltips come late


class Layer(Protocol):
    """One storey of the application."""

    def on_event(self, event: Event) -> bool:
        """Hears an event; True consumes it, and no layer below hears of it."""

    def update(self, elapsed: float) -> None:
        """Takes part in a frame, `elapsed` seconds after the last one."""


class Application:
    """Runs the layers on the asyncio loop it is started from."""

    def __init__(self, window: Window, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.window = window
        self.layers: list[Layer] = []
        self.frame_count = 0
        self.frame_time = 0.0  # [s] that the last frame took to build
        self.listened = (
            0.0  # [s] in which whoever types or clicks was heard: without the work that took long in between
        )
        self.on_close: Callable[[], bool] = lambda: True  # False: not yet, something is to be asked first
        self._clock = clock
        self._wake = asyncio.Event()
        self._redraw_at = 0.0
        self._awake_until = 0.0
        self._last_frame = -math.inf
        self._looked_at = clock()
        self.is_closing = False  # `run` ends before the next frame
        window.on_event = self.offer

    def push_layer(self, layer: Layer) -> None:
        """Puts a layer on top."""
        self.layers.append(layer)

    def pop_layer(self, layer: Layer) -> None:
        """Takes a layer away; ValueError if it is not in the stack."""
        self.layers.remove(layer)

    def offer(self, event: Event) -> bool:
        """Offers an event from the top layer down; True when one of them consumed it."""
        self.keep_awake(AWAKE_AFTER_INPUT)
        # A copy: a layer may push or pop layers when it hears of something.
        return any(layer.on_event(event) for layer in reversed(self.layers.copy()))

    def request_redraw(self, within: float = 0.0) -> None:
        """Asks for a frame at most `within` seconds from now. May be called as often as one likes."""
        self._redraw_at = min(self._redraw_at, self._clock() + within)
        self._wake.set()

    def keep_awake(self, duration: float) -> None:
        """Asks for frames without a pause for `duration` seconds."""
        self._awake_until = max(self._awake_until, self._clock() + duration)
        self.request_redraw()

    def close(self) -> None:
        """Ends `run` before the next frame."""
        self.is_closing = True
        self._wake.set()

    async def run(self, *, frames: int | None = None) -> None:
        """Draws until the window is closed, or exactly `frames` frames without waiting for a reason."""
        drawn = 0
        while not self._is_closed() and (frames is None or drawn < frames):
            self._look()
            if frames is not None or self._is_due():
                self.draw_frame()
                drawn += 1
            await self._wait(within=0.0 if frames is not None else None)

    def draw_frame(self) -> None:
        """Updates the layers in order and shows what they drew."""
        start = self._clock()
        elapsed = min(start - self._last_frame, 0.1) if self._last_frame > -math.inf else FRAME_INTERVAL
        self._last_frame = start
        self._redraw_at = start if start < self._awake_until else math.inf
        for layer in self.layers.copy():
            layer.update(elapsed)
        self.window.swap()
        self.frame_time = self._clock() - start
        self.frame_count += 1

    def _look(self) -> None:
        """Hears what happened at the window since the last look."""
        now = self._clock()
        # No two looks are meant to be further apart: what is beyond that was spent on a frame, or by other programs.
        self.listened += min(now - self._looked_at, POLL_INTERVAL_UNFOCUSED)
        self._looked_at = now
        self.window.poll()

    def _is_due(self) -> bool:
        return self.window.is_visible and self._clock() >= max(self._redraw_at, self._last_frame + FRAME_INTERVAL)

    def _is_closed(self) -> bool:
        if self.window.is_closing and not self.is_closing:
            if self.on_close():
                self.is_closing = True
            else:
                self.window.request_close(False)
                self.request_redraw()
        return self.is_closing

    def _poll_interval(self, now: float) -> float:
        if now < self._awake_until:
            return POLL_INTERVAL
        return POLL_INTERVAL_IDLE if self.window.is_focused else POLL_INTERVAL_UNFOCUSED

    async def _wait(self, *, within: float | None = None) -> None:
        """Until a frame may be due, or the window may have something to say."""
        now = self._clock()
        if within is None:
            due = max(self._redraw_at, self._last_frame + FRAME_INTERVAL)
            within = max(0.0, min(due - now, self._poll_interval(now)))
        self._wake.clear()
        if within == 0.0:
            await asyncio.sleep(0)
            return
        # A request that comes before the next frame may be drawn must not spin the loop: sleep first, hear requests then.
        until_next = self._last_frame + FRAME_INTERVAL - now
        if until_next > 0.0:
            await asyncio.sleep(min(until_next, within))
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within):
                await self._wake.wait()
