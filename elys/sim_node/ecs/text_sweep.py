"""Texts that no component has any more: let go of now and then, or a clock that is written each tick would fill the memory."""

from __future__ import annotations

from typing import Final

import numpy as np

from elys.common.components import Kind
from elys.common.components.columns import StringTable
from elys.sim_node.ecs.world import World

EVERY: Final = 600  # ticks between two looks; by the tick alone, so that a run that is repeated does the same
FEW: Final = 4096  # texts of which nobody minds that they are kept
_BY_ROW: Final = (Kind.TEXT, Kind.ASSET, Kind.VALUES)


def sweep_texts(world: World) -> bool:
    """Keeps the texts that columns name, in their order, where most of many are others. Returns whether rows have changed."""
    known = len(world.strings)
    if known <= FEW:
        return False
    columns = [
        table.column(field.name)
        for table in world.tables()
        for field in table.declaration.fields
        if field.kind in _BY_ROW
    ]
    is_named = np.zeros(known, np.bool_)
    is_named[0] = True  # the empty text
    for column in columns:
        is_named[column] = True
    if 2 * int(is_named.sum()) > known:
        return False
    row_of = np.cumsum(is_named, dtype=np.int32) - np.int32(1)
    for column in columns:
        column[:] = row_of[column]
    texts = world.strings.texts
    world.strings = StringTable(texts[row] for row in np.flatnonzero(is_named).tolist())
    return True
