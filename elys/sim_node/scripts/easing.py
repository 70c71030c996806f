"""How what goes from one value to another in some time spreads its way over that time. Sums and products alone: the same bits
on every machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final


def _bounce(share: float) -> float:
    """As a ball that falls to its place, by parabolas that halve their spans (R. Penner's)."""
    for offset, rest in ((0.0, 0.0), (1.5, 0.75), (2.25, 0.9375)):
        if share < (1.0, 2.0, 2.5)[(0.0, 1.5, 2.25).index(offset)] / 2.75:
            return 7.5625 * (share - offset / 2.75) ** 2 + rest
    return 7.5625 * (share - 2.625 / 2.75) ** 2 + 0.984375


EASES: Final[Mapping[str, Callable[[float], float]]] = {
    "linear": lambda share: share,
    "smooth": lambda share: share * share * (3.0 - 2.0 * share),  # slow at both ends
    "smoother": lambda share: share * share * share * (share * (6.0 * share - 15.0) + 10.0),
    "in": lambda share: share * share * share,  # slow at first
    "out": lambda share: 1.0 - (1.0 - share) * (1.0 - share) * (1.0 - share),  # slow at last
    "back": lambda share: 1.0 + (share - 1.0) * (share - 1.0) * (2.70158 * (share - 1.0) + 1.70158),  # 10 % too far
    "bounce": _bounce,
}


def eased(share: float, ease: str = "smooth") -> float:
    """How far it is when a share of the time is over; ValueError for an ease that is none."""
    if ease not in EASES:
        raise ValueError(f"there is no ease {ease!r}; there are {', '.join(EASES)}")
    return EASES[ease](share)


def checked(duration: float, ease: str) -> tuple[float, str]:
    """The same; ValueError for a duration or an ease that is none."""
    number = float(duration)
    if not (math.isfinite(number) and number >= 0.0):
        raise ValueError(f"a duration is a finite number of seconds, 0 or more, not {duration!r}")
    eased(0.0, ease)
    return number, ease
