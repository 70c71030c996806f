"""Other runs beside the scene: see-through, each in one colour. They hide nothing and throw no shadows."""

from __future__ import annotations

from typing import Final

from elys.render_node.gpu import Framebuffer, Program
from elys.render_node.instance_placing import InstancePlacing
from elys.render_node.instances import Batch
from elys.render_node.passes.drawing import draw_calls
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import Quality
from elys.render_node.resources import Geometry, Resources

OPACITY: Final = 0.42  # of a surface that faces the eye; towards its edge it is denser


class GhostPass:
    """Draws after everything that is in the scene, with its depth but without writing any."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._resources = resources
        self._quality = quality
        self._placing: InstancePlacing | None = None  # until there is a ghost; that of the scene keeps the scene's rows

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether anything of another run is seen."""
        return bool(plan.ghosts)

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Blends all of them over the scene."""
        resources = self._resources
        placing = self._placing = self._placing or InstancePlacing(resources.context, resources.programs)
        to_screen = ("TO_SCREEN",) if self._quality.writes_screen(plan.picture) else ()

        for ghost in plan.ghosts:
            placing.place(ghost.plan)
            resources.show_poses(ghost.plan.world)
            # Only now: the rows were written by the card.
            target.use(depth_write=False)
            resources.context.set_state(depth_test="less", blend="over", cull="back")
            tint = (*(channel / 255.0 for channel in ghost.color), OPACITY)

            def choose(_: Geometry, batch: Batch, tint: tuple[float, ...] = tint) -> Program:
                program = resources.program("shaded.vert", "ghost.frag", (*batch.look.deformation, *to_screen))
                program.set("tint", tint)
                return program

            calls = [*ghost.plan.opaque, *ghost.plan.transparent]
            draw_calls(resources, ghost.plan, calls, choose, placing=placing)
        resources.show_poses(plan.world)  # outlines are still to be drawn
