"""Letters of all sizes in one picture, from which the card draws them: made when first asked for. It grows, and is begun anew when
it is full.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.fonts import face_of

EDGE: Final = 1024  # [texels] of the sheet at first
LARGEST: Final = 4096
BETWEEN: Final = 1  # [texels]: magnified letters must not take from their neighbours


class Cell(NamedTuple):
    """Where a letter is in the sheet [texels], its size, and where its upper left corner is from the pen [pixels]."""

    u: int
    v: int
    width: int
    height: int
    left: int
    top: int


class GlyphSheet:
    """Coverage (E, E) u8, filled in rows. `version` rises when letters are added, `generation` when it is begun anew."""

    def __init__(self, edge: int = EDGE, *, largest: int = LARGEST) -> None:
        self._largest = largest
        self.texels: NDArray[np.uint8] = np.zeros((edge, edge), np.uint8)
        self.version = self.generation = 0
        self._cells: dict[tuple[str, float, int], Cell | None] = {}
        self._x = self._y = self._row_height = 0

    def cell(self, character: str, size: float, stroke: int) -> Cell | None:
        """A letter of a size [pixels], grown by a stroke; None for what shows nothing, or is larger than the whole sheet.

        Where there is no room any more the sheet is begun anew: who has asked for others before asks again.
        """
        key = (character, size, stroke)
        if key in self._cells:
            return self._cells[key]
        glyph = face_of(size).glyph(character, stroke)
        found = None if glyph is None else self._put(glyph.mask)
        self._cells[key] = (
            None
            if glyph is None or found is None
            else Cell(*found, glyph.mask.shape[1], glyph.mask.shape[0], glyph.left, glyph.top)
        )
        return self._cells[key]

    def _put(self, mask: NDArray[np.uint8]) -> tuple[int, int] | None:
        height, width = mask.shape
        if width > self._largest or height > self._largest:
            return None
        if self._x + width > len(self.texels):
            self._x, self._y, self._row_height = 0, self._y + self._row_height + BETWEEN, 0
        while self._x + width > len(self.texels) or self._y + height > len(self.texels):
            if 2 * len(self.texels) <= self._largest:
                self._grow()
            else:
                self._begin_anew()
        place = self._x, self._y
        self.texels[place[1] : place[1] + height, place[0] : place[0] + width] = mask
        self._x += width + BETWEEN
        self._row_height = max(self._row_height, height)
        self.version += 1
        return place

    def _grow(self) -> None:
        edge = len(self.texels)
        grown = np.zeros((2 * edge, 2 * edge), np.uint8)
        grown[:edge, :edge] = self.texels
        self.texels = grown

    def _begin_anew(self) -> None:
        self._cells.clear()
        self.texels[:] = 0
        self._x = self._y = self._row_height = 0
        self.generation += 1
