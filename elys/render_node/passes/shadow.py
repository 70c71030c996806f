"""The sun's shadow map: how far light gets, seen along its direction."""

from __future__ import annotations

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Program
from elys.render_node.look import Look
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan, ShadowState
from elys.render_node.resources import Geometry, Resources

SLOPE_OFFSET = (1.5, 3.0)  # pushes casters away from the sun by their slope and by a few steps of the depth's precision


class ShadowPass:
    """Keeps the map from picture to picture while neither the sun, nor what is covered, nor anything in it moves."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._map: Framebuffer | None = None
        self.drawn: ShadowState | None = None

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether there is a sun that casts, something that stops it, and no map of it yet."""
        return plan.shadow is not None and not plan.shadow_is_fresh

    def draw(self, plan: PicturePlan) -> None:
        """Draws all casters into the map."""
        assert plan.shadow is not None
        context = self._resources.context
        if self._map is None:
            self._map = Framebuffer(context, plan.shadow.map_size, plan.shadow.map_size, (), depth=True, compare=True)
        self._map.use()
        self._map.clear()
        context.set_state(depth_test="less", polygon_offset=SLOPE_OFFSET)
        target_from_relative = plan.shadow.map_from_relative

        def choose(_: Geometry, look: Look) -> Program:
            program = depth_program(self._resources, plan, look)
            program.set("target_from_relative", target_from_relative)
            return program

        # What turns its back to the sun is hidden by its own front, or is a sheet that is not there from behind either.
        draw_calls(self._resources, plan, plan.casters, choose)
        self.drawn = ShadowState(plan.world.scene_version, plan.world.pose_version, plan.shadow.key)

    def use(self) -> None:
        """Shows the map to the passes that shade."""
        if self._map is not None and self._map.depth is not None:
            self._map.depth.use(TEXTURE_UNITS["shadow_map"])
