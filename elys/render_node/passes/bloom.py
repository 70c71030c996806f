"""Light that lens and eye scatter around what is bright."""

from __future__ import annotations

from typing import Final

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer
from elys.render_node.passes.backdrop import ScreenShader
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Resources

LEVELS: Final = 6
SPREAD: Final = 0.6  # share of each smaller picture in the one twice as large
LEAST_EDGE: Final = 8  # [pixels]


class BloomPass:
    """Mixes a share of ever smaller, softer pictures of the light into it: energy is spread, none is added."""

    def __init__(self, resources: Resources) -> None:
        self._context = resources.context
        self._halve = ScreenShader(resources, "halve.frag")
        self._widen = ScreenShader(resources, "widen.frag")
        self._levels: list[Framebuffer] = []
        self._size = (0, 0)

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether the scene asks for it."""
        return plan.picture.bloom > 0.0

    def draw(self, plan: PicturePlan, light: Framebuffer) -> None:
        """Changes a picture's linear light."""
        self._fit(light.width, light.height)
        context = self._context
        context.set_state()
        source = light
        for level in self._levels:
            level.use(depth_write=False)
            source.colors[0].use(TEXTURE_UNITS["picture"])
            self._halve.compiled()[1].draw()
            source = level
        context.set_state(blend="over")
        for level in reversed(self._levels[:-1]):
            self._mix(source, level, SPREAD)
            source = level
        self._mix(source, light, plan.picture.bloom)

    def _mix(self, source: Framebuffer, target: Framebuffer, share: float) -> None:
        program, triangle = self._widen.compiled()
        program.set("share", share)
        target.use(depth_write=False)
        source.colors[0].use(TEXTURE_UNITS["picture"])
        triangle.draw()

    def _fit(self, width: int, height: int) -> None:
        if self._size == (width, height):
            return
        self._size, self._levels = (width, height), []
        while (len(self._levels) < LEVELS and min(width, height) >= 2 * LEAST_EDGE) or not self._levels:
            width, height = max(width // 2, 1), max(height // 2, 1)
            self._levels.append(Framebuffer(self._context, width, height, ("rgba16f",)))
