"""What a picture should be, by casting a ray through each pixel's middle at exact shapes: glTF 2.0, appendix B, in numpy.

Nothing here knows of meshes, matrices or shadow maps. Directions are unit vectors (..., 3), radiance is linear.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Surface(NamedTuple):
    """A material's numbers, for all points alike or one a point (..., 1)."""

    color: Any
    metallic: Any
    roughness: Any


class Sphere(NamedTuple):
    centre: tuple[float, float, float]
    radius: float
    surface: Surface


class Block(NamedTuple):
    """A box along the axes."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    surface: Surface


class Seen(NamedTuple):
    """Of each pixel: the radiance, what was hit (-1: nothing), whether the sun reaches it, cosine of the angle of view."""

    light: Array  # (H, W, 3)
    hit: NDArray[np.intp]
    lit: NDArray[np.bool_]
    facing: Array
    unshadowed: Array  # (H, W, 3): the radiance if nothing stood in the way of light


def along(vectors: Any, others: Any) -> Array:
    """Dot products (..., 1)."""
    return np.sum(np.multiply(vectors, others), axis=-1, keepdims=True)


def unit(vectors: Any) -> Array:
    vectors = np.asarray(vectors, float)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def scattered(normal: Any, to_view: Any, to_light: Any, surface: Surface) -> Array:
    """BRDF times cosine (..., 3): GGX, Smith's joint masking and shadowing, Schlick; dielectric and metal mixed."""
    half = unit(np.add(to_view, to_light))
    cos_light, cos_view = along(normal, to_light), along(normal, to_view)
    cos_half, cos_between = along(normal, half), along(to_view, half)
    visible = (cos_light > 0) & (cos_view > 0)
    cos_light, cos_view = np.maximum(cos_light, 1e-9), np.maximum(cos_view, 1e-9)
    alpha = np.square(surface.roughness)
    facets = alpha**2 / (np.pi * (1 + cos_half**2 * (alpha**2 - 1)) ** 2)

    def smith(cosine: Array) -> Array:
        tangent = np.sqrt(1 - np.minimum(cosine, 1) ** 2) / cosine
        return (np.sqrt(1 + (alpha * tangent) ** 2) - 1) / 2

    specular = facets / (1 + smith(cos_light) + smith(cos_view)) / (4 * cos_light * cos_view)
    schlick = (1 - np.clip(cos_between, 0, 1)) ** 5
    color = np.asarray(surface.color)
    dielectric = 0.04 + 0.96 * schlick
    both = (1 - surface.metallic) * ((1 - dielectric) * color / np.pi + dielectric * specular)
    both = both + surface.metallic * (color + (1 - color) * schlick) * specular
    return np.where(visible, both * cos_light, 0.0)


def rays(size: int, field_of_view: float, rotation: Array) -> Array:
    """Directions (H, W, 3) through the middles of the pixels of a square picture, the upper row first."""
    steps = (2 * np.arange(size) + 1) / size - 1
    reach = np.tan(field_of_view / 2)
    x, y = np.meshgrid(steps * reach, -steps * reach)
    return unit(np.stack([x, y, -np.ones_like(x)], axis=-1) @ np.asarray(rotation).T)


