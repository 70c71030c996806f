"""Colours between what is stored (linear light) and what a person picks and writes (sRGB, IEC 61966-2-1)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

Color = tuple[float, float, float]
_HEX: Final = re.compile(r"\s*#?\s*([0-9a-fA-F]{6}|[0-9a-fA-F]{3})\s*")


def srgb_from_linear(value: float) -> float:
    """IEC 61966-2-1."""
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1.0 / 2.4) - 0.055


def linear_from_srgb(value: float) -> float:
    """IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def hex_from_linear(color: Sequence[float]) -> str:
    """#rrggbb in sRGB; what is brighter than white is cut off there."""
    levels = (round(255.0 * srgb_from_linear(min(max(element, 0.0), 1.0))) for element in color)
    return "#" + "".join(f"{level:02x}" for level in levels)


def linear_from_hex(text: str) -> Color | None:
    """The linear colour of #rrggbb or #rgb, with or without the sign; None for anything else."""
    found = _HEX.fullmatch(text)
    if found is None:
        return None
    digits = found[1] if len(found[1]) == 6 else "".join(2 * digit for digit in found[1])
    r, g, b = (round(linear_from_srgb(int(digits[at : at + 2], 16) / 255.0), 5) for at in (0, 2, 4))
    return r, g, b


def split_intensity(color: Sequence[float]) -> tuple[Color, float]:
    """A radiance as a colour whose brightest channel is at most 1, and how much brighter it is; not below 1.

    What a screen can show is its own colour at intensity 1, so that an ordinary dark colour stays one.
    """
    r, g, b = color
    intensity = max(r, g, b, 1.0)
    return (r / intensity, g / intensity, b / intensity), intensity


def with_intensity(color: Sequence[float], intensity: float) -> Color:
    """The radiance of a colour that is so much brighter."""
    r, g, b = (round(element * intensity, 5) for element in color)
    return r, g, b
