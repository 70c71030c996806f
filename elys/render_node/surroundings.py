"""What surrounds a scene, decided before OpenGL hears of it: light from around, and what is seen behind everything.

Environment component, or background and ambient light ──> Surroundings (a map of radiance) ──> passes/environment.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Environment
from elys.common.math import quaternion
from elys.common.scene import SceneSettings
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.sky_models import (
    Color,
    Radiance,
    clear_sky,
    gradient_sky,
    mean_radiance,
    plain_sky,
)

BLACK: Final = (0.0, 0.0, 0.0)
SUN_STEP: Final = 0.01  # of the sun's direction, by which the sky changes
HIGH_SUN: Final = (0.48, 0.64, 0.6)  # where a clear sky has its sun when the scene has none
_LEAST: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Light from far away in every direction. Equal keys mean equal light."""

    key: tuple[Any, ...]
    radiance: Callable[
        [], Radiance
    ]  # (H, 2 H, 3), as `sky_models` has maps; slow, so asked for only when the key is new
    light: Color  # what the map is multiplied with where it lights
    shown: Color  # and where it is seen
    map_from_world: NDArray[np.float64]  # (3, 3)
    is_smooth: bool  # has nothing small and bright in it

    @property
    def gives_light(self) -> bool:
        """Whether surfaces get anything of it."""
        return any(self.light)

    @property
    def is_seen(self) -> bool:
        """Whether it is anything but black behind everything."""
        return any(self.shown)


def surroundings_of(
    settings: SceneSettings,
    environment: Environment | None,
    rotation: NDArray[np.float64],
    to_sun: NDArray[np.float64] | None,
    assets: DrawableAssets,
) -> Surroundings:
    """What surrounds a scene with these settings and this environment, turned by `rotation` (4,), under that sun."""
    if environment is None:
        return _of_colors(settings)
    intensity = environment.intensity
    color = _times(environment.color, intensity)
    shown = color if environment.visible else BLACK
    if environment.kind == "sky":
        sun = tuple(_stepped(to_sun).tolist())
        key = ("sky", sun, environment.turbidity, environment.ground_color)
        return Surroundings(
            key=(*key, color),
            radiance=lambda: clear_sky(np.array(sun), environment.turbidity, environment.ground_color),
            light=color,
            shown=shown,
            map_from_world=np.eye(3),
            is_smooth=False,
        )
    if environment.kind == "image" and environment.image:
        radiance = assets.radiance(environment.image)
        if radiance is None:
            return _of_colors(settings)  # until it comes, and where it cannot be had
        turned = tuple(np.round(rotation, 6).tolist())
        return Surroundings(
            key=("image", environment.image, turned, color),
            radiance=lambda: radiance,
            light=color,
            shown=shown,
            map_from_world=np.asarray(quaternion.to_matrix(rotation).T, np.float64),
            is_smooth=False,
        )
    return _even(color, shown)


def _even(light: Color, shown: Color) -> Surroundings:
    return Surroundings(
        key=("color", light),
        radiance=lambda: plain_sky((1.0, 1.0, 1.0)),
        light=light,
        shown=shown,
        map_from_world=np.eye(3),
        is_smooth=True,
    )


def _of_colors(settings: SceneSettings) -> Surroundings:
    """A sky of the background's colour, which lights as much as the ambient light says: its mean radiance is that. Before black
    the ambient light is the same from everywhere.
    """
    background, ambient = settings.background, settings.ambient
    if not any(background):
        return _even(ambient, BLACK)
    red, green, blue = (a / max(m, _LEAST) for a, m in zip(ambient, _gradient_mean(background), strict=True))
    return Surroundings(
        key=("colors", background, ambient),
        radiance=lambda: gradient_sky(background),
        light=(red, green, blue),
        shown=(1.0, 1.0, 1.0),
        map_from_world=np.eye(3),
        is_smooth=True,
    )


@lru_cache(maxsize=16)
def _gradient_mean(color: Color) -> Color:
    red, green, blue = mean_radiance(gradient_sky(color, 32)).tolist()
    return red, green, blue


def _stepped(to_sun: NDArray[np.float64] | None) -> NDArray[np.float64]:
    direction = np.array(HIGH_SUN) if to_sun is None else to_sun
    stepped = np.round(direction / SUN_STEP) * SUN_STEP
    return np.asarray(stepped / max(float(np.linalg.norm(stepped)), _LEAST))


def _times(color: Color, factor: float) -> Color:
    return color[0] * factor, color[1] * factor, color[2] * factor
