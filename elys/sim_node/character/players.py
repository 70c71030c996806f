"""From keys and pointer to wishes: who drives a character, and the camera that looks after it.

This is the one place that knows which keys those are.
"""

from __future__ import annotations

import numpy as np

from elys.common.components import CameraRig, Character
from elys.sim_node.character.kernels import turn_views
from elys.sim_node.ecs.columns import ComponentTable
from elys.sim_node.ecs.world import World
from elys.sim_node.inputs import Inputs, PlayerInput

FORWARD, BACK, LEFT, RIGHT = ("w", "up"), ("s", "down"), ("a", "left"), ("d", "right")
RUN, JUMP, CROUCH, FLY, LOOK = ("left_shift",), ("space",), ("left_control", "c"), "f", "v"
_WALK, _FLY = 0, 2  # as the column of Character.mode has them
_THIRD, _FIRST = 0, 1  # as the column of CameraRig.view has them


class Players:
    """Characters and camera rigs that follow a player."""

    def __init__(self, world: World, inputs: Inputs) -> None:
        self._world = world
        self._inputs = inputs
        self._characters = world.query(Character, enabled_only=True)
        self._rigs = world.query(CameraRig, enabled_only=True)

    def steer(self) -> None:
        """Turns the rigs by the pointers and writes the characters' wishes, as the rigs look; logs no change."""
        rigs, characters = self._world.table(CameraRig), self._world.table(Character)
        headings: dict[int, tuple[float, bool]] = {}  # by player: yaw [rad], whether through the eyes
        for row in rigs.rows(self._rigs.entities).tolist():
            player = int(rigs.column("player")[row])
            if player:
                headings[player] = self._look(rigs, row, self._inputs[player])
        for row in characters.rows(self._characters.entities).tolist():
            player = int(characters.column("player")[row])
            if player:
                self._wish(characters, row, self._inputs[player], headings.get(player))

    def _look(self, rigs: ComponentTable, row: int, player: PlayerInput) -> tuple[float, bool]:
        rate = float(rigs.column("sensitivity")[row])
        rigs.column("yaw")[row] -= rate * player.moved("pointer_x")
        rigs.column("pitch")[row] -= rate * player.moved("pointer_y")
        if player.was_pressed(LOOK):
            rigs.column("view")[row] = _FIRST if rigs.column("view")[row] == _THIRD else _THIRD
        return float(rigs.column("yaw")[row]), int(rigs.column("view")[row]) == _FIRST

    def _wish(
        self, characters: ComponentTable, row: int, player: PlayerInput, heading: tuple[float, bool] | None
    ) -> None:
        yaw = float(characters.column("yaw")[row]) if heading is None else heading[0]
        rotation, axes = np.zeros((1, 4)), np.zeros((1, 2, 3))
        turn_views(np.array([yaw]), np.zeros(1), rotation, axes)
        ahead = _side(player, FORWARD, BACK)
        aside = _side(player, RIGHT, LEFT)
        wish = ahead * axes[0, 0] + aside * axes[0, 1]
        characters.column("wish")[row] = wish
        characters.column("wish_run")[row] = _any(player, RUN)
        characters.column("wish_jump")[row] = _any(player, JUMP) or any(player.was_pressed(key) for key in JUMP)
        characters.column("wish_crouch")[row] = _any(player, CROUCH)
        if player.was_pressed(FLY):
            characters.column("mode")[row] = _WALK if characters.column("mode")[row] == _FLY else _FLY
        if heading is not None and (heading[1] or ahead or aside):
            characters.column("yaw")[row] = yaw

    @property
    def has_any(self) -> bool:
        """Whether anybody could be driven."""
        return len(self._characters) > 0 or len(self._rigs) > 0


def _any(player: PlayerInput, keys: tuple[str, ...]) -> bool:
    return any(player.is_down(key) for key in keys)


def _side(player: PlayerInput, forth: tuple[str, ...], back: tuple[str, ...]) -> float:
    return float(_any(player, forth)) - float(_any(player, back))
