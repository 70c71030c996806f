"""Light from all around as pictures: equirectangular maps, the upper row looks up, the middle column along -z, x to the right."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Radiance = NDArray[np.float32]
Color = tuple[float, float, float]

LUMINANCE: Final = (0.2126, 0.7152, 0.0722)
HORIZON_BLEND: Final = 0.03  # of the direction's height: ground and sky meet softly
# Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight" (1999), appendix A.2: coefficients A to E of the
# distribution of Y, x and y, each a linear function of turbidity.
_PEREZ: Final = np.array(
    [
        [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)],
        [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
        [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)],
    ]
)
_ZENITH_X: Final = np.array(
    [(0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394), (0.11693, -0.21196, 0.06052, 0.25886)]
)
_ZENITH_Y: Final = np.array(
    [(0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516), (0.15346, -0.26756, 0.06670, 0.26688)]
)
_SRGB_FROM_XYZ: Final = np.array(
    [(3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570)]
)  # IEC 61966-2-1
_HIGHEST_ANGLE: Final = np.radians(89.0)  # between zenith and sun: the model ends at the horizon


def map_directions(height: int) -> NDArray[np.float64]:
    """Unit directions (H, 2 H, 3) of the middles of a map's pixels."""
    polar = (np.arange(height) + 0.5) / height * np.pi
    around = ((np.arange(2 * height) + 0.5) / (2 * height) * 2.0 - 1.0) * np.pi
    sine = np.sin(polar)[:, None]
    return np.stack(
        [sine * np.sin(around), np.broadcast_to(np.cos(polar)[:, None], (height, 2 * height)), -sine * np.cos(around)],
        axis=-1,
    )


def solid_angles(height: int) -> NDArray[np.float64]:
    """Of each pixel of a map, by rows (H, 1) [sr]; all pixels together make 4 pi."""
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    return ((edges[:-1] - edges[1:]) * np.pi / height)[:, None]


def mean_radiance(radiance: Radiance) -> NDArray[np.float64]:
    """Over all directions (3,)."""
    weights = solid_angles(len(radiance))[..., None] / (4.0 * np.pi)
    return np.asarray((radiance * weights).sum(axis=(0, 1)))


def level_irradiance(radiance: Radiance) -> NDArray[np.float64]:
    """What falls on a level surface from above, per pi: the radiance (3,) of a white one."""
    cosine = np.maximum(map_directions(len(radiance))[..., 1:2], 0.0)
    return np.asarray((radiance * cosine * solid_angles(len(radiance))[..., None]).sum(axis=(0, 1)) / np.pi)


def gradient_sky(color: Color, height: int = 64) -> Radiance:
    """A sky of one colour: paler and brighter at the horizon, deeper above, half as bright below."""
    up = map_directions(height)[..., 1:2]
    tone = np.asarray(color)
    grey = float(np.dot(tone, LUMINANCE))
    horizon, zenith, nadir = (
        (tone * 0.6 + grey * 0.4) * 1.4,
        tone * (0.66, 0.75, 0.9),
        (tone * 0.45 + grey * 0.55) * 0.5,
    )
    below = np.clip(-up / 0.5, 0.0, 1.0)
    below = below * below * (3.0 - 2.0 * below)
    above = np.sqrt(np.maximum(up, 0.0))
    return np.where(up > 0.0, horizon + (zenith - horizon) * above, horizon + (nadir - horizon) * below).astype(
        np.float32
    )


def plain_sky(color: Color, height: int = 64) -> Radiance:
    """The same from everywhere."""
    return np.broadcast_to(np.asarray(color, np.float32), (height, 2 * height, 3)).copy()


def clear_sky(to_sun: NDArray[np.float64], turbidity: float, ground: Color, height: int = 128) -> Radiance:
    """Daylight without the sun itself, above a ground of that colour; a white level surface under it has the radiance 1."""
    directions = map_directions(height)
    up = directions[..., 1]
    cos_view = np.maximum(up, 0.01)
    sun_angle = min(float(np.arccos(np.clip(to_sun[1], -1.0, 1.0))), _HIGHEST_ANGLE)
    between = np.arccos(np.clip(directions @ to_sun, -1.0, 1.0))
    coefficients = _PEREZ @ (turbidity, 1.0)
    powers = np.array((turbidity**2, turbidity, 1.0))
    angles = np.array((sun_angle**3, sun_angle**2, sun_angle, 1.0))
    chi = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * sun_angle)
    zenith_luminance = max((4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192, 0.05)
    zenith = (zenith_luminance, powers @ _ZENITH_X @ angles, powers @ _ZENITH_Y @ angles)
    luminance, x, y = (
        value * _perez(row, cos_view, between) / _perez(row, np.float64(1.0), np.float64(sun_angle))
        for value, row in zip(zenith, coefficients, strict=True)
    )
    xyz = np.stack([x / y * luminance, luminance, (1.0 - x - y) / y * luminance], axis=-1)
    sky = np.maximum(xyz @ _SRGB_FROM_XYZ.T, 0.0)
    sky /= max(float(level_irradiance(np.where(up[..., None] > 0, sky, 0.0).astype(np.float32)) @ LUMINANCE), 1e-6)
    share = np.clip(up / HORIZON_BLEND + 0.5, 0.0, 1.0)[..., None]
    return np.asarray(sky * share + np.asarray(ground) * (1.0 - share), np.float32)


def _perez(c: NDArray[np.float64], cos_view: Any, between: Any) -> Any:
    """Perez' distribution F of the angle from the zenith and of that from the sun."""
    return (1.0 + c[0] * np.exp(c[1] / cos_view)) * (1.0 + c[2] * np.exp(c[3] * between) + c[4] * np.cos(between) ** 2)


def irradiance_harmonics(radiance: Radiance, map_from_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (9, 3) of irradiance per pi as a polynomial of the normal: 1, y, z, x, xy, yz, 3 z^2 - 1, xz, x^2 - y^2.

    Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps" (2001).
    """
    if len(radiance) < 64:  # the basis is taken in the middles of the pixels, which must be close
        repeats = -(-64 // len(radiance))
        radiance = radiance.repeat(repeats, axis=0).repeat(repeats, axis=1)
    while len(radiance) > 64:  # harmonics of second order see no details
        quarters = radiance[0::2, 0::2] + radiance[1::2, 0::2] + radiance[0::2, 1::2] + radiance[1::2, 1::2]
        radiance = np.asarray(quarters / 4, np.float32)
    height = len(radiance)
    basis = harmonic_basis(map_directions(height) @ map_from_world)
    weights = solid_angles(height)[..., None] * radiance
    projected = np.einsum("hwk,hwc->kc", basis, weights)
    # Convolved with the cosine, divided by pi: 1, 2/3, 1/4; and the basis' own constants a second time, for evaluation.
    bands = np.array((1.0, *(2 / 3,) * 3, *(1 / 4,) * 5))
    return np.asarray(projected * (bands * _CONSTANTS)[:, None])


_CONSTANTS: Final = np.array(
    (0.28209479, 0.48860251, 0.48860251, 0.48860251, 1.09254843, 1.09254843, 0.31539157, 1.09254843, 0.54627422)
)


def harmonic_basis(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Real spherical harmonics (..., 9) of unit vectors."""
    x, y, z = np.moveaxis(normal, -1, 0)
    one = np.ones_like(x)
    polynomials = (one, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y)
    return np.stack(polynomials, axis=-1) * _CONSTANTS
