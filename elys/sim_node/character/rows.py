"""Characters as rows for the kernels, out of the columns of their components and back."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Character
from elys.sim_node.character.kernels.tables import CHARACTER
from elys.sim_node.ecs.columns import ComponentTable

Rows = NDArray[Any]

_SAME: Final = (  # by both names
    "mode",
    "wish_run",
    "wish_jump",
    "wish_crouch",
    "radius",
    "height",
    "crouch_height",
    "walk_speed",
    "run_speed",
    "crouch_speed",
    "swim_speed",
    "fly_speed",
    "fall_speed",
    "acceleration",
    "braking",
    "air_control",
    "jump_height",
    "coyote_time",
    "jump_buffer",
    "slope_limit",
    "step_height",
    "push_force",
    "mass",
    "wish",
)
_STATE: Final = (
    "yaw",
    "velocity",
    "carried",
    "grounded",
    "blocked",
    "stature",
    "air_time",
    "jump_time",
    "jump_held",
    "has_jumped",
)
STATE_FIELDS: Final = (*_STATE, "ground_normal", "ground")  # what ticks write


def read_rows(table: ComponentTable, rows: NDArray[np.int32], gravity: float) -> Rows:
    """Rows (N,) of CHARACTER from those of the component's table, under that much gravity [m/s^2], without places and bodies."""
    characters = np.zeros(len(rows), CHARACTER)
    for name in (*_SAME, *_STATE):
        characters[name] = table.column(name)[rows]
    characters["normal"] = table.column("ground_normal")[rows]
    characters["gravity"] = max(gravity, 0.0) * table.column("gravity_scale")[rows]
    characters["radius"] = np.minimum(characters["radius"], 0.5 * characters["height"])
    fresh = characters["stature"] <= 0.0
    characters["stature"][fresh] = characters["height"][fresh]
    return characters


def write_rows(table: ComponentTable, rows: NDArray[np.int32], characters: Rows, grounds: NDArray[np.uint32]) -> None:
    """The state of characters (N,) into the columns, logging no change; `grounds` are what they stand on, 0 for none."""
    for name in _STATE:
        table.column(name)[rows] = characters[name]
    table.column("ground_normal")[rows] = characters["normal"]
    table.column("ground")[rows] = grounds


def capsule_of(character: Character) -> tuple[float, float]:
    """Radius and half the straight part [m] of the capsule that a character is now."""
    radius = min(character.radius, 0.5 * character.height)
    stature = character.stature if character.stature > 0.0 else character.height
    return radius, max(0.5 * stature - radius, 1e-4)
