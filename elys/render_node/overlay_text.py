"""Texts of overlays: what they say with a value in them, and where their letters stand."""

from __future__ import annotations

import re
import unicodedata
from collections import OrderedDict
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.components.overlay import OverlayText
from elys.render_node.fonts import Face, face_of

LARGEST: Final = 320.0  # [pixels] at which letters are made; larger ones are these, magnified
SMALLEST: Final = 4.0
FINE_BELOW: Final = 32.0  # [pixels] below which sizes go by halves of a pixel
MOST_LETTERS: Final = 4096
MOST_LINES: Final = 256
KEPT_TEXTS: Final = 1024
_PLACE: Final = re.compile(r"\{(?::(time|[-+ ]?0?\d{0,2},?(?:\.\d{1,2})?[dfeg%]?))?\}")


class TextLayout(NamedTuple):
    """L letters as their pens are [pixels] from the upper left corner of the text, on baselines."""

    letters: tuple[str, ...]  # those that show anything
    pen: NDArray[np.float64]  # (L, 2)
    width: float  # [pixels]
    height: float
    size: float  # [pixels] of the letters as they are made
    scale: float  # by which these are magnified; 1 but for huge ones


def said(text: OverlayText) -> str:
    """What is read: the text with its value."""
    if "{" not in text.text:
        return text.text
    return _PLACE.sub(lambda match: _told(match.group(1) or "", text.value), text.text)


def _told(how: str, value: float) -> str:
    if how == "time":
        return time_told(value)
    try:
        return format(round(value), how) if how.endswith("d") else format(value, how or "g")
    except ValueError:
        return f"{value:g}"


def time_told(seconds: float) -> str:
    """Minutes, seconds and hundredths, as races are timed: 1:23.45."""
    hundredths = round(abs(seconds) * 100)
    minutes, rest = divmod(hundredths, 6000)
    return f"{'-' if seconds < 0 and hundredths else ''}{minutes}:{rest // 100:02d}.{rest % 100:02d}"


def letter_size(size: float) -> tuple[float, float]:
    """At which size [pixels] letters that are to be of `size` are made, and by how much they are magnified."""
    if size > LARGEST:
        return LARGEST, size / LARGEST
    made = round(size * 2.0) / 2.0 if size < FINE_BELOW else float(round(size))
    return max(made, SMALLEST), 1.0


class TextSetter:
    """Sets texts; those set last are kept, for most are the same in the next picture."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str, float, str], TextLayout] = OrderedDict()

    def set(self, text: str, size: float, align: str) -> TextLayout:
        """A text in letters of `size` [pixels], lines by newlines; what has no letter is a box, what controls is left out."""
        key = (text, size, align)
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = _set(text, size, align)
            if len(self._kept) > KEPT_TEXTS:
                self._kept.popitem(last=False)
        else:
            self._kept.move_to_end(key)
        return found


def _set(text: str, size: float, align: str) -> TextLayout:
    made, scale = letter_size(size)
    face = face_of(made)
    lines = shown(text).split("\n")[:MOST_LINES]
    letters: list[str] = []
    pens: list[tuple[float, float]] = []
    places, widths = [], []
    for number, line in enumerate(lines):
        baseline = face.ascent + number * face.line_height
        first = len(letters)
        widths.append(_set_line(face, line, baseline, letters, pens))
        places.append((first, len(letters)))
    pen = np.array(pens, np.float64).reshape(-1, 2)
    width = max(widths, default=0.0)
    share = {"center": 0.5, "right": 1.0}.get(align, 0.0)
    if share:
        for (first, last), length in zip(places, widths, strict=True):
            pen[first:last, 0] += share * (width - length)
    return TextLayout(tuple(letters), pen * scale, width * scale, len(lines) * face.line_height * scale, made, scale)


def _set_line(face: Face, line: str, baseline: float, letters: list[str], pens: list[tuple[float, float]]) -> float:
    """Appends the letters of a line; how long it is [pixels]."""
    pen, before = 0.0, ""
    for character in line:
        if before and not (character.isdigit() or before.isdigit()):  # numbers that change must not tremble
            pen += face.kerning(before, character)
        if character != " ":
            letters.append(character)
            pens.append((pen, baseline))
        pen += face.advance(character)
        before = character
    return pen


def shown(text: str) -> str:
    """The characters that are drawn: composed, without controls, marks that nothing carries, and what steers writing."""
    text = text[:MOST_LETTERS]
    if text.isascii() and text.isprintable():
        return text
    composed = unicodedata.normalize("NFC", text.replace("\r\n", "\n").replace("\t", "    "))
    return "".join(
        character if character == "\n" or not character.isspace() else " "
        for character in composed
        if character in "\n\u00a0" or unicodedata.category(character) not in _UNSEEN
    )


_UNSEEN: Final = frozenset({"Cc", "Cf", "Cs", "Mn", "Me", "Zl", "Zp"})


def stroke_of(text: OverlayText, size: float) -> int:
    """How far the edge reaches around letters of a made size [pixels]: a whole one at least, where there is any."""
    return max(round(text.outline * size), 1) if text.outline > 0.0 else 0
