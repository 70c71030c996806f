"""Shadow maps: how far the light of the sun, of bulbs and of spots gets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Program
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan, ShadowState, shadow_state
from elys.render_node.render_world import Batch
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
        fits = [plan.shadow] if plan.near_shadow is None else [plan.shadow, plan.near_shadow]
        edge = plan.shadow.map_size
        if self._map is None or self._map.width != edge * len(fits):
            self._map = Framebuffer(context, edge * len(fits), edge, (), depth=True, compare=True)
        self._map.use()
        self._map.clear()
        context.set_state(depth_test="less", polygon_offset=SLOPE_OFFSET)
        for column, fit in enumerate(fits):
            self._map.use(region=(column * edge, 0, edge, edge))

            def choose(_: Geometry, batch: Batch, target: NDArray[np.float64] = fit.map_from_relative) -> Program:
                program = depth_program(self._resources, plan, batch.look)
                program.set("target_from_relative", target)
                return program

            # What turns its back to the sun is hidden by its own front, or is a sheet that is not there from behind either.
            draw_calls(self._resources, plan, plan.casters, choose)
        self.drawn = shadow_state(plan.world, plan.shadow, plan.near_shadow, plan.hidden)

    def use(self) -> None:
        """Shows the map to the passes that shade."""
        if self._map is not None and self._map.depth is not None:
            self._map.depth.use(TEXTURE_UNITS["shadow_map"])


class LampShadowPass:
    """Keeps an atlas of what bulbs and spots see, while neither they nor anything that throws shadows moves."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._atlas: Framebuffer | None = None
        self.drawn: ShadowState | None = None

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether lamps throw shadows that the atlas does not hold yet."""
        return bool(plan.lamp_casters)

    def draw(self, plan: PicturePlan) -> None:
        """Draws into each square what stands in its lamp's light."""
        shadows, context = plan.lamp_shadows, self._resources.context
        assert shadows is not None
        if self._atlas is None:
            self._atlas = Framebuffer(context, shadows.size, shadows.size, (), depth=True, compare=True)
        self._atlas.use()
        self._atlas.clear()
        context.set_state(depth_test="less", polygon_offset=SLOPE_OFFSET)
        for square, calls in enumerate(plan.lamp_casters):
            self._atlas.use(region=shadows.region(square))
            target_from_relative = shadows.clip_from_relative(square, plan.view.eye)

            def choose(_: Geometry, batch: Batch, target: NDArray[np.float64] = target_from_relative) -> Program:
                program = depth_program(self._resources, plan, batch.look)
                program.set("target_from_relative", target)
                return program

            draw_calls(self._resources, plan, calls, choose)
        self.drawn = ShadowState(plan.world.scene_version, plan.world.pose_version, shadows.key, plan.hidden)

    def use(self) -> None:
        """Shows the atlas to the passes that shade."""
        if self._atlas is not None and self._atlas.depth is not None:
            self._atlas.depth.use(TEXTURE_UNITS["lamp_shadow_map"])
