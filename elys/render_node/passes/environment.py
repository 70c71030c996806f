"""Light from all around, made ready for surfaces: what each roughness mirrors of it, and its irradiance."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.directional_albedo import albedo_table
from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Texture
from elys.render_node.passes.backdrop import ScreenShader
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import Quality
from elys.render_node.radiance_files import fitted
from elys.render_node.resources import Resources
from elys.render_node.sky_models import irradiance_harmonics
from elys.render_node.surroundings import Surroundings

# Directions lie in squares side by side, one for each roughness 0, 0.1, ... 1: lower left corner and edge [texels], around
# each a border of one texel, so that filtering never leaves it.
TILES: Final = (
    *((1, 1, 256), (259, 1, 256), (517, 1, 128), (517, 131, 128), (647, 1, 64), (647, 67, 64), (647, 133, 64)),
    *((647, 199, 32), (681, 199, 32), (715, 199, 32), (749, 199, 32)),
)
ATLAS_SIZE: Final = (782, 258)
MAX_MAP_HEIGHT: Final = 1024
SAMPLES: Final = {True: 32, False: 192}  # of a smooth sky, and of pictures with small bright things
FEWER: Final = 4  # times as few where the processor draws for a window


class EnvironmentPass:
    """Keeps what it made while the surroundings stay the same."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._resources = resources
        self._quality = quality
        self._screen = ScreenShader(resources, "prefilter.frag")
        self._atlas: Framebuffer | None = None
        self._map: Texture | None = None
        self._table: Texture | None = None
        self.drawn: tuple[Any, ...] = ()
        self.harmonics: NDArray[np.float64] = np.zeros((9, 3))

    def is_needed(self, plan: PicturePlan) -> bool:
        """Whether anything of the surroundings lights or is seen, and is not ready yet."""
        around = plan.surroundings
        return (around.gives_light or around.is_seen) and self._asked(plan) != self.drawn

    def draw(self, plan: PicturePlan) -> None:
        """Makes the map, the squares of each roughness and the harmonics."""
        around, context = plan.surroundings, self._resources.context
        radiance = fitted(around.radiance(), min(MAX_MAP_HEIGHT, context.max_size // 2))
        height, width = radiance.shape[:2]
        pixels = np.ones((height, width, 4), np.float16)
        pixels[..., :3] = radiance
        self._map = Texture(context, (width, height), "rgba16f", data=pixels, mipmaps=True)
        self._map.wrap_around()
        if around.gives_light and not self._quality.samples_surroundings(plan.picture):
            self.harmonics = irradiance_harmonics(radiance, around.map_from_world) * around.light
            self._filter(around)
        self.drawn = self._asked(plan)

    def _asked(self, plan: PicturePlan) -> tuple[Any, ...]:
        return (*plan.surroundings.key, self._quality.samples_surroundings(plan.picture))

    def use(self, plan: PicturePlan) -> None:
        """Shows all of it to the passes that shade."""
        if self._quality.reads_albedo_table(plan.picture, surroundings=plan.surroundings.gives_light):
            self._show_table()
        if self._atlas is not None:
            self._atlas.colors[0].use(TEXTURE_UNITS["surroundings"])
        if self._map is not None:
            self._map.use(TEXTURE_UNITS["sky_map"])

    def _show_table(self) -> None:
        if self._table is None:
            table = albedo_table()
            self._table = Texture(self._resources.context, table.shape[1::-1], "rgba32f", data=table)
        self._table.use(TEXTURE_UNITS["albedo_table"])

    def _filter(self, around: Surroundings) -> None:
        context = self._resources.context
        program, triangle = self._screen.compiled()
        if self._atlas is None:
            self._atlas = Framebuffer(context, *ATLAS_SIZE, ("rgba32f",))
        assert self._map is not None
        self._map.use(TEXTURE_UNITS["sky_map"])
        context.set_state()
        program.set("map_from_world", around.map_from_world)
        program.set("light", around.light)
        program.set("sharper", 0.0 if self._quality.to_screen else 1.0)
        count = SAMPLES[around.is_smooth] // (FEWER if self._quality.to_screen else 1)
        for level, (x, y, edge) in enumerate(TILES):
            roughness = level / (len(TILES) - 1)
            self._atlas.use(region=(x - 1, y - 1, edge + 2, edge + 2))
            program.set("tile", (float(x), float(y), float(edge)))
            program.set("alpha", roughness * roughness)
            # The nearly perfect mirror has most texels, and so narrow a lobe that a few samples fill it.
            program.set("sample_count", (0, count // 3)[level] if level < 2 else count)
            triangle.draw()


@lru_cache(maxsize=1)
def mirror_tiles() -> NDArray[np.float32]:
    """(11, 4) for `frame.glsl`: lower left corner and edges of the squares, as shares of the texture."""
    width, height = ATLAS_SIZE
    return np.array([(x / width, y / height, edge / width, edge / height) for x, y, edge in TILES], np.float32)
