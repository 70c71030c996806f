"""Ambient occlusion: how much of the light from around comes into corners."""

from __future__ import annotations

from typing import Final

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Program
from elys.render_node.instances import Batch
from elys.render_node.passes.backdrop import ScreenShader
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Geometry, Resources

# [pixels] as far as occlusion.frag looks for horizons, the neighbours that tell it a normal, and the block of its blur.
OCCLUSION_REACH: Final = 128 + 1 + 2


class OcclusionPass:
    """Draws depths ahead, finds horizons in them and evens the result out; surfaces look it up for light from around."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._find = ScreenShader(resources, "occlusion.frag")
        self._blur = ScreenShader(resources, "occlusion_blur.frag")
        self._depths: Framebuffer | None = None
        self._found: Framebuffer | None = None
        self._blurred: Framebuffer | None = None

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether the scene asks for it, and there are light from around and solid things to keep it out."""
        return plan.picture.ambient_occlusion > 0.0 and plan.surroundings.gives_light and bool(plan.opaque)

    def draw(self, plan: PicturePlan) -> None:
        """Fills the texture that `use` shows."""
        context, view = self._resources.context, plan.view
        if self._depths is None or (self._depths.width, self._depths.height) != (view.width, view.height):
            self._depths = Framebuffer(context, view.width, view.height, (), depth=True)
            self._found = Framebuffer(context, view.width, view.height, ("r8",), smooth=False)
            self._blurred = Framebuffer(context, view.width, view.height, ("r8",), smooth=False)
        assert self._found is not None and self._blurred is not None and self._depths.depth is not None
        self._depths.use()
        self._depths.clear()
        context.set_state(depth_test="less", cull="back")

        def choose(_: Geometry, batch: Batch) -> Program:
            program = depth_program(self._resources, plan, batch.look)
            program.set("target_from_relative", view.clip_from_relative)
            return program

        # A line before a wall keeps no light from it.
        draw_calls(self._resources, plan, plan.opaque, choose, surfaces_only=True)
        context.set_state()
        self._depths.depth.use(TEXTURE_UNITS["depths"])
        finding, triangle = self._find.compiled()
        finding.set("reach", plan.picture.occlusion_radius)
        finding.set("strength", plan.picture.ambient_occlusion)
        finding.set("pixels", view.pixels_a_metre)
        self._found.use(depth_write=False)
        triangle.draw()
        blurring, triangle = self._blur.compiled()
        blurring.set("near", max(view.camera.near, 1e-5))
        self._found.colors[0].use(TEXTURE_UNITS["picture"])
        self._blurred.use(depth_write=False)
        triangle.draw()

    def use(self) -> None:
        """Shows it to the passes that shade."""
        if self._blurred is not None:
            self._blurred.colors[0].use(TEXTURE_UNITS["ambient_openness"])
