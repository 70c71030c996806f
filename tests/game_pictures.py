"""Pictures of playing: the levels in the middle of races; the card of controls in a viewer's window, as it is worked by keys."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from elys.render_node.game_input import GameInput, Seating
from elys.samples.game.levels import LEVELS
from elys.verbs.nodes import joined
from elys.verbs.render import render
from tests.unit.game.hosted_races import Hands, raced

BOUND = {"use": "r, pad_x"}  # of this player's own
KEYS = ("DOWN", "DOWN", "DOWN", "ENTER", "R")  # the jump's

SEEN = {"meadow": 8.6, "quarry": 13.0, "skyline": 5.6}  # [s] of simulation


def draw_game(folder: Path) -> None:
    """Each level, driven by one who has lost half a second, and is behind his ghost."""

    def half_asleep(tick: int) -> tuple[str, ...] | None:
        return () if 150 <= tick < 180 else None

    for name, time in SEEN.items():
        with tempfile.TemporaryDirectory() as fast, tempfile.TemporaryDirectory() as slow:
            ghost, race = (_race(name, Path(place), hands) for place, hands in ((fast, None), (slow, half_asleep)))
            path = folder / f"game-{name}.png"
            render(
                str(race), path, size="1280x720", time=time, duration=0.0, fps=30.0, camera="Camera 1", ghosts=[ghost]
            )


def _race(name: str, folder: Path, hands: Hands | None) -> Path:
    """The recording of a race driven by a bot."""
    referee = asyncio.run(raced(LEVELS[name], folder, hands=hands or (lambda tick: None)))
    return referee.board.path_of(referee.board.entries[0])


async def draw_controls(path: Path, endpoint: str) -> None:
    """The window of somebody who plays in a session, and binds a key that has something to do already."""
    import glfw

    from elys.render_node import view_window
    from elys.render_node.offline import save_picture
    from elys.render_node.window import Window

    made: list[Window] = []

    class Watched(Window):
        """Keeps its last picture."""

        def __init__(self, title: str) -> None:
            super().__init__(title, (1280, 720))
            made.append(self)

        def swap(self) -> None:
            from elys.render_node.gpu import Framebuffer

            self.pixels = Framebuffer.of_window(games[0][1], *self.framebuffer_size).read()
            super().swap()

    games: list[tuple[GameInput, object]] = []
    viewer, window_class = view_window._Viewer, view_window.Window

    class Seen(viewer):  # type: ignore[misc, valid-type]
        """Tells its game."""

        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)
            games.append((self._game, self._renderer.context))

    view_window.Window, view_window._Viewer = Watched, Seen  # type: ignore[misc]
    try:
        async with joined(endpoint, kind="viewer") as session:
            seating = Seating(bindings=lambda player: BOUND, plays_at_once=True)
            seen = asyncio.create_task(view_window.run_view(session, seating=seating))

            async def until(is_so: Callable[[], bool]) -> None:
                while not is_so():
                    if seen.done():
                        await seen
                    await asyncio.sleep(0.02)

            def press(key: str) -> None:
                number = getattr(glfw, f"KEY_{key}")
                made[0]._key(None, number, 0, glfw.PRESS, 0)
                made[0]._key(None, number, 0, glfw.RELEASE, 0)

            await until(lambda: bool(games) and games[0][0].is_on)
            await asyncio.sleep(2.0)
            press("F1")
            await until(lambda: games[0][0].card_version >= 0)
            for key in KEYS:
                press(key)
            await asyncio.sleep(1.0)
            save_picture(path, np.ascontiguousarray(made[0].pixels[::-1, :, :3]))  # type: ignore[attr-defined]
            made[0].request_close()
            await seen
    finally:
        view_window.Window, view_window._Viewer = window_class, viewer  # type: ignore[misc]
    print(path)
