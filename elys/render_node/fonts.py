"""Letters as coverage, in any size, the same on every machine as far as Latin goes: what texts are drawn from, without OpenGL.

Pillow brings a font with the letters of English. Accented ones are put together here from its letters and from marks drawn as
strokes (`drawn_letters.py`); whatever else is asked for comes from fonts that are installed, or is a box.
"""

from __future__ import annotations

import math
import unicodedata
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFont

from elys.render_node.drawn_letters import ABOVE, BELOW, DRAWN, OVER, PAIRS, UNKNOWN, Stroke

SUPERSAMPLING: Final = 4  # of strokes along each axis; letters are smoothed by the font's own rasteriser
GAP: Final = 0.05  # of the size, between a letter and its accent
DOTTED: Final = "ij"  # an accent takes the place of the dot
SPACE: Final = 0.27  # of the size, at least: small letters with edges stand close
KEPT_GLYPHS: Final = 4096


class Glyph(NamedTuple):
    """A letter's coverage (H, W) u8, and where its upper left corner is from the pen on the baseline [pixels], y down."""

    mask: NDArray[np.uint8]
    left: int
    top: int


class Face:
    """The letters of a size."""

    def __init__(self, size: float) -> None:
        """`size` [pixels] of the em."""
        self.size = size
        self._fonts = fonts_of(size)
        ascent, descent = self._fonts[0].getmetrics()
        self.ascent: float = ascent
        self.line_height: float = ascent + descent
        self._advances: dict[str, float] = {}
        self._kerning: dict[tuple[str, str], float] = {}

    def advance(self, character: str) -> float:
        """How far the pen moves [pixels]."""
        found = self._advances.get(character)
        if found is None:
            found = self._advances[character] = self._advance(character)
        return found

    def kerning(self, before: str, character: str) -> float:
        """How much nearer two letters stand than each by itself [pixels], at most 0 for those that do not touch."""
        pair = (before, character)
        found = self._kerning.get(pair)
        if found is None:
            first, second = _base(before), _base(character)
            font = self._fonts[0]
            found = 0.0
            if has_letter(font, first) and has_letter(font, second):
                found = float(font.getlength(first + second) - font.getlength(first) - font.getlength(second))
            self._kerning[pair] = found
        return found

    def glyph(self, character: str, stroke: int = 0) -> Glyph | None:
        """A letter, grown by `stroke` [pixels] on all sides; None for one that shows nothing."""
        if character.isspace():
            return None
        letters, strokes = self._parts(character)
        return _composed(self.size, letters, strokes, stroke)

    def _advance(self, character: str) -> float:
        if character == " ":
            return max(float(self._fonts[0].getlength(" ")), SPACE * self.size)
        if character in PAIRS:
            first, second, nearer = PAIRS[character]
            return float(self._fonts[0].getlength(first) + self._fonts[0].getlength(second)) - nearer * self.size
        if character in DRAWN:
            return DRAWN[character].advance * self.size
        font, shown = self._font_of(_base(character))
        return float(font.getlength(shown)) if font is not None else UNKNOWN.advance * self.size

    def _parts(self, character: str) -> tuple[list[tuple[Any, str, float, bool]], list[Stroke]]:
        """Letters as font, text, place [pixels] and whether they lose their dot; and strokes in em from the pen, y up."""
        if character in PAIRS:
            first, second, nearer = PAIRS[character]
            font = self._fonts[0]
            return [
                (font, first, 0.0, False),
                (font, second, float(font.getlength(first)) - nearer * self.size, False),
            ], []
        if character in DRAWN:
            return [], list(DRAWN[character].strokes)
        base, marks = _taken_apart(character)
        font, shown = self._font_of(base)
        if font is None:
            return [], list(UNKNOWN.strokes)
        loses_dot = base in DOTTED and any(mark in ABOVE for mark in marks)
        return [(font, shown, 0.0, loses_dot)], self._accents(font, shown, marks, loses_dot)

    def _accents(self, font: Any, shown: str, marks: str, loses_dot: bool) -> list[Stroke]:
        left, top, right, bottom = (edge / self.size for edge in font.getbbox(shown, anchor="ls"))
        if loses_dot:
            top = font.getbbox("x", anchor="ls")[1] / self.size
        middle, height, depth = (left + right) / 2, -top + GAP, -bottom
        strokes: list[Stroke] = []
        for mark in marks:
            if mark in ABOVE:
                strokes += [part.moved(middle, height) for part in ABOVE[mark]]
                height += 0.17  # another one stands above
            elif mark in BELOW:
                strokes += [part.moved(middle, depth) for part in BELOW[mark]]
            elif mark in OVER:
                strokes += [part.stretched(left, right, -top) for part in OVER[mark]]
        return strokes

    def _font_of(self, base: str) -> tuple[Any, str]:
        for font in self._fonts:
            if has_letter(font, base):
                return font, base
        return None, base


@lru_cache(maxsize=256)
def face_of(size: float) -> Face:
    """The letters of a size [pixels]."""
    return Face(size)


def _base(character: str) -> str:
    return _taken_apart(character)[0]


