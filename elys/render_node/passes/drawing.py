"""Drawing runs of instances: what all passes over the scene's things share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from elys.render_node.draw_calls import DrawCall
from elys.render_node.gpu import Program
from elys.render_node.instance_placing import InstancePlacing
from elys.render_node.instances import Batch
from elys.render_node.look import SECOND_UVS, Look
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.resources import Geometry, Resources

ChooseProgram = Callable[[Geometry, Batch], Program]


def draw_calls(
    resources: Resources,
    plan: PicturePlan,
    calls: Sequence[DrawCall],
    choose: ChooseProgram,
    *,
    cull: bool = True,
    surfaces_only: bool = False,
    placing: InstancePlacing | None = None,
) -> None:
    """Draws each call with the program that `choose` picks for its mesh and batch. State but culling is the pass' own.
    With `surfaces_only` lines and points are left out.

    Rows are those of the picture, or of another `placing` that has placed the plan.
    """
    rows = (placing or resources.placing).rows
    for batch, first, count in calls:
        geometry = resources.geometry(plan.world, batch)
        if geometry is None or (surfaces_only and not geometry.is_surface):
            continue
        program = choose(geometry, batch)
        resources.context.set_culling(cull and not batch.look.is_double_sided, mirrored=batch.look.is_mirrored)
        array = geometry.vertex_array(program)
        array.use_instances(rows, first, plan.layout)
        if batch.look.is_morphed:
            geometry.use_targets(program)
        array.draw(count)


def depth_program(resources: Resources, plan: PicturePlan, look: Look, *defines: str) -> Program:
    """The program that draws only places, with the holes that a mask cuts."""
    if look.alpha_mode == "mask":
        textures = resources.bind_textures(plan.world, look)
        if "BASE_COLOR_TEXTURE" in textures:
            holes = tuple(define for define in textures if define.startswith(("BASE_COLOR_", SECOND_UVS)))
            names = (*defines, *look.deformation, "MASKED", *holes)
            program = resources.program("depth.vert", "depth.frag", names)
            resources.set_look(program, look, holes)
            return program
    return resources.program("depth.vert", "depth.frag", (*defines, *look.deformation))
