"""Simulation times as a person writes them."""

from __future__ import annotations

import math
import re
from typing import Final

from elys.common.errors import ElysError

MOST_GUARDED: Final = 600.0  # [s]
_UNITS: Final = {"": 1.0, "ms": 1e-3, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}
_PART: Final = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(ms|min|s|m|h|)\s*")


def parse_moment(text: str, *, otherwise: float = 0.0) -> float:
    """The seconds in 2, 2s, 500ms or 1m30s; `otherwise` for no text. Raises ElysError."""
    rest = text.strip()
    if not rest:
        return otherwise
    sign = -1.0 if rest.startswith("-") else 1.0
    rest = rest.removeprefix("-")
    seconds, is_over = 0.0, not rest
    while rest and not is_over:
        part = _PART.match(rest)
        if part is None:
            break
        seconds += float(part[1]) * _UNITS[part[2]]
        rest, is_over = rest[part.end() :], not part[2]  # a number without a unit is the last one
    if rest or (is_over and not text.strip("- ")) or not math.isfinite(seconds):
        raise ElysError(f"'{text}' is no time: write seconds, or for instance 2s, 500ms or 1m30s")
    return sign * seconds


def guard_seconds(text: str) -> float:
    """How much the guard of a run keeps [s]. Raises ElysError."""
    seconds = parse_moment(text)
    if not 1.0 <= seconds <= MOST_GUARDED:
        raise ElysError(
            f"the guard keeps 1 s to {MOST_GUARDED:g} s, not '{text}': for more, record the session (--record)"
        )
    return seconds
