"""Letters of all sizes in one picture, from which the card draws them: made when first asked for. It grows, and is begun anew
when it is full.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.fonts import face_of

EDGE: Final = 1024  # [texels] of the sheet at first
LARGEST: Final = 4096
BETWEEN: Final = 1  # [texels]: magnified letters must not take from their neighbours


class GlyphSheet:
    """Coverage (E, E) u8, filled in rows. `version` rises when letters are added, `generation` when it is begun anew.

    Attributes:
        table: (C, 6) of each letter where it is in the sheet (2) and its size [texels] (2), and where its upper left corner is
            from the pen [pixels] (2). Row 0 is of letters that show nothing.
    """

    def __init__(self, edge: int = EDGE, *, largest: int = LARGEST) -> None:
        self._largest = largest
        self.texels: NDArray[np.uint8] = np.zeros((edge, edge), np.uint8)
        self.table = np.zeros((256, 6), np.float32)
        self.version = self.generation = 0
        self._count = 1
        self._pages: dict[tuple[float, int], dict[str, int]] = {}
        self._x = self._y = self._row_height = 0

    def rows(self, letters: Sequence[str], size: float, stroke: int) -> list[int]:
        """Which rows of the table letters of a size [pixels], grown by a stroke, have.

        Where there is no room any more the sheet is begun anew: who has asked for others before asks again.
        """
        page = self._pages.get((size, stroke))
        if page is None:
            page = self._pages[size, stroke] = {}
        try:
            return [page[letter] for letter in letters]
        except KeyError:
            return [self._row(letter, size, stroke) for letter in letters]

    def _row(self, letter: str, size: float, stroke: int) -> int:
        found = self._pages.setdefault((size, stroke), {}).get(letter)
        if found is not None:
            return found
        glyph = face_of(size).glyph(letter, stroke)
        place = None if glyph is None else self._put(glyph.mask)
        row = 0
        if glyph is not None and place is not None:
            if self._count == len(self.table):
                self.table = np.concatenate([self.table, np.zeros_like(self.table)])
            row, self._count = self._count, self._count + 1
            self.table[row] = (*place, glyph.mask.shape[1], glyph.mask.shape[0], glyph.left, glyph.top)
        self._pages.setdefault((size, stroke), {})[letter] = row  # the sheet may have been begun anew meanwhile
        return row

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
        self._pages.clear()
        self._count = 1
        self.texels[:] = 0
        self._x = self._y = self._row_height = 0
        self.generation += 1
