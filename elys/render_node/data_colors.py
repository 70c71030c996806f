"""Values of the views of data as colours that people can look at."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.passes.data import DataKind

Pixels = NDArray[np.uint8]

# Overdraw 0, 1, 2, 4, 8, 16 and more.
_HEAT: Final = np.array(
    [(0, 0, 0), (25, 45, 130), (25, 130, 110), (200, 190, 50), (215, 70, 40), (255, 255, 255)], float
)


def display_from_linear(linear: NDArray[np.floating]) -> Pixels:
    """sRGB of linear values. IEC 61966-2-1."""
    light = np.clip(linear, 0.0, 1.0)
    encoded = np.where(light <= 0.0031308, light * 12.92, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(encoded * 255.0), np.uint8)


def data_pixels(values: NDArray[Any], kind: DataKind, *, depth_unit: float = 1.0) -> Pixels:
    """RGB (H, W, 3) of the values (H, W, C) of a view. Depth gets darker with distance, half as bright at `depth_unit` [m]."""
    match kind:
        case "normals":
            seen = (values != 0.0).any(axis=-1, keepdims=True)
            return np.asarray(np.rint(np.where(seen, values * 0.5 + 0.5, 0.0) * 255.0), np.uint8)
        case "albedo" | "wireframe":
            return display_from_linear(values)
        case "roughness":
            return _grey(values)
        case "depth":
            return _grey(depth_unit / (depth_unit + np.maximum(values, 0.0)))
        case "entity":
            return entity_colors(values[..., 0])
        case "overdraw":
            return _heat(values[..., 0])


def depth_unit_of(values: NDArray[np.float32]) -> float:
    """A distance [m] typical of depths; 1 where nothing is seen."""
    seen = values[np.isfinite(values)]
    return max(float(np.median(seen)), 1e-3) if len(seen) else 1.0


def _grey(values: NDArray[np.floating]) -> Pixels:
    return np.repeat(np.asarray(np.rint(np.clip(values, 0.0, 1.0) * 255.0), np.uint8), 3, axis=-1)


def entity_colors(entity: NDArray[np.uint32]) -> Pixels:
    """A colour (..., 3) for each id, the same in all pictures, neighbours far apart; black for none."""
    ids, place = np.unique(entity, return_inverse=True)
    mixed = ids.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)  # Fibonacci hashing (Knuth 6.4): evenly spread
    parts = [(mixed >> np.uint64(shift)) & np.uint64(0xFFFF) for shift in (48, 32, 16)]
    hue, strength, brightness = (part.astype(np.float64) / 65535.0 for part in parts)
    hues = np.clip(np.abs((hue[:, None] * 6.0 + np.array((0.0, 4.0, 2.0))) % 6.0 - 3.0) - 1.0, 0.0, 1.0)
    strength, brightness = 0.5 + 0.4 * strength, 0.65 + 0.35 * brightness
    colors = brightness[:, None] * (1.0 - strength[:, None] * (1.0 - hues))
    colors[ids == 0] = 0.0
    return np.asarray(np.rint(colors * 255.0), np.uint8)[place.reshape(entity.shape)]


def _heat(counts: NDArray[np.float32]) -> Pixels:
    step = np.where(counts < 1.0, counts, 1.0 + np.log2(np.maximum(counts, 1.0)))
    channels = [np.interp(step, np.arange(len(_HEAT)), _HEAT[:, channel]) for channel in range(3)]
    return np.asarray(np.rint(np.stack(channels, axis=-1)), np.uint8)
