"""Light that lens and eye scatter around what is bright."""

from __future__ import annotations

import math
from typing import Final

from elys.render_node.camera import Region
from elys.render_node.gpu import TEXTURE_UNITS, Context, Framebuffer
from elys.render_node.passes.backdrop import ScreenShader
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Resources

LEVELS: Final = 6
SPREAD: Final = 0.6  # share of each smaller picture in the one twice as large
LEAST_EDGE: Final = 8  # [pixels]
BLOOM_REACH: Final = (
    4  # [pixels] that halve.frag looks around: of what is farther away the halves of the whole picture tell
)
WHOLE: Final = (0.5, 0.5, 0.5, 0.5)  # from -1..1 over what is drawn to 0..1 over what is read


class Glow:
    """Ever smaller pictures of the light of one picture, the largest half as large as it."""

    def __init__(self, context: Context, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.levels: list[Framebuffer] = []
        while (len(self.levels) < LEVELS and min(width, height) >= 2 * LEAST_EDGE) or not self.levels:
            width, height = max(width // 2, 1), max(height // 2, 1)
            self.levels.append(Framebuffer(context, width, height, ("rgba16f",)))


class BloomPass:
    """Mixes a share of ever smaller, softer pictures of the light into it: energy is spread, none is added.

    Of a picture that is drawn in parts `gather` takes the light of one after the other; when `spread` has softened it, it is
    mixed into each part.
    """

    def __init__(self, resources: Resources) -> None:
        self._context = resources.context
        self._halve = ScreenShader(resources, "halve.frag")
        self._widen = ScreenShader(resources, "widen.frag")
        self._glow: Glow | None = None

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether the scene asks for it."""
        return plan.picture.bloom > 0.0

    def draw(self, plan: PicturePlan, light: Framebuffer) -> None:
        """Changes the linear light of a whole picture."""
        if self._glow is None or (self._glow.width, self._glow.height) != (light.width, light.height):
            self._glow = Glow(self._context, light.width, light.height)
        self._shrink(light, self._glow.levels[0])
        self.spread(self._glow)
        self._mix(self._glow.levels[0], light, plan.picture.bloom)

    def gather(self, glow: Glow, light: Framebuffer, drawn: Region, kept: Region) -> None:
        """Puts the light of a part of a picture, the regions of which count from the upper left, into its place."""
        first = glow.levels[0]
        x, width, column, columns = _halved(glow.width, first.width, drawn[0], drawn[2], kept[0], kept[2])
        below, kept_below = (glow.height - region[1] - region[3] for region in (drawn, kept))
        y, height, row, rows = _halved(glow.height, first.height, below, drawn[3], kept_below, kept[3])
        if columns > 0 and rows > 0:
            self._shrink(light, first, region=(column, row, columns, rows), place=(width, height, x, y))

    def spread(self, glow: Glow) -> None:
        """Makes the smaller ones of the largest, and lets all of them shine into it."""
        for source, target in zip(glow.levels, glow.levels[1:], strict=False):
            self._shrink(source, target)
        for target, source in zip(glow.levels[-2::-1], glow.levels[:0:-1], strict=True):
            self._mix(source, target, SPREAD)

    def mix_into(self, plan: PicturePlan, light: Framebuffer, glow: Glow, drawn: Region) -> None:
        """Changes the linear light of a part of a picture, whose region counts from the upper left."""
        x, y, width, height = drawn
        shares = (width / glow.width / 2.0, height / glow.height / 2.0)
        corner = (x / glow.width, (glow.height - y - height) / glow.height)
        source = (*shares, corner[0] + shares[0], corner[1] + shares[1])
        self._mix(glow.levels[0], light, plan.picture.bloom, source=source)

    def _shrink(
        self,
        source: Framebuffer,
        target: Framebuffer,
        *,
        region: tuple[int, int, int, int] | None = None,
        place: tuple[float, float, float, float] = WHOLE,
    ) -> None:
        program, triangle = self._halve.compiled()
        program.set("source_from_place", place)
        target.use(depth_write=False, region=region)
        source.colors[0].use(TEXTURE_UNITS["picture"])
        self._context.set_state()
        triangle.draw()

    def _mix(
        self,
        glow: Framebuffer,
        target: Framebuffer,
        share: float,
        *,
        source: tuple[float, float, float, float] = WHOLE,
    ) -> None:
        program, triangle = self._widen.compiled()
        program.set("share", share)
        program.set("source_from_place", source)
        target.use(depth_write=False)
        glow.colors[0].use(TEXTURE_UNITS["picture"])
        self._context.set_state(blend="over")
        triangle.draw()


def _halved(
    whole: int, half: int, drawn: int, drawn_length: int, kept: int, kept_length: int
) -> tuple[float, float, int, int]:
    """Along one axis, for the texels of the half whose middles lie in what is kept of a part: what is added and the factor that
    lead from -1..1 over them to 0..1 over what is drawn; the first of them and how many.
    """
    first, last = (math.ceil(end * half / whole - 0.5) for end in (kept, kept + kept_length))
    factor = (last - first) / 2.0 * whole / (half * drawn_length)
    return ((first + last) / 2.0 * whole / half - drawn) / drawn_length, factor, first, last - first
