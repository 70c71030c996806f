"""The passes over the finished light: to the screen's colours, and marks on top."""

from __future__ import annotations

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Program
from elys.render_node.look import Look
from elys.render_node.passes.backdrop import full_screen
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Geometry, Resources

OUTLINE_COLOR = (1.0, 0.55, 0.1, 1.0)  # sRGB and opacity


class TonemapPass:
    """Linear light to sRGB, highlights brought down by Khronos PBR Neutral. Always needed."""

    def __init__(self, resources: Resources) -> None:
        self._context = resources.context
        self._program = resources.program("screen.vert", "tonemap.frag")
        self._triangle = full_screen(resources, self._program)

    def draw(self, light: Framebuffer, target: Framebuffer) -> None:
        """Fills `target` from the light of a picture of the same size."""
        target.use(depth_write=False)
        self._context.set_state()
        light.colors[0].use(TEXTURE_UNITS["picture"])
        self._triangle.draw()


class OutlinePass:
    """A line around what is selected, also where it is hidden."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._program = resources.program("screen.vert", "outline.frag")
        self._program.set("outline_color", OUTLINE_COLOR)
        self._triangle = full_screen(resources, self._program)
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

        def choose(_: Geometry, look: Look) -> Program:
            program = depth_program(self._resources, plan, look, "SILHOUETTE")
            program.set("target_from_relative", plan.view.clip_from_relative)
            return program

        draw_calls(self._resources, plan, plan.selected, choose, cull=False)
        target.use(depth_write=False)
        context.set_state(blend="over")
        self._mask.colors[0].use(TEXTURE_UNITS["mask"])
        self._triangle.draw()
