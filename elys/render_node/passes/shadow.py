"""Shadow maps: how far the light of the sun, of bulbs and of spots gets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Program
from elys.render_node.instances import Batch
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan, ShadowState, shadow_states
from elys.render_node.resources import Geometry, Resources
from elys.render_node.shadow_fit import ShadowFit, atlas_shape

SLOPE_OFFSET = (1.5, 3.0)  # pushes casters away from the sun by their slope and by a few steps of the depth's precision


class ShadowPass:
    """Keeps the maps of the sun's cascades, in one atlas, from picture to picture while neither the sun, nor what one of them
    covers, nor anything in it moves.
    """

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._atlas: Framebuffer | None = None
        self.drawn: tuple[ShadowState, ...] = ()

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether there is a sun that casts, something that stops it, and a map that does not show it yet."""
        return bool(plan.stale_cascades)

    def draw(self, plan: PicturePlan) -> None:
        """Draws into each stale map what may throw a shadow there."""
        context, edge = self._resources.context, plan.cascades[0].map_size
        columns, rows = atlas_shape(len(plan.cascades))
        size = (edge * columns, edge * rows)
        if self._atlas is None or (self._atlas.width, self._atlas.height) != size:
            self._atlas = Framebuffer(context, *size, (), depth=True, compare=True)
        for place, calls in zip(plan.stale_cascades, plan.casters, strict=True):
            region = (place % columns * edge, place // columns * edge, edge, edge)
            self._atlas.use(region=region)
            self._atlas.clear(region=region)
            context.set_state(depth_test="less", polygon_offset=SLOPE_OFFSET)
            self._atlas.use(region=region)

            def choose(_: Geometry, batch: Batch, fit: ShadowFit = plan.cascades[place]) -> Program:
                program = depth_program(self._resources, plan, batch.look)
                program.set("target_from_relative", fit.map_from_relative)
                return program

            # What turns its back to the sun is hidden by its own front, or is a sheet that is not there from behind either.
            draw_calls(self._resources, plan, calls, choose)
        self.drawn = shadow_states(plan.world, plan.cascades, plan.hidden)

    def use(self) -> None:
        """Shows the maps to the passes that shade."""
        if self._atlas is not None and self._atlas.depth is not None:
            self._atlas.depth.use(TEXTURE_UNITS["shadow_map"])


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
