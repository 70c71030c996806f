"""Hands at a keyboard: four keys and the space bar, pressed as slowly as people do, for where a driver wants to go."""

from __future__ import annotations

import itertools
import math
from collections import deque

import numpy as np

from elys.bus.messages.commands import Input
from elys.common.components import RigidBody
from elys.game.bot import Bot
from elys.game.driver import DEAD_ZONE, TOP_SPEED, Style
from elys.samples.game.levels import Layout
from elys.sim_node.simulation import Simulation

INTERVAL = 5  # ticks between two decisions: twelve a second
REACTION = 3  # ticks after what is seen
GRIP, RESPONSE, ROLLS_OUT = 13.0, 1.8, 0.35  # of ball.py
CAREFUL = Style(pace=0.85, cornering=7.0, braking=6.0)
KEYS = {(-1, 0): "a", (1, 0): "d", (0, -1): "s", (0, 1): "w"}


class KeyboardHands:
    """What a bot would do with a stick, done with keys: those whose push is nearest to the one wanted."""

    def __init__(self, simulation: Simulation, layout: Layout) -> None:
        self._simulation = simulation
        self._bot = Bot(simulation, layout, style=CAREFUL)
        self._seen: deque[tuple[np.ndarray, np.ndarray, bool]] = deque(maxlen=REACTION + 1)
        self._held: set[str] = set()

    def __call__(self) -> Input | None:
        """What changes before the next step."""
        for request in self._bot():
            stick = np.array([request.command.axes["pad_left_x"], -request.command.axes["pad_left_y"]])
            length = float(np.linalg.norm(stick))
            wanted = TOP_SPEED * max(length - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE) * stick / max(length, 1e-9)
            self._seen.append((wanted, self._velocity(), self._bot._driver._jumps))
        if not self._seen or self._simulation.tick % INTERVAL:
            return None
        now = self._chosen(*self._seen[0])
        changes = tuple((key, key in now) for key in sorted(now ^ self._held))
        self._held = now
        return Input(player=1, source="keyboard", changes=changes)

    def _velocity(self) -> np.ndarray:
        """Of the ball, to the right and ahead as the camera sees it [m/s]."""
        world = self._simulation.world
        x, y, z, w = world.transforms.world_pose(self._bot._camera)[1]
        heading = math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
        vx, _, vz = world.get(self._bot._ball, RigidBody).linear_velocity
        sine, cosine = math.sin(heading), math.cos(heading)
        return np.array([cosine * vx - sine * vz, -sine * vx - cosine * vz])

    def _chosen(self, wanted: np.ndarray, velocity: np.ndarray, jumps: bool) -> set[str]:
        asked = _limited((wanted - velocity) * 4.0)

        def miss(push: tuple[int, int]) -> float:
            direction = np.array(push) / max(math.hypot(*push), 1.0)
            got = _limited((direction * TOP_SPEED - velocity) * RESPONSE) if any(push) else -ROLLS_OUT * velocity
            return float(np.linalg.norm(got - asked))

        aside, ahead = min(itertools.product((-1, 0, 1), repeat=2), key=miss)
        keys = {KEYS[push] for push in ((aside, 0), (0, ahead)) if any(push)}
        return keys | {"space"} if jumps else keys


def _limited(vector: np.ndarray) -> np.ndarray:
    return vector * min(1.0, GRIP / max(float(np.linalg.norm(vector)), 1e-9))
