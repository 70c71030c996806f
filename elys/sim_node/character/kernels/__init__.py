"""The kernels that move characters, and how they are compiled: none of them is needed by a world without characters."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.sim_node.character.kernels.moving import foresee_bodies, move_characters
from elys.sim_node.character.kernels.tables import CHARACTER, HIT, PLANE, PUSH, Surroundings
from elys.sim_node.character.kernels.views import turn_views
from elys.sim_node.compilation import signature_of
from elys.sim_node.physics.kernels import tables
from elys.sim_node.physics.kernels.cast import TOUCH
from elys.sim_node.physics.kernels.query_tree import QUERY_NODE


def _kernels() -> tuple[tuple[str, Any, tuple[tuple[Any, ...], ...]], ...]:
    bodies, colliders = np.zeros(1, tables.BODY), np.zeros(1, tables.COLLIDER)
    geometry = tables.no_geometry()
    numbers = np.zeros(1)
    rows, flags, characters = np.zeros(1, np.int32), np.zeros(1, np.uint8), np.zeros(1, CHARACTER)
    around = Surroundings(
        bodies,
        numbers,
        colliders,
        geometry,
        np.zeros(1, QUERY_NODE),
        rows,
        flags,
        rows,
        np.zeros(1, PLANE),
        np.zeros(3, HIT),
        np.zeros(1, TOUCH),
        np.zeros(1, PUSH),
    )
    return (
        ("character.turn_views", turn_views, (signature_of(numbers, numbers, np.zeros((1, 4)), np.zeros((1, 2, 3))),)),
        ("character.foresee_bodies", foresee_bodies, (signature_of(bodies, colliders, flags, characters, 1.0, rows),)),
        ("character.move_characters", move_characters, (signature_of(around, characters, 1.0),)),
    )


KERNELS: Final[tuple[Any, ...]] = ()
LATER_KERNELS: Final = _kernels()
