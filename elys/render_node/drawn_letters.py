"""Accents and signs as strokes of a round pen, in shares of the letters' size: what the font that is always there lacks."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

PEN: Final = 0.075  # width of a stroke of an accent: that of the font's own stems


class Stroke(NamedTuple):
    """A line through points, x to the right and y up [em]; a single point is a dot."""

    points: tuple[tuple[float, float], ...]
    width: float = PEN

    def moved(self, x: float, y: float) -> Stroke:
        """The same elsewhere."""
        return Stroke(tuple((a + x, b + y) for a, b in self.points), self.width)

    def stretched(self, left: float, right: float, height: float) -> Stroke:
        """Of points that are shares of a letter's width and height, the stroke over a letter of this box."""
        return Stroke(tuple((left + a * (right - left), b * height) for a, b in self.points), self.width)

    def box(self, size: float, grown: float) -> tuple[float, float, float, float]:
        """Left, top, right, bottom [pixels], y down, of letters of `size` [pixels]."""
        reach = self.width * size / 2 + grown
        x, y = [p[0] * size for p in self.points], [-p[1] * size for p in self.points]
        return min(x) - reach, min(y) - reach, max(x) + reach, max(y) + reach


class Drawn(NamedTuple):
    """A sign that is strokes alone, from the pen on the baseline; how far the pen moves [em]."""

    strokes: tuple[Stroke, ...]
    advance: float


def _line(*points: tuple[float, float], width: float = PEN) -> Stroke:
    return Stroke(points, width)


def _arc(x: float, y: float, radius: float, start: float, end: float, width: float = PEN) -> Stroke:
    """Part of a circle, angles in turns."""
    turns = [start + (end - start) * k / 12 for k in range(13)]
    return Stroke(
        tuple((x + radius * math.cos(2 * math.pi * t), y + radius * math.sin(2 * math.pi * t)) for t in turns), width
    )


