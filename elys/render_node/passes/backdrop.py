"""What lies behind and below the scene: the sky and the editor's ground grid."""

from __future__ import annotations

from elys.render_node.gpu import Framebuffer, Program, VertexArray
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import Quality
from elys.render_node.resources import Resources

GRID_REACH = 120.0  # [m] as far as lines are told apart


class SkyPass:
    """What surrounds the scene, wherever nothing was drawn."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._context = resources.context
        self._quality = quality
        self._screen = ScreenShader(resources, "sky.frag")

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether what is behind everything is anything but black."""
        return plan.surroundings.is_seen

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Fills what is still as far away as can be."""
        target.use(depth_write=False)
        self._context.set_state(depth_test="less_equal")
        program, triangle = self._screen.compiled(self._quality.light_defines(plan.picture))
        program.set("depth", 1.0)
        program.set("shown", plan.surroundings.shown)
        triangle.draw()


class GridPass:
    """Lines a metre apart on the plane y = 0, and the axes of x and z, fading with distance."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._context = resources.context
        self._resources = resources
        self._quality = quality
        self._squares: dict[Program, VertexArray] = {}

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether the picture is for somebody who edits."""
        return plan.grid

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Blends the lines over what is there, a little in front of a floor at the same height."""
        target.use(depth_write=False)
        self._context.set_state(depth_test="less_equal", blend="over", polygon_offset=(-1.0, -8.0))
        eye = plan.view.eye
        height = abs(float(eye[1]))
        program = self._resources.program("grid.vert", "grid.frag", self._quality.light_defines(plan.picture))
        if program not in self._squares:
            self._squares[program] = VertexArray(self._context, program, {}, None, 4, mode="triangle_strip")
        program.set("reach", min(GRID_REACH + 12.0 * height, plan.view.camera.far))
        program.set("axes", (-float(eye[0]), -float(eye[2])))
        self._squares[program].draw()


class ScreenShader:
    """A fragment shader over the whole picture, compiled for whatever definitions it is drawn with."""

    def __init__(self, resources: Resources, fragment: str) -> None:
        self._resources = resources
        self._fragment = fragment
        self._triangles: dict[Program, VertexArray] = {}

    def compiled(self, defines: tuple[str, ...] = ()) -> tuple[Program, VertexArray]:
        """The program, and what draws with it."""
        program = self._resources.program("screen.vert", self._fragment, defines)
        if program not in self._triangles:
            self._triangles[program] = full_screen(self._resources, program)
        return program, self._triangles[program]


def full_screen(resources: Resources, program: Program) -> VertexArray:
    """The one triangle that `screen.vert` makes without a buffer."""
    return VertexArray(resources.context, program, {}, None, 3)
