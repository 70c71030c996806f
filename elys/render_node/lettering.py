"""Letters as pictures, and where they stand: what texts over a picture are drawn from, without OpenGL.

A sheet holds each letter twice: its body and, around it, its edge, so that light letters are read on a light ground as well.
Where the letters come from, `fonts.py` tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.fonts import face_of

SMALLEST: Final = 12  # [pixels] of a font
LARGEST: Final = 64
PICTURE_LINES: Final = 52  # of text in the height of a picture
COLUMNS: Final = 24
ROWS: Final = 16
SPACE: Final = 0.32  # of the font's size, at least: small letters with edges stand close
EDGE: Final = 2  # [pixels] around letters
EDGE_OPACITY: Final = 0.75  # of the dark around letters
MARGIN: Final = 8  # [pixels] from the picture's edges to notes
LABEL_GAP: Final = 3  # [pixels] between a label and its place, and between labels
_FIRST: Final = "".join(map(chr, range(32, 127)))
_UNKNOWN: Final = "?"


class Letter(NamedTuple):
    """Where a letter stands in the sheet [texels], and how far the pen moves [pixels]."""

    column: int
    row: int
    advance: float


class Quads(NamedTuple):
    """Q letters to be drawn: where their cells' upper left corners are in the picture and in the sheet, and their colour."""

    place: NDArray[np.float32]  # (Q, 2) [pixels] from the upper left
    texel: NDArray[np.float32]  # (Q, 2)
    color: NDArray[np.float32]  # (Q, 3) sRGB, 0 to 1


class Sheet:
    """The letters of one size. `version` rises when letters are added."""

    def __init__(self, size: int) -> None:
        """`size` [pixels] of the font."""
        self.size = size
        self._face = face_of(size)
        self.ascent, self.line_height = round(self._face.ascent), round(self._face.line_height)
        self.cell = (size + size // 3 + 2 * EDGE, self.line_height + 2 * EDGE)
        self.texels = np.zeros((ROWS * self.cell[1], COLUMNS * self.cell[0], 4), np.uint8)  # body, edge, unused
        self.version = 0
        self._letters: dict[str, Letter] = {}
        for letter in _FIRST:
            self._add(letter)

    def letter(self, text: str) -> Letter:
        """A letter, drawn into the sheet when it is first asked for, as long as there is room."""
        found = self._letters.get(text)
        if found is None:
            is_full = len(self._letters) >= COLUMNS * ROWS
            found = self._letters[_UNKNOWN] if is_full or not text.isprintable() else self._add(text)
        return found

    def width(self, text: str) -> float:
        """[pixels] of a line."""
        return sum(self.letter(letter).advance for letter in text)

    def quads(self, texts: Sequence[tuple[str, float, float, tuple[int, int, int]]]) -> Quads:
        """Lines of text whose upper left corners are at x, y [pixels], in colours."""
        rows: list[tuple[float, ...]] = []
        for text, x, y, color in texts:
            pen = float(round(x))
            for character in text:
                letter = self.letter(character)
                if character != " ":
                    rows.append((round(pen) - EDGE, round(y) - EDGE, letter.column, letter.row, *color))
                pen += letter.advance
        table = np.array(rows, np.float32).reshape(-1, 7)
        return Quads(table[:, :2], table[:, 2:4], table[:, 4:] / 255.0)

    def _add(self, character: str) -> Letter:
        number = len(self._letters)
        column, row = number % COLUMNS * self.cell[0], number // COLUMNS * self.cell[1]
        body, edge = (self._drawn(character, width) for width in (0, EDGE))
        self.texels[row : row + self.cell[1], column : column + self.cell[0], 0] = body
        self.texels[row : row + self.cell[1], column : column + self.cell[0], 1] = edge
        self.version += 1
        advance = max(self._face.advance(character), SPACE * self.size if character == " " else 0.0)
        letter = self._letters[character] = Letter(column, row, advance)
        return letter

    def _drawn(self, text: str, edge: int) -> NDArray[np.uint8]:
        cell = np.zeros(self.cell[::-1], np.uint8)
        glyph = self._face.glyph(text, edge)
        if glyph is not None:
            left, top = EDGE + glyph.left, EDGE + round(self.ascent) + glyph.top
            x, y = max(left, 0), max(top, 0)
            part = glyph.mask[y - top :, x - left :][: max(self.cell[1] - y, 0), : max(self.cell[0] - x, 0)]
            cell[y : y + part.shape[0], x : x + part.shape[1]] = part
        return cell


@cache
def sheet_for(height: int) -> Sheet:
    """The letters for a picture of `height` pixels."""
    return sheet_of(min(max(round(height / PICTURE_LINES), SMALLEST), LARGEST))


@cache
def sheet_of(size: int) -> Sheet:
    """The letters of a font size [pixels]."""
    return Sheet(size)


def note_texts(sheet: Sheet, notes: Sequence[str], color: tuple[int, int, int]) -> list[tuple[str, float, float, Any]]:
    """Where lines of text stand in the upper left corner."""
    return [(note, MARGIN, MARGIN + row * sheet.line_height, color) for row, note in enumerate(notes)]


def free_places(boxes: NDArray[np.float64]) -> NDArray[np.intp]:
    """Those of the boxes (N, 4) of x, y, width, height that overlap none before them which is kept."""
    kept: list[int] = []
    taken = np.zeros((len(boxes), 4))
    for row, (x, y, width, height) in enumerate(boxes):
        others = taken[: len(kept)]
        apart = (
            (x >= others[:, 0] + others[:, 2])
            | (others[:, 0] >= x + width)
            | (y >= others[:, 1] + others[:, 3])
            | (others[:, 1] >= y + height)
        )
        if apart.all():
            taken[len(kept)] = boxes[row]
            kept.append(row)
    return np.array(kept, np.intp)


def write_on(pixels: NDArray[np.uint8], notes: Sequence[str], color: tuple[int, int, int]) -> None:
    """Writes notes into the upper left corner of RGB or RGBA pixels (H, W, 3 or 4), as the text pass does."""
    height, width = pixels.shape[:2]
    sheet = sheet_for(height)
    quads = sheet.quads(note_texts(sheet, notes, color))
    cell_width, cell_height = sheet.cell
    for body_opacity, edge_opacity in ((0.0, EDGE_OPACITY), (1.0, 0.0)):
        for (x, y), (u, v), tint in zip(quads.place.astype(int), quads.texel.astype(int), quads.color, strict=True):
            right, bottom = min(x + cell_width, width), min(y + cell_height, height)
            if right <= x or bottom <= y:
                continue
            texels = sheet.texels[v : v + bottom - y, u : u + right - x].astype(np.float32) / 255.0
            body, edge = body_opacity * texels[..., :1], edge_opacity * texels[..., 1:2]
            there = pixels[y:bottom, x:right, :3].astype(np.float32)
            shown = there * (1.0 - edge) * (1.0 - body) + tint * 255.0 * body
            pixels[y:bottom, x:right, :3] = np.rint(shown).astype(np.uint8)
