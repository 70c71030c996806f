"""Who of a scene shines, through whose camera it is seen, and what is all around: those that are switched on."""

from __future__ import annotations

import numpy as np

from elys.common.components import Camera, Environment, Light
from elys.render_node.scene_reader import SceneEdits
from elys.render_node.scene_tables import Rows, SceneTables


class Fixtures:
    """Attributes:
    rows: of the tables, the lamps' first, then that of the camera and that of the environment, where there are such.
    lights, camera, environment: their components.
    """

    def __init__(self, tables: SceneTables, *, player: int, preferred: int, has_environment: bool) -> None:
        """The camera is the `preferred` entity's, or one of this player's, before those of everybody."""
        self._player, self._preferred = player, preferred
        self._light_rows = _enabled(tables, tables.lights)
        self._camera_rows = self._chosen_camera(tables)
        # The first that is on counts.
        self._environment_rows = _enabled(tables, tables.environments)[:1] if has_environment else []
        self.rows: Rows = np.array(self._light_rows + self._camera_rows + self._environment_rows, np.intp)
        self._take_values(tables)

    def follow(self, tables: SceneTables, edits: SceneEdits) -> bool:
        """Takes values that were set; False where another camera is to be looked through."""
        if edits.cameras and self._chosen_camera(tables) != self._camera_rows:
            return False
        if edits.lights or edits.cameras or edits.environments:
            self._take_values(tables)
        return True

    def _take_values(self, tables: SceneTables) -> None:
        self.lights: list[Light] = [tables.lights[row] for row in self._light_rows]
        self.camera: Camera | None = next((tables.cameras[row] for row in self._camera_rows), None)
        self.environment: Environment | None = next((tables.environments[row] for row in self._environment_rows), None)

    def _chosen_camera(self, tables: SceneTables) -> list[int]:
        def rank(row: int) -> tuple[bool, bool, bool, float]:
            camera, is_preferred = tables.cameras[row], int(tables.entity[row]) == self._preferred
            return is_preferred, camera.player in (0, self._player), camera.player == self._player, camera.priority

        cameras = _enabled(tables, tables.cameras)
        # max keeps the first of equals: the one that stands first in the scene.
        return [max(cameras, key=rank)] if cameras else []


def _enabled(tables: SceneTables, values: dict[int, Light] | dict[int, Camera] | dict[int, Environment]) -> list[int]:
    return [row for row in values if tables.enabled[row]]
