"""Weights of morph targets as the Morph component has them: a text of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from elys.common.errors import AssetError

MAX_TARGETS: Final = 1024  # of a mesh


def parse_weights(text: str) -> tuple[float, ...]:
    """The numbers in a text, parted by spaces or commas; raises AssetError where one is none."""
    words = text.replace(",", " ").split()
    try:
        weights = tuple(float(word) for word in words)
    except ValueError:
        weights = (math.nan,)
    if len(weights) > MAX_TARGETS or not all(math.isfinite(weight) for weight in weights):
        raise AssetError(f"weights are at most {MAX_TARGETS} numbers parted by spaces, as '0.5 0 1', not {text[:60]!r}")
    return weights


def format_weights(weights: Sequence[float]) -> str:
    """The text that `parse_weights` reads; "" where all are 0."""
    return " ".join(f"{weight:.7g}" for weight in weights) if any(weights) else ""
