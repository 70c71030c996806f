"""Which entity is seen in one pixel, and where it was hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu import Framebuffer, Program
from elys.render_node.instances import Batch
from elys.render_node.passes.drawing import depth_program, draw_calls
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Geometry, Resources


class PickingPass:
    """Draws entity ids into a framebuffer of its own, one pixel large: GL's clear would write float bits into ids."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._target = Framebuffer(resources.context, 1, 1, ("r32ui", "rgba32f"), depth=True, smooth=False)

    def draw(self, plan: PicturePlan) -> tuple[int, NDArray[np.float64]]:
        """The entity (0: none) in a plan whose view is of one pixel, and the place hit (3,), relative to the eye [m]."""
        self._target.use()
        self._target.clear()
        self._resources.context.set_state(depth_test="less", cull="back")

        def choose(_: Geometry, batch: Batch) -> Program:
            program = depth_program(self._resources, plan, batch.look, "PICKED")
            program.set("target_from_relative", plan.view.clip_from_relative)
            return program

        draw_calls(self._resources, plan, [*plan.opaque, *plan.transparent], choose)
        entity = int(self._target.read(0)[0, 0, 0])
        return entity, self._target.read(1)[0, 0, :3].astype(np.float64)
