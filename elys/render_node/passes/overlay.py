"""Overlays: what the scene writes over the finished picture, below nothing but the letters of debug drawing."""

from __future__ import annotations

from typing import Final

import numpy as np

from elys.render_node.camera import Region, View
from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Texture
from elys.render_node.overlay_quads import QUAD_WIDTH, QuadMaker
from elys.render_node.overlays import Overlays
from elys.render_node.passes.strips import Strips
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Resources

_SHADERS: Final = ("overlay.vert", "overlay.frag", ())


class OverlayPass:
    """Rectangles in the order of the overlays, as many at once as show no image or the same."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._strips = Strips(resources)
        self._maker = QuadMaker()
        self._sheet: tuple[Texture, int] | None = None  # on the card, as of a version

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether the scene has any that are switched on."""
        return bool(plan.overlays)

    def draw(self, plan: PicturePlan, whole: View, region: Region | None, target: Framebuffer) -> None:
        """Draws over `target`, which is the picture of the view `whole` or a region of it."""
        self._resources.overlay_images.begin(plan.world.assets)
        self.draw_over(plan.overlays, whole, region, target)

    def draw_over(self, overlays: Overlays, whole: View, region: Region | None, target: Framebuffer) -> None:
        """Likewise for overlays of no scene."""
        images = self._resources.overlay_images
        quads = self._maker.quads(overlays, whole, images.size)
        if not len(quads.rows):
            return
        self._strips.write(quads.rows.reshape(-1, QUAD_WIDTH // 4, 4).reshape(-1, 4))
        target.use(depth_write=False)
        self._resources.context.set_state(blend="over")
        program = self._strips.program(_SHADERS)
        program.set("picture_size", (float(target.width), float(target.height)))
        corner = np.zeros(2) if region is None else np.array(region[:2], np.float64)
        program.set("picture_corner", (float(corner[0]), float(corner[1])))
        self._show_sheet()
        for run in quads.runs:
            if run.image:
                images.use(run.image)
            program.set("first", run.first)
            self._strips.draw(_SHADERS, run.length)

    def _show_sheet(self) -> None:
        sheet, edge = self._maker.sheet, len(self._maker.sheet.texels)
        if self._sheet is None or self._sheet[0].size[0] != edge:
            texture = Texture(self._resources.context, (edge, edge), "r8", data=sheet.texels)
            self._sheet = (texture, sheet.version)
        elif self._sheet[1] != sheet.version:
            self._sheet[0].write(sheet.texels)
            self._sheet = (self._sheet[0], sheet.version)
        self._sheet[0].use(TEXTURE_UNITS["glyph_sheet"])