# By combining character: strokes from the middle of a letter's upper edge, ...
ABOVE: Final[dict[str, tuple[Stroke, ...]]] = {
    "\u0300": (_line((-0.08, 0.15), (0.04, 0.03)),),
    "\u0301": (_line((-0.04, 0.03), (0.08, 0.15)),),
    "\u0302": (_line((-0.11, 0.03), (0.0, 0.13), (0.11, 0.03)),),
    "\u0303": (_line((-0.13, 0.05), (-0.07, 0.1), (0.0, 0.08), (0.07, 0.055), (0.13, 0.11), width=0.06),),
    "\u0304": (_line((-0.12, 0.07), (0.12, 0.07)),),
    "\u0306": (_arc(0.0, 0.15, 0.12, 0.55, 0.95),),
    "\u0307": (_line((0.0, 0.07), width=0.11),),
    "\u0308": (_line((-0.1, 0.07), width=0.1), _line((0.1, 0.07), width=0.1)),
    "\u0309": (_arc(0.0, 0.1, 0.06, 0.5, -0.15, 0.06), _line((0.0, 0.02), (0.03, 0.05), width=0.06)),
    "\u030a": (_arc(0.0, 0.09, 0.075, 0.0, 1.0, 0.055),),
    "\u030b": (_line((-0.12, 0.03), (-0.03, 0.15)), _line((0.04, 0.03), (0.13, 0.15))),
    "\u030c": (_line((-0.11, 0.13), (0.0, 0.03), (0.11, 0.13)),),
}
# ... of its lower edge, ...
BELOW: Final[dict[str, tuple[Stroke, ...]]] = {
    "\u0323": (_line((0.0, -0.12), width=0.1),),
    "\u0326": (_line((0.03, -0.08), (-0.02, -0.2)),),
    "\u0327": (_line((0.0, -0.02), (0.0, -0.06), (0.06, -0.11), (0.03, -0.17), (-0.06, -0.17), width=0.06),),
    "\u0328": (_line((0.1, -0.01), (0.03, -0.09), (0.05, -0.16), (0.13, -0.16), width=0.06),),
    "\u0331": (_line((-0.12, -0.1), (0.12, -0.1)),),
}
# ... and over it, in shares of its box.
OVER: Final[dict[str, tuple[Stroke, ...]]] = {
    "\u0335": (_line((0.3, 0.78), (1.1, 0.78), width=0.06),),
    "\u0333": (_line((0.28, 0.45), (0.72, 0.45), width=0.06),),
    "\u0334": (_line((-0.08, 0.34), (0.5, 0.62), width=0.065),),
    "\u0336": (_line((-0.1, 0.5), (0.45, 0.5), width=0.06),),
    "\u0337": (_line((0.0, 0.42), (1.0, 0.6), width=0.07),),
    "\u0338": (_line((0.02, -0.06), (0.98, 1.06), width=0.055),),
    "\u0347": (_line((-0.12, 0.58), (0.72, 0.58), width=0.06), _line((-0.12, 0.42), (0.68, 0.42), width=0.06)),
}
# Two letters in one: which, and how much nearer they stand.
PAIRS: Final[dict[str, tuple[str, str, float]]] = {
    "æ": ("a", "e", 0.1),
    "Æ": ("A", "E", 0.14),
    "œ": ("o", "e", 0.1),
    "Œ": ("O", "E", 0.14),
    "ﬁ": ("f", "i", 0.0),
    "ﬂ": ("f", "l", 0.0),
}
_HEAD: Final = 0.16
DRAWN: Final[dict[str, Drawn]] = {
    "–": Drawn((_line((0.05, 0.26), (0.47, 0.26), width=0.07),), 0.52),
    "—": Drawn((_line((0.05, 0.26), (0.87, 0.26), width=0.07),), 0.92),
    "•": Drawn((_line((0.2, 0.27), width=0.24),), 0.4),
    "ß": Drawn(
        (
            _line((0.1, 0.0), (0.1, 0.52), (0.13, 0.63), (0.22, 0.69), (0.34, 0.68), (0.41, 0.61), (0.41, 0.52)),
            _line((0.41, 0.52), (0.36, 0.45), (0.28, 0.41), (0.36, 0.36), (0.46, 0.28), (0.48, 0.18), (0.43, 0.07)),
            _line((0.43, 0.07), (0.34, 0.02), (0.24, 0.03)),
        ),
        0.57,
    ),
    "ı": Drawn((_line((0.11, 0.0), (0.11, 0.48)),), 0.22),
    "×": Drawn((_line((0.1, 0.12), (0.42, 0.44)), _line((0.1, 0.44), (0.42, 0.12))), 0.52),
    "÷": Drawn(
        (_line((0.08, 0.28), (0.44, 0.28)), _line((0.26, 0.46), width=0.1), _line((0.26, 0.1), width=0.1)), 0.52
    ),
    "←": Drawn((_line((0.72, 0.28), (0.1, 0.28)), _line((0.1 + _HEAD, 0.44), (0.1, 0.28), (0.1 + _HEAD, 0.12))), 0.82),
    "→": Drawn(
        (_line((0.1, 0.28), (0.72, 0.28)), _line((0.72 - _HEAD, 0.44), (0.72, 0.28), (0.72 - _HEAD, 0.12))), 0.82
    ),
    "↑": Drawn((_line((0.28, 0.0), (0.28, 0.62)), _line((0.12, 0.46), (0.28, 0.62), (0.44, 0.46))), 0.56),
    "↓": Drawn((_line((0.28, 0.62), (0.28, 0.0)), _line((0.12, 0.16), (0.28, 0.0), (0.44, 0.16))), 0.56),
    "✓": Drawn((_line((0.08, 0.28), (0.24, 0.08), (0.58, 0.56), width=0.09),), 0.66),
}
# What nobody has: a box.
UNKNOWN: Final = Drawn((_line((0.1, 0.03), (0.1, 0.65), (0.48, 0.65), (0.48, 0.03), (0.1, 0.03), width=0.05),), 0.58)