def distance_to(shape: Sphere | Block, origin: Any, direction: Array) -> Array:
    """How far (...,) a ray goes until it meets the shape from outside, inf if it does not."""
    if isinstance(shape, Sphere):
        offset = np.asarray(origin) - shape.centre
        b = along(offset, direction)[..., 0]
        inside = b * b - along(offset, offset)[..., 0] + shape.radius**2
        reached = -b - np.sqrt(np.maximum(inside, 0))
        return np.where((inside > 0) & (reached > 1e-7), reached, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (shape.lower - np.asarray(origin)) / direction, (shape.upper - np.asarray(origin)) / direction
    enters, leaves = np.fmin(first, second).max(axis=-1), np.fmax(first, second).min(axis=-1)
    return np.where((enters <= leaves) & (enters > 1e-7), enters, np.inf)


def normal_at(shape: Sphere | Block, points: Array) -> Array:
    if isinstance(shape, Sphere):
        return unit(points - shape.centre)
    lower, upper = np.asarray(shape.lower), np.asarray(shape.upper)
    offset = (points - (lower + upper) / 2) / (upper - lower)
    axis = np.abs(offset).argmax(axis=-1)[..., None]
    normal = np.zeros_like(points)
    np.put_along_axis(normal, axis, np.sign(np.take_along_axis(offset, axis, axis=-1)), axis=-1)
    return normal


def traced(
    shapes: list[Sphere | Block],
    directions: Array,
    eye: Any,
    *,
    sun: tuple[Any, float],
    bulbs: list[tuple[Any, float]] = (),  # type: ignore[assignment]
    shadows: bool = True,
) -> Seen:
    """The picture: `sun` is the way its light goes and its illuminance [lx], `bulbs` are places and intensities [cd]."""
    reach = np.stack([distance_to(shape, eye, directions) for shape in shapes])
    hit = np.where(np.isfinite(reach.min(axis=0)), reach.argmin(axis=0), -1)
    light, unshadowed = np.zeros(directions.shape), np.zeros(directions.shape)
    lit, facing = np.zeros(hit.shape, bool), np.zeros(hit.shape)
    to_sun = -unit(sun[0])
    for index, shape in enumerate(shapes):
        here = hit == index
        points = np.asarray(eye) + directions[here] * reach[index][here][:, None]
        normal, to_view = normal_at(shape, points), -directions[here]
        raised = points + normal * 1e-5
        reached = along(normal, to_sun)[..., 0] > 0
        if shadows:
            towards = np.broadcast_to(to_sun, points.shape)
            for other in shapes:
                reached &= ~np.isfinite(distance_to(other, raised, towards))
        sunlight = scattered(normal, to_view, np.broadcast_to(to_sun, points.shape), shape.surface) * sun[1]
        lamps = np.zeros_like(sunlight)
        for place, intensity in bulbs:
            offset = np.asarray(place) - points
            squared = along(offset, offset)
            lamps += scattered(normal, to_view, offset / np.sqrt(squared), shape.surface) * intensity / squared
        light[here] = np.where(reached[:, None], sunlight, 0.0) + lamps
        unshadowed[here] = sunlight + lamps
        lit[here], facing[here] = reached, along(normal, to_view)[..., 0]
    return Seen(light, hit, lit, facing, unshadowed)


def traced_by_lamp(
    shapes: list[Sphere | Block], directions: Array, eye: Any, place: Any, intensity: float, cone: float
) -> Seen:
    """The picture by one bulb [cd] that throws shadows; `lit` says whether it reaches what is seen. What is more than `cone`
    [rad] off the way from the bulb to the world's origin counts as not hit.
    """
    reach = np.stack([distance_to(shape, eye, directions) for shape in shapes])
    hit = np.where(np.isfinite(reach.min(axis=0)), reach.argmin(axis=0), -1)
    light, unshadowed = np.zeros(directions.shape), np.zeros(directions.shape)
    lit, facing = np.zeros(hit.shape, bool), np.zeros(hit.shape)
    for index, shape in enumerate(shapes):
        here = hit == index
        points = np.asarray(eye) + directions[here] * reach[index][here][:, None]
        normal, to_view = normal_at(shape, points), -directions[here]
        offset = np.asarray(place) - points
        away = np.sqrt(along(offset, offset))
        reached = along(normal, offset)[..., 0] > 0
        for other in shapes:
            reached &= distance_to(other, points + normal * 1e-5, offset / away) > away[:, 0]
        full = scattered(normal, to_view, offset / away, shape.surface) * intensity / away**2
        light[here], unshadowed[here] = np.where(reached[:, None], full, 0.0), full
        lit[here], facing[here] = reached, along(normal, to_view)[..., 0]
        off = np.arccos(np.clip(along(offset / away, unit(place))[..., 0], -1, 1))
        hit[here] = np.where(off < cone, index, -1)
    return Seen(light, hit, lit, facing, unshadowed)


def shrunk(mask: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """A mask without its outermost pixels, so many times."""
    for _ in range(steps):
        padded = np.pad(mask, 1, constant_values=True)
        mask = mask & padded[2:, 1:-1] & padded[:-2, 1:-1] & padded[1:-1, 2:] & padded[1:-1, :-2]
    return mask


def relative_errors(picture: NDArray[np.floating[Any]], truth: Array, counted: NDArray[np.bool_]) -> Array:
    """The worst channel's error of each counted pixel, relative to the pixel's brightest channel where that is above 0.02."""
    bright = truth.max(axis=-1)
    chosen = counted & (bright > 0.02)
    return np.asarray(np.abs(picture - truth).max(axis=-1)[chosen] / bright[chosen])


def wrong_shadow_reach(picture: NDArray[np.floating[Any]], seen: Seen, ground: int, *, farthest: int = 8) -> int:
    """How far [pixels] from the true edge of a shadow on shape `ground` the farthest pixel is that is lit where there should be
    shadow or the other way round: 0 if there is none, `farthest` + 1 if it is farther.
    """
    shines = picture.max(axis=-1) > 0.5 * seen.unshadowed.max(axis=-1)
    near_others = ~shrunk(seen.hit == ground, 3)
    wrong = (shines != seen.lit) & ~near_others
    for steps in range(farthest + 1):
        if not wrong.any():
            return steps
        # What is left after so many steps is deep inside light or shadow.
        wrong = wrong & (shrunk(seen.lit, steps + 1) | shrunk(~seen.lit, steps + 1))
    return farthest + 1