@cache
def _taken_apart(character: str) -> tuple[str, str]:
    """A letter and the marks on it, where they are known; else itself and none."""
    if character in _STRUCK:
        return _STRUCK[character]
    base, *marks = tuple(unicodedata.normalize("NFD", character))
    if marks and all(mark in ABOVE or mark in BELOW or mark in OVER for mark in marks):
        return base, "".join(marks)
    return character, ""


# What Unicode does not take apart: letters struck through.
_STRUCK: Final = {
    "ø": ("o", "\u0338"),
    "Ø": ("O", "\u0338"),
    "ł": ("l", "\u0337"),
    "Ł": ("L", "\u0334"),
    "đ": ("d", "\u0335"),
    "Đ": ("D", "\u0336"),
    "ħ": ("h", "\u0335"),
    "Ħ": ("H", "\u0335"),
    "ŧ": ("t", "\u0335"),
    "Ŧ": ("T", "\u0333"),
    "€": ("C", "\u0347"),
}


def _composed(
    size: float, letters: list[tuple[Any, str, float, bool]], strokes: list[Stroke], grown: int
) -> Glyph | None:
    boxes = [font.getbbox(text, anchor="ls", stroke_width=grown) for font, text, _, _ in letters]
    edges = [
        (box[0] + place, box[1], box[2] + place, box[3]) for box, (_, _, place, _) in zip(boxes, letters, strict=True)
    ]
    edges += [part.box(size, grown) for part in strokes]
    if not edges:
        return None
    left, top = (math.floor(min(edge[k] for edge in edges)) - 1 for k in (0, 1))
    right, bottom = (math.ceil(max(edge[k] for edge in edges)) + 1 for k in (2, 3))
    if right <= left or bottom <= top:
        return None
    image = Image.new("L", (right - left, bottom - top))
    for font, text, place, loses_dot in letters:
        letter = Image.new("L", image.size)
        ImageDraw.Draw(letter).text(
            (round(place) - left, -top), text, fill=255, font=font, anchor="ls", stroke_width=grown
        )
        image = ImageChops.lighter(image, _without_dot(letter) if loses_dot else letter)
    if strokes:
        image = ImageChops.lighter(image, _stroked(size, strokes, grown, (left, top), image.size))
    return Glyph(np.asarray(image), left, top)


def _without_dot(letter: Image.Image) -> Image.Image:
    """What is below the highest gap between rows that hold anything."""
    filled = np.asarray(letter).max(axis=1) > 96
    rows = np.flatnonzero(filled)
    gaps = np.flatnonzero(np.diff(rows) > 1)
    if not len(gaps):
        return letter
    kept = np.asarray(letter).copy()
    kept[: int(rows[gaps[0]]) + 2] = 0
    return Image.fromarray(kept)


def _stroked(
    size: float, strokes: list[Stroke], grown: int, corner: tuple[int, int], wanted: tuple[int, int]
) -> Image.Image:
    fine = Image.new("L", (wanted[0] * SUPERSAMPLING, wanted[1] * SUPERSAMPLING))
    draw = ImageDraw.Draw(fine)
    for part in strokes:
        radius = (part.width * size / 2 + grown) * SUPERSAMPLING
        points = [
            ((x * size - corner[0]) * SUPERSAMPLING, (-y * size - corner[1]) * SUPERSAMPLING) for x, y in part.points
        ]
        if len(points) > 1:
            draw.line(points, fill=255, width=max(round(2 * radius), 1))
        for x, y in points:  # round ends and corners
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=255)
    return fine.resize(wanted, Image.Resampling.BOX)


@lru_cache(maxsize=64)
def fonts_of(size: float) -> tuple[Any, ...]:
    """Pillow's own font and, behind it, those that are installed."""
    fonts: list[Any] = [ImageFont.load_default(size)]
    for path in _font_files():
        try:
            fonts.append(ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC))
        except OSError:
            continue
    return tuple(fonts)


@cache
def _font_files() -> tuple[str, ...]:
    """Where more letters may be found: in the package that the editor needs, and under a name that systems know."""
    found = find_spec("imgui_bundle")
    bundled = Path(found.origin).parent / "assets" / "fonts" if found is not None and found.origin is not None else None
    roboto = sorted(bundled.rglob("Roboto-Regular.ttf")) if bundled is not None and bundled.is_dir() else []
    return (*map(str, roboto), "DejaVuSans.ttf")


_known: dict[tuple[str, str], bool] = {}


def has_letter(font: Any, character: str) -> bool:
    """Whether a font has a letter: those that it lacks all look like one that no font has."""
    if character == " ":
        return True
    key = (f"{font.getname()} {getattr(font, 'path', '')}", character)
    found = _known.get(key)
    if found is None:
        if len(_known) > KEPT_GLYPHS:
            _known.clear()
        found = _known[key] = _shape(font, character) != _shape(font, "\U000f0000")
    return found


def _shape(font: Any, character: str) -> bytes:
    mask = font.getmask(character)
    return bytes(mask) + repr(mask.size).encode()
