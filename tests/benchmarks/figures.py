"""Figures as the table shows them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def percentiles(values: Sequence[float], *, unit: str = "ms") -> str:
    """p50 / p99."""
    return f"{np.percentile(values, 50):.2f} / {np.percentile(values, 99):.2f} {unit}"
