"""How far things fall before they stand on something, by the boxes that the mirror knows around everything."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.editor_node.scene_mirror import EditorScene

_SINK: Final = 0.02  # [m] that something may stick in what it stands on and still be put on top of it


def falls(scene: EditorScene, entities: Iterable[int]) -> dict[int, float]:
    """How far [m] each of the entities is to go up (negative: down), with all below it in the tree, to stand on what is under it.

    Where nothing is under it, that is y = 0. The lowest goes first, so that what lies on another comes down with it. Boxes along
    the axes stand for what is there; who shows and collides with nothing is a point, and nobody stands on it.
    """
    groups = {entity: scene.mirror.descendants(entity) for entity in entities}
    moving = {member for members in groups.values() for member in members}
    boxes = [
        scene.box_of(entity)
        for entity in scene.mirror.entities
        if entity not in moving and scene.has_extent(entity) and scene.is_world_enabled(entity)
    ]
    low = np.array([box[0] for box in boxes]).reshape(-1, 3)
    high = np.array([box[1] for box in boxes]).reshape(-1, 3)
    own = {entity: _box_around(scene, entity, members) for entity, members in groups.items()}
    found: dict[int, float] = {}
    for entity in sorted(own, key=lambda entity: float(own[entity][0][1])):
        start, end = own[entity]
        under = np.all((low < end)[:, (0, 2)] & (high > start)[:, (0, 2)], axis=1) & (high[:, 1] <= start[1] + _SINK)
        rise = (float(high[under, 1].max()) if under.any() else 0.0) - float(start[1])
        found[entity] = rise
        if any(scene.has_extent(member) for member in groups[entity]):
            lift = np.array((0.0, rise, 0.0))
            low, high = np.vstack((low, start + lift)), np.vstack((high, end + lift))
    return found


def _box_around(scene: EditorScene, entity: int, members: list[int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    solid = [member for member in members if scene.has_extent(member)]
    if not solid:
        place = np.array(scene.world_pose(entity).position)
        return place, place
    boxes = [scene.box_of(member) for member in solid]
    return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
