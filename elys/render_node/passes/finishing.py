"""The passes over the finished light: to the screen's colours, and marks on top."""

from __future__ import annotations

from typing import Final

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Program
from elys.render_node.instances import Batch
from elys.render_node.passes.backdrop import ScreenShader
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import tone_defines
from elys.render_node.resources import Geometry, Resources

OUTLINE_COLOR = (1.0, 0.55, 0.1, 1.0)  # sRGB and opacity
FXAA_REACH: Final = 6  # [pixels] that fxaa.frag looks along an edge, and a neighbour of the last one


class TonemapPass:
    """Exposed linear light to sRGB, highlights brought down as the scene wants it. Needed unless passes did so already."""

    def __init__(self, resources: Resources) -> None:
        self._context = resources.context
        self._screen = ScreenShader(resources, "tonemap.frag")

    def draw(self, plan: PicturePlan, light: Framebuffer, target: Framebuffer) -> None:
        """Fills `target` from the light of a picture of the same size."""
        target.use(depth_write=False)
        self._context.set_state()
        light.colors[0].use(TEXTURE_UNITS["picture"])
        self._screen.compiled(tone_defines(plan.picture))[1].draw()


class FxaaPass:
    """Smooths the edges of what is otherwise finished."""

    def __init__(self, resources: Resources) -> None:
        self._context = resources.context
        self._screen = ScreenShader(resources, "fxaa.frag")
        self._rough: Framebuffer | None = None

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether the scene asks for it."""
        return plan.picture.fxaa

    def source(self, plan: PicturePlan) -> Framebuffer:
        """Where the picture is to be put that `draw` smooths."""
        size = (plan.view.width, plan.view.height)
        if self._rough is None or (self._rough.width, self._rough.height) != size:
            self._rough = Framebuffer(self._context, *size, ("rgba8",))
        return self._rough

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Fills `target` from what stands in `source`."""
        target.use(depth_write=False)
        self._context.set_state()
        self.source(plan).colors[0].use(TEXTURE_UNITS["picture"])
        self._screen.compiled()[1].draw()


class OutlinePass:
    """A line around what is selected, also where it is hidden."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._screen = ScreenShader(resources, "outline.frag")
        self._mask: Framebuffer | None = None

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether anything selected is in the picture."""
        return bool(plan.selected)

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Draws silhouettes aside and their edges onto `target`."""
        context = self._resources.context
        if self._mask is None or (self._mask.width, self._mask.height) != (target.width, target.height):
            self._mask = Framebuffer(context, target.width, target.height, ("r8",), smooth=False)
        self._mask.use()
        self._mask.clear()
        context.set_state()

        def choose(_: Geometry, batch: Batch) -> Program:
            program = depth_program(self._resources, plan, batch.look, "SILHOUETTE")
            program.set("target_from_relative", plan.view.clip_from_relative)
            return program

        draw_calls(self._resources, plan, plan.selected, choose, cull=False)
        target.use(depth_write=False)
        context.set_state(blend="over")
        self._mask.colors[0].use(TEXTURE_UNITS["mask"])
        program, triangle = self._screen.compiled()
        program.set("outline_color", OUTLINE_COLOR)
        triangle.draw()
