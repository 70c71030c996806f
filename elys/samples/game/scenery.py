"""What lies around the roads, to be looked at and never touched: a plain, trees, hills, the walls of a quarry, a city."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh, encode_mesh
from elys.common.assets.store import AssetStore
from elys.common.scene import EntityNode
from elys.samples.entities import group, material, rounded
from elys.samples.game.course import Color, Course

AROUND: Final = 45.0  # [m] beside the road that trees and towers stand in
PLAIN: Final = 4400.0  # [m] across
GREENS: Final = ((0.05, 0.16, 0.05), (0.07, 0.20, 0.05), (0.10, 0.18, 0.04))
FACADES: Final = ((0.08, 0.12, 0.19), (0.12, 0.14, 0.19), (0.12, 0.10, 0.14), (0.06, 0.11, 0.15))
FLOOR, BAY, WINDOW = 3.2, 2.3, 1.1  # [m] from window to window, up and aside, and how large they are
LIT: Final = 0.2  # of all windows
_SPOKES: Final = 72  # of what lies in a ring
Array = NDArray[np.float64]


class Site:
    """A course seen from above: where there is room beside it, and how deep the ground lies."""

    def __init__(self, course: Course, *, depth: float) -> None:
        """The ground is `depth` [m] below the lowest place of the road."""
        self._along = np.array([place.position for place in course.stations])
        low, high = self._along.min(axis=0), self._along.max(axis=0)
        self.ground = round(float(low[1]) - depth, 3)
        self.middle = (low + high)[[0, 2]] / 2.0
        self.radius = float(np.linalg.norm((high - low)[[0, 2]])) / 2.0
        self._low, self._high = low - AROUND, high + AROUND

    def somewhere(self, chance: random.Random) -> tuple[float, float, float]:
        """A place x, z, and its distance to the road [m]."""
        x, z = chance.uniform(self._low[0], self._high[0]), chance.uniform(self._low[2], self._high[2])
        return x, z, float(np.hypot(self._along[:, 0] - x, self._along[:, 2] - z).min())


def plain(site: Site, color: Color) -> EntityNode:
    """Flat ground to the horizon."""
    return EntityNode(
        name="Plain",
        components={
            "Transform": {"position": [0.0, round(site.ground - 0.5, 3), 0.0], "scale": [PLAIN, 1.0, PLAIN]},
            "MeshRenderer": {"mesh": "box", "cast_shadows": False},
            "Material": material(color, roughness=0.95),
        },
    )


def forest(site: Site, *, seed: int, trees: int) -> EntityNode:
    """Trees where the road does not lead over them."""
    chance = random.Random(seed)
    grown: list[EntityNode] = []
    while len(grown) < trees:
        x, z, distance = site.somewhere(chance)
        if distance >= 9.0:
            foot = (x, site.ground, z)
            grown.append(_tree(f"Tree {len(grown) + 1}", foot, chance.uniform(4.0, 8.5), chance.choice(GREENS)))
    return group("Forest", grown)


def _tree(name: str, foot: Sequence[float], height: float, tint: Color) -> EntityNode:
    parts = [
        ("Trunk", "cylinder", 0.18 * height, (0.09, 0.05, 0.03), 0.07),
        ("Crown", "cone", 0.85 * height, tint, 0.42),
    ]
    children = []
    base = 0.0
    for part, mesh, tall, color, wide in parts:
        children.append(
            EntityNode(
                name=part,
                components={
                    "Transform": {
                        "position": [0, round(base + tall / 2, 3), 0],
                        "scale": rounded((wide * height, tall, wide * height)),
                    },
                    "MeshRenderer": {"mesh": mesh},
                    "Material": material(color, roughness=0.9),
                },
            )
        )
        base += tall
    return group(name, children, position=rounded(foot))


def hills(site: Site, assets: AssetStore, *, seed: int, color: Color, height: float = 55.0) -> EntityNode:
    """Ridges behind one another, all around."""
    chance = random.Random(seed)
    rings = [(2.2, 0.0), (3.2, 0.3), (4.0, 0.08), (5.5, 0.7), (6.5, 0.35), (9.0, 1.0), (11.0, 0.0)]
    return _ring("Hills", site, assets, chance, [(1.6, 0.0), *rings], height=height, color=color, roughness=0.55)


def terraces(site: Site, assets: AssetStore, *, seed: int, color: Color, step: float = 9.0) -> EntityNode:
    """The walls of a pit, in steps."""
    chance = random.Random(seed)
    rings = [(1.55 + 0.22 * (number // 2), (number + 1) // 2) for number in range(8)]
    return _ring(
        "Terraces", site, assets, chance, [*rings, (4.0, rings[-1][1])], height=step, color=color, roughness=0.12
    )


def _ring(
    name: str,
    site: Site,
    assets: AssetStore,
    chance: random.Random,
    rings: Sequence[tuple[float, float]],
    *,
    height: float,
    color: Color,
    roughness: float,
) -> EntityNode:
    """Land around the middle of a site: radius [of the site's] and height [of `height`] of each ring, `roughness` being how
    much both differ from direction to direction.
    """
    wobble = [1.0 + chance.uniform(-0.08, 0.08) for _ in range(_SPOKES)]
    points = np.empty((len(rings), _SPOKES, 3))
    for number, (radius, rise) in enumerate(rings):
        for spoke in range(_SPOKES):
            angle = math.tau * spoke / _SPOKES
            far = site.radius * radius * wobble[spoke]
            up = height * rise * (1.0 + chance.uniform(-roughness, roughness))
            points[number, spoke] = (
                site.middle[0] + far * math.cos(angle),
                site.ground + 0.02 + up,
                site.middle[1] + far * math.sin(angle),
            )
    beside = np.roll(points, -1, axis=1)
    quads = np.stack([points[:-1], beside[:-1], beside[1:], points[1:]], axis=2).reshape(-1, 4, 3)
    shades = np.array([chance.uniform(0.85, 1.1) for _ in quads])[:, None] * np.asarray(color)
    return _seen(name, _faceted(quads, shades), assets, material((1.0, 1.0, 1.0), roughness=0.95))


def city(site: Site, assets: AssetStore, *, seed: int, towers: int = 90) -> EntityNode:
    """Towers on both sides of the road, higher where they stand farther from it, with a light here and there."""
    chance = random.Random(seed)
    built: list[tuple[float, float, float]] = []  # x, z, half the diagonal
    walls: list[Array] = []
    shades: list[Color] = []
    windows: list[Array] = []
    for _ in range(60 * towers):
        if len(built) == towers:
            break
        wide, deep = chance.uniform(8.0, 17.0), chance.uniform(8.0, 17.0)
        x, z, distance = site.somewhere(chance)
        half = math.hypot(wide, deep) / 2.0
        room = distance - half
        if room < 8.0 or any(math.hypot(x - a, z - b) < half + other for a, b, other in built):
            continue
        built.append((x, z, half))
        tall = chance.uniform(14.0, 34.0) + min(room, 30.0) * chance.uniform(0.2, 1.0)
        corners = [(x + a * wide / 2.0, z + b * deep / 2.0) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        color = chance.choice(FACADES)
        for side in range(4):
            a, b = corners[side], corners[(side + 1) % 4]
            walls.append(_wall(a, b, site.ground, site.ground + tall))
            shades.append(color)
            windows += _lit(a, b, site.ground, tall, chance)
        walls.append(np.array([(a, site.ground + tall, b) for a, b in corners]))
        shades.append(color)
    glow = {"base_color": [0.0, 0.0, 0.0], "emissive": [2.2, 1.35, 0.55], "roughness": 0.6}
    return group(
        "City",
        [
            _seen(
                "Towers", _faceted(np.array(walls), np.array(shades)), assets, material((1.0, 1.0, 1.0), roughness=0.5)
            ),
            _seen("Windows", _faceted(np.array(windows), np.ones((len(windows), 3))), assets, glow),
        ],
    )


def _wall(a: Sequence[float] | Array, b: Sequence[float] | Array, low: float, high: float) -> Array:
    """An upright quad from one corner to the next."""
    return np.array([(a[0], low, a[1]), (a[0], high, a[1]), (b[0], high, b[1]), (b[0], low, b[1])])


def _lit(a: Sequence[float], b: Sequence[float], ground: float, tall: float, chance: random.Random) -> list[Array]:
    """The windows of a wall in which light is."""
    along = np.subtract(b, a)
    length = float(np.linalg.norm(along))
    along /= length
    out = 0.05 * np.array([along[1], -along[0]])  # before the wall, so that neither hides the other
    count = int(length / BAY)
    found = []
    for floor in range(1, int(tall / FLOOR)):
        for bay in range(count):
            if chance.random() < LIT:
                middle = a + along * length * (bay + 0.5) / count + out
                low = ground + floor * FLOOR
                found.append(_wall(middle - along * WINDOW / 2, middle + along * WINDOW / 2, low, low + WINDOW))
    return found


def _faceted(quads: Array, colors: Array) -> Mesh:
    """Flat quads (n, 4, 3), each with a colour (n, 3)."""
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    first = 4 * np.arange(len(quads), dtype=np.uint32)[:, None]
    tinted = np.concatenate([colors, np.ones((len(colors), 1))], axis=1)
    return Mesh(
        positions=quads.reshape(-1, 3).astype(np.float32),
        normals=np.repeat(normals, 4, axis=0).astype(np.float32),
        uvs=np.zeros((4 * len(quads), 2), np.float32),
        colors=np.repeat(tinted, 4, axis=0).astype(np.float32),
        indices=(first + np.array([0, 1, 2, 0, 2, 3], np.uint32)).reshape(-1),
    )


def _seen(name: str, mesh: Mesh, assets: AssetStore, looks: dict[str, Any]) -> EntityNode:
    reference = assets.put(encode_mesh(mesh), kind="mesh")
    return EntityNode(name=name, components={"Transform": {}, "MeshRenderer": {"mesh": reference}, "Material": looks})
