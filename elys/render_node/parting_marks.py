"""How far other runs have parted from this one, drawn over the picture: lines from where bodies are to where they are there, the
lengths of the longest, and a sentence for each run.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.mirror import MirrorEntity
from elys.render_node.ghost_worlds import ShownGhost
from elys.render_node.marks import Label, Lines

MOST_LINES: Final = 2000  # of a ghost, the longest
MEASURED: Final = 3  # lines beside which their length stands


def parting_marks(
    ghosts: Collection[ShownGhost],
    entities: Mapping[int, MirrorEntity],
    has: Callable[[NDArray[np.uint32]], NDArray[np.bool_]],
) -> tuple[list[Lines], list[Label], tuple[str, ...]]:
    """Lines, labels and notes on ghosts; lines of those bodies only that are meant (`has`, entities (N,) -> (N,))."""
    lines: list[Lines] = []
    labels: list[Label] = []
    for ghost in ghosts:
        parting = ghost.parting
        distance = parting.distance
        meant = np.flatnonzero(np.isfinite(distance) & has(parting.entity))
        longest = meant[np.argsort(-distance[meant], kind="stable")][:MOST_LINES]
        ends = np.stack([parting.here[longest], parting.there[longest]], axis=1)
        lines.append(Lines.of(ends, ghost.color, width=2.0, hidden=0.7))
        for row in longest[:MEASURED].tolist():
            x, y, z = parting.there[row].tolist()
            labels.append(Label(length_text(float(distance[row])), (x, y, z), ghost.color))
    return lines, labels, tuple(parting_note(ghost, entities) for ghost in ghosts)


def parting_note(ghost: ShownGhost, entities: Mapping[int, MirrorEntity]) -> str:
    """How far a ghost is off, in a line."""
    distance = ghost.parting.distance
    apart = np.flatnonzero(np.isfinite(distance))
    alone = len(distance) - len(apart)
    told = f"{ghost.title}: {len(apart)} of {ghost.body_count} apart"
    if len(apart):
        row = apart[np.argmax(distance[apart])]
        found = entities.get(int(ghost.parting.entity[row]))
        name = found.name if found is not None and found.name else str(ghost.parting.entity[row])
        told += f", {name} by {length_text(float(distance[row]))}"
    return told + (f", {alone} there alone" if alone else "")


def length_text(metres: float) -> str:
    """A length as people read it."""
    return f"{1000.0 * metres:.3g} mm" if metres < 0.1 else f"{metres:.3g} m"
