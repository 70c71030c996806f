"""A player without a window: `pad_player.py ENDPOINT PLAYER BINDINGS`. What the pad does is told on its input, a line each.

play              begins to play, with the bindings of the file
stick X Y         the left stick is pushed so far
press NAME...     these buttons are down, and no others
leave             plays no more
"""

from __future__ import annotations

import asyncio
import logging
import sys
from pathlib import Path
from typing import NamedTuple

from elys.bus.discovery import join_session
from elys.bus.local_players import LocalPlayers
from elys.common.input_bindings import FollowedBindings
from elys.common.input_names import PAD_NAMES


class State(NamedTuple):
    """As GLFW tells it."""

    buttons: list[int]
    axes: list[float]


async def main(endpoint: str, player: int, bindings: Path) -> None:
    session = await join_session(endpoint, kind="viewer", timeout=20)
    players = LocalPlayers(session, player=player, bindings=FollowedBindings(bindings))
    pad = State([0] * len(PAD_NAMES), [0.0, 0.0, 0.0, 0.0, -1.0, -1.0])
    print(f"joined {session.node.id}", flush=True)
    try:
        while line := (await asyncio.to_thread(sys.stdin.readline)).split():
            match line:
                case ["play"]:
                    players.start({0: pad})
                case ["stick", x, y]:
                    pad.axes[:2] = float(x), float(y)
                case ["press", *names]:
                    pad.buttons[:] = [int(name in names) for name in PAD_NAMES]
                case ["leave"]:
                    players.stop()
            players.update({0: pad})
            players.send()
            print(f"did {' '.join(line)}", flush=True)
    finally:
        await session.close()


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stdout)
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])))
