"""Which of a scene's lights shine in a picture: all, up to what the uniform block has room for."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.render_world import PlacedLight

MOST_FURTHER_SUNS: Final = 7  # beside the one that has the maps of shadows
FEW_LAMPS: Final = 8  # up to so many are not looked at one by one
MOST_LAMPS: Final = 64  # with all else, well within the 16 KiB that GL 3.3 promises a block


class LeftOut(NamedTuple):
    """How many lights would shine in the picture if it had room for them."""

    suns: int = 0
    lamps: int = 0


NOBODY: Final = LeftOut()


class ShiningLights(NamedTuple):
    """The lights of a picture."""

    sun: PlacedLight | None  # the brightest that throws shadows; where none does, the brightest
    further_suns: list[PlacedLight]  # the others, which reach everything
    lamps: list[PlacedLight]  # in the scene's order, whoever looks from wherever
    sky_sun: PlacedLight | None  # the brightest, around which a clear sky is made
    left_out: LeftOut


def shining_lights(
    lights: list[PlacedLight], eye: NDArray[np.float64], planes: NDArray[np.float64], *, with_shadows: bool
) -> ShiningLights:
    """Chooses for a view with its eye there [m], whose space six planes (6, 4) enclose, relative to the eye; `with_shadows` where
    lamps may throw some.
    """
    suns: list[PlacedLight] = []
    lamps: list[PlacedLight] = []
    for placed in lights:
        if placed.light.intensity > 0.0:
            (suns if placed.light.kind == "directional" else lamps).append(placed)
    if len(suns) <= 1 and len(lamps) <= FEW_LAMPS:
        sun = suns[0] if suns else None
        return ShiningLights(sun, [], lamps, sun, NOBODY)
    suns.sort(key=lambda placed: -placed.light.intensity)
    brightest = suns[0] if suns else None
    sun = next((placed for placed in suns if placed.light.cast_shadows), brightest)
    further = [placed for placed in suns if placed is not sun]
    lamps, lamps_left = _lamps(lamps, eye, planes, with_shadows=with_shadows)
    left_out = LeftOut(len(further[MOST_FURTHER_SUNS:]), lamps_left)
    return ShiningLights(sun, further[:MOST_FURTHER_SUNS], lamps, brightest, left_out)


def by_light_at(lamps: list[PlacedLight], place: NDArray[np.float64]) -> NDArray[np.intp]:
    """The numbers of lamps, first of those that give most light to what is about a metre from a place; among equals in order."""
    intensity = np.array([placed.light.intensity for placed in lamps])
    offset = np.array([placed.position for placed in lamps]) - place
    return np.argsort(-intensity / (1.0 + np.einsum("ij,ij->i", offset, offset)), kind="stable")


def _lamps(
    lamps: list[PlacedLight], eye: NDArray[np.float64], planes: NDArray[np.float64], *, with_shadows: bool
) -> tuple[list[PlacedLight], int]:
    """Those that shine, and how many do not for want of room. Nobody misses those whose light ends outside the view, but as
    long as there is room they keep their part of the maps of shadows, lest it goes round as the eye turns.
    """
    if len(lamps) <= FEW_LAMPS:
        return lamps, 0
    offset = np.array([placed.position for placed in lamps]) - eye
    reach = np.array([placed.light.range or np.inf for placed in lamps])
    shines = (offset @ planes[:, :3].T + planes[:, 3]).min(axis=1) > -reach
    if with_shadows and len(lamps) <= MOST_LAMPS:
        shines |= [placed.light.cast_shadows for placed in lamps]
    shining = [lamps[number] for number in np.flatnonzero(shines)]
    if len(shining) <= MOST_LAMPS:
        return shining, 0
    chosen = np.sort(by_light_at(shining, eye)[:MOST_LAMPS])
    return [shining[number] for number in chosen], len(shining) - MOST_LAMPS
