"""Somebody at `elys view --thin`, on GLFW's null platform: `thin_player.py ENDPOINT`.

What is to be done comes as lines, and so does what came of it:

turn N          N movements of the camera   -> turned MEDIAN_MS
pick            a click in the middle       -> picked NAME ...
play KEY        P, then a key is held       -> played APPLIED_MS SEEN_MS
resize W H      another size of the window  -> pictures of W H, a keyframe or not
encoding        by which way pictures come  -> encoding NAME SCALE
"""

from __future__ import annotations

import asyncio
import math
import sys
from statistics import median

from elys.bus.discovery import join_session
from elys.bus.log import start_logging
from elys.common.input_names import KEY_NAMES
from elys.render_node import thin_window
from elys.render_node.window import (
    Clicked,
    Dragged,
    KeyPressed,
    glfw,
)  # of those there may be, the one that can draw here

made: list[thin_window._ThinViewer] = []


class Watched(thin_window._ThinViewer):
    """Known to this program."""

    def __init__(self, *arguments, **options) -> None:
        super().__init__(*arguments, **options)
        made.append(self)


thin_window._ThinViewer = Watched


async def until(condition) -> None:
    while not condition():
        await asyncio.sleep(0.002)


async def turn(viewer, count: int) -> str:
    taken = []
    for _ in range(count):
        viewer._hand.clear()
        viewer._on_event(Dragged("left", 0.01, 0.0))
        await until(lambda: viewer._hand)
        taken.append(viewer._hand[-1])
    return f"turned {median(taken) * 1e3:.1f}"


async def pick(viewer) -> str:
    viewer._picked = ""
    viewer._on_event(Clicked(0.5, 0.5))
    await until(lambda: viewer._picked)
    return f"picked {viewer._picked}"


async def play(viewer, key: str) -> str:
    code = next(code for code, name in KEY_NAMES.items() if name == key)
    echo = viewer._game._echo
    while len(echo._until_seen) < 10:
        if not viewer._game.is_on:  # not yet, or given back by a host that was not heard for a while
            viewer._on_event(KeyPressed("p"))
        for action in (glfw.PRESS, glfw.RELEASE):
            viewer._window._key(None, code, 0, action, 0)
            await asyncio.sleep(0.1)
    return f"played {echo.until_applied * 1e3:.1f} {echo.until_seen * 1e3:.1f}"


async def resize(viewer, width: int, height: int) -> str:
    glfw.set_window_size(viewer._window._window, width, height)
    await until(lambda: viewer._picture.pixels.shape[:2] == (height, width))
    return f"pictures of {width} {height} {viewer._picture.frame.keyframe}"


async def answer(viewer, words: list[str]) -> str:
    match words:
        case ["turn", count]:
            return await turn(viewer, int(count))
        case ["pick"]:
            return await pick(viewer)
        case ["play", key]:
            return await play(viewer, key)
        case ["resize", width, height]:
            return await resize(viewer, int(width), int(height))
        case ["encoding"]:
            return f"encoding {viewer._remote.encoding} {viewer._remote.scale:g}"
    return f"unknown {words}"


async def main(endpoint: str) -> None:
    session = await join_session(endpoint, kind="tool", timeout=20.0)
    viewing = asyncio.create_task(thin_window.run_thin_view(session, age=True, endpoint=endpoint))
    await until(lambda: (made and made[0]._picture is not None) or viewing.done())
    print("picture", *made[0]._picture.pixels.shape, flush=True)
    # Round the middle of things, wherever the scene is seen from at first.
    assert math.isfinite(made[0]._distance)
    loop = asyncio.get_running_loop()
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        print(await answer(made[0], line.split()), flush=True)
    viewing.cancel()
    await asyncio.gather(viewing, return_exceptions=True)
    await session.close()


if __name__ == "__main__":
    start_logging()
    asyncio.run(main(sys.argv[1]))
