"""What a surface reflects of light from everywhere, integrated by chance from the formulas of glTF 2.0, appendix B."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.reference.traced_pictures import Array, Surface, scattered, unit


def directions_by_cosine(count: int, seed: int) -> Array:
    """Unit vectors (N, 3) about +y, as many as the cosine is high: a density of cos / pi."""
    first, second = np.random.default_rng(seed).random((2, count))
    radius, turn = np.sqrt(first), 2 * np.pi * second
    return np.stack([radius * np.cos(turn), np.sqrt(1 - first), radius * np.sin(turn)], axis=-1)


def directions_by_facets(count: int, alpha: float, to_view: Any, seed: int) -> tuple[Array, Array]:
    """Mirror directions (N, 3) of facets spread as GGX says about +y, and their density."""
    first, second = np.random.default_rng(seed).random((2, count))
    tangent = alpha * np.sqrt(first / (1 - first))
    cosine = 1 / np.sqrt(1 + tangent**2)
    sine, turn = tangent * cosine, 2 * np.pi * second
    facets = np.stack([sine * np.cos(turn), cosine, sine * np.sin(turn)], axis=-1)
    between = facets @ np.asarray(to_view)
    spread = alpha**2 * cosine / (np.pi * (1 + cosine**2 * (alpha**2 - 1)) ** 2)
    return unit(2 * between[:, None] * facets - to_view), spread / (4 * np.maximum(np.abs(between), 1e-9))


def reflected_radiance(
    to_view: Any, surface: Surface, light_from: Callable[[Array], Array], *, count: int = 150_000, seed: int = 1
) -> NDArray[np.float64]:
    """Radiance (3,) towards `to_view` of a level surface under `light_from`, which gives radiance (N, 3) by direction.

    Half the samples go by the cosine, half by the facets; the balance heuristic weighs them (Veach, 1995).
    """
    to_view = unit(to_view)
    alpha = max(float(surface.roughness) ** 2, 1e-3)
    by_facets, _ = directions_by_facets(count, alpha, to_view, seed)
    lights = np.concatenate([directions_by_cosine(count, seed + 1), by_facets])
    half = unit(lights + to_view)
    cosine = np.maximum(half[:, 1], 1e-9)
    spread = alpha**2 * cosine / (np.pi * (1 + cosine**2 * (alpha**2 - 1)) ** 2)
    density = np.maximum(lights[:, 1], 0) / np.pi + spread / (4 * np.maximum(np.abs(half @ to_view), 1e-9))
    normal = np.broadcast_to((0.0, 1.0, 0.0), lights.shape)
    values = scattered(normal, np.broadcast_to(to_view, lights.shape), lights, surface) * light_from(lights)
    return np.asarray((values / density[:, None]).sum(axis=0) / count)
