"""How much of the light from everywhere a surface reflects: what the split sum of image-based light needs besides the light.

    specular = f0 * scale + bias        E(n.v, roughness) of the GGX lobe for Fresnel by Schlick, Karis (2013)
    diffuse  = 1 - f0 - (1 - f0) * lost        what Fresnel leaves to the layer below, over light from everywhere
    axis     = mix(normal, mirrored, share)    the mean direction of mirrored light: of rough surfaces nearer to the normal

Integrated with visible normals (Heitz, "Sampling the GGX Distribution of Visible Normals", 2018), whose weights are so even
that a regular grid is exact to less than a hundredth.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

SIZE: Final = (
    32  # entries along each axis: the first is 0, the last 1; along x the square root of n.v, along y roughness
)
_STEPS: Final = 20  # of the grid of an entry, along each axis
_STEEPEST: Final = 0.99  # n.v up to which the normal and the mirrored direction are told apart
_LEAST_ALPHA: Final = 1e-3  # as in brdf.glsl


@lru_cache(maxsize=1)
def albedo_table() -> NDArray[np.float32]:
    """(SIZE, SIZE, 4): rows by roughness, columns by the root of n.v; scale, bias, lost, share."""
    axis = np.linspace(0.0, 1.0, SIZE)
    cos_view = np.maximum(axis**2, 1e-4)
    table = np.ones((SIZE, SIZE, 4), np.float32)
    for row, roughness in enumerate(axis):
        table[row, :, :2] = specular_albedo(cos_view, roughness)
        table[row, :, 3] = lobe_share(cos_view, roughness)
    table[..., 2] = diffuse_loss(cos_view)
    return table


def specular_albedo(cos_view: NDArray[np.float64], roughness: float) -> NDArray[np.float64]:
    """Scale and bias (N, 2) of f0."""
    weight, view_half, _, _ = _lobe(cos_view, roughness)
    fresnel = (1.0 - view_half) ** 5
    return np.stack([(weight * (1.0 - fresnel)).mean(axis=(1, 2)), (weight * fresnel).mean(axis=(1, 2))], axis=-1)


def lobe_share(cos_view: NDArray[np.float64], roughness: float) -> NDArray[np.float64]:
    """Where between the normal (0) and the mirrored direction (1) the mean direction of mirrored light lies (N,)."""
    cosine = np.minimum(cos_view, _STEEPEST)
    weight, _, light_x, light_z = _lobe(cosine, roughness)
    x, z = (weight * light_x).mean(axis=(1, 2)), (weight * light_z).mean(axis=(1, 2))
    # (1 - share) (0, 1) + share (-sine, cosine) is along (x, z).
    return np.asarray(x / (x * (1.0 - cosine) - z * np.sqrt(1.0 - cosine**2)))


def _lobe(cos_view: NDArray[np.float64], roughness: float) -> tuple[NDArray[np.float64], ...]:
    """Samples (N, K, K) of the light that is mirrored: weights, v.h, and the light's direction in the plane of incidence,
    where the view is (sine, cosine).
    """
    alpha = max(roughness * roughness, _LEAST_ALPHA)
    middles = (np.arange(_STEPS) + 0.5) / _STEPS
    radius, angle = np.sqrt(middles)[:, None], middles[None, :] * np.pi  # the other half mirrors this one
    cosine = cos_view[:, None, None]
    sine = np.sqrt(1.0 - cosine * cosine)
    # The view in the space in which the surface is a hemisphere, and a disk across it.
    length = np.sqrt((alpha * sine) ** 2 + cosine**2)
    x, z = alpha * sine / length, cosine / length
    # Azimuths from the plane of incidence: sin on the axis within it, cos across it.
    across, within = radius * np.cos(angle - np.pi / 2), radius * np.sin(angle - np.pi / 2)
    within = (1.0 - 0.5 * (1.0 + z)) * np.sqrt(np.maximum(1.0 - across**2, 0.0)) + 0.5 * (1.0 + z) * within
    outward = np.sqrt(np.maximum(1.0 - across**2 - within**2, 0.0))
    half_x, half_y, half_z = (
        alpha * (x * outward - z * within),
        alpha * across,
        np.maximum(z * outward + x * within, 1e-9),
    )
    norm = np.sqrt(half_x**2 + half_y**2 + half_z**2)
    half_x, half_z = half_x / norm, half_z / norm
    view_half = np.clip(sine * half_x + cosine * half_z, 0.0, 1.0)
    cos_light = 2.0 * view_half * half_z - cosine
    lit = np.maximum(cos_light, 1e-9)
    towards_view = lit * np.sqrt(cosine**2 * (1.0 - alpha**2) + alpha**2)
    towards_light = cosine * np.sqrt(lit**2 * (1.0 - alpha**2) + alpha**2)
    masked_once = 2.0 * cosine / (cosine + np.sqrt(cosine**2 * (1.0 - alpha**2) + alpha**2))
    weight = np.where(cos_light > 0.0, 2.0 * lit * cosine / (towards_view + towards_light) / masked_once, 0.0)
    return weight, view_half, 2.0 * view_half * half_x - sine, cos_light


def diffuse_loss(cos_view: NDArray[np.float64]) -> NDArray[np.float64]:
    """Schlick's (1 - v.h)^5 (N,), averaged over light from everywhere by its cosine."""
    middles = (np.arange(2 * _STEPS) + 0.5) / (2 * _STEPS)
    radius, angle = np.sqrt(middles)[:, None], middles[None, :] * np.pi
    light_x, light_z = radius * np.cos(angle), np.sqrt(1.0 - radius**2)
    cosine = cos_view[:, None, None]
    between = np.sqrt(1.0 - cosine**2) * light_x + cosine * light_z
    # The half vector halves the angle between view and light.
    view_half = np.sqrt(np.clip((1.0 + between) / 2.0, 0.0, 1.0))
    return np.asarray(((1.0 - view_half) ** 5).mean(axis=(1, 2)))
