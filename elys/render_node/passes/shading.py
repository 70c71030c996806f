"""The passes that shade: solid things first, then those that let through what is behind."""

from __future__ import annotations

from elys.render_node.gpu import Framebuffer, Program
from elys.render_node.instances import Batch
from elys.render_node.passes.drawing import ChooseProgram, draw_calls
from elys.render_node.passes.occlusion import OcclusionPass
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import Quality
from elys.render_node.resources import TANGENTS, Geometry, Resources

NORMAL_MAPS = frozenset({"NORMAL_TEXTURE", "CLEARCOAT_NORMAL_TEXTURE"})


class OpaquePass:
    """Everything solid, instanced by mesh and material."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._resources = resources
        self._quality = quality

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether anything solid is seen."""
        return bool(plan.opaque)

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Shades it with depth."""
        target.use()
        self._resources.context.set_state(depth_test="less", cull="back")
        draw_calls(
            self._resources,
            plan,
            plan.opaque,
            _shaded(self._resources, plan, self._quality, occluded=OcclusionPass.is_needed(plan)),
        )


class TransparentPass:
    """What is blended, farthest first, over all that is solid."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._resources = resources
        self._quality = quality

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether anything see-through is seen."""
        return bool(plan.transparent)

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Shades it without hiding what is behind."""
        target.use(depth_write=False)
        self._resources.context.set_state(depth_test="less", blend="over", cull="back")
        draw_calls(self._resources, plan, plan.transparent, _shaded(self._resources, plan, self._quality))


def _shaded(resources: Resources, plan: PicturePlan, quality: Quality, *, occluded: bool = False) -> ChooseProgram:
    shared = quality.surface_defines(plan.picture) + (quality.shadow_defines if plan.cascades else ())
    shared += ("SUN",) if plan.sun is not None else ()
    shared += ("FURTHER_SUNS",) if plan.further_suns else ()
    shared += ("LAMPS",) if plan.lamps else ()
    shared += (f"CASCADES {len(plan.cascades)}",) if plan.cascades else ()
    shared += ("LAMP_SHADOWS",) if plan.lamp_shadows is not None else ()
    shared += ("SURROUNDINGS",) if plan.surroundings.gives_light else ()
    shared += ("AMBIENT_OCCLUSION",) if occluded else ()

    def choose(geometry: Geometry, batch: Batch) -> Program:
        look = batch.look
        textures = resources.bind_textures(plan.world, look)
        along_vertices = not NORMAL_MAPS.isdisjoint(textures) and look.tangents != "pixels"
        vertices = tuple(define for define in geometry.defines if define != TANGENTS or along_vertices)
        if not (geometry.is_surface or "UNLIT" in textures):
            textures = (*textures, "UNLIT")  # lines and points face nowhere
        numbers = (*look.surface, *batch.terms)
        program = resources.program("shaded.vert", "shaded.frag", (*vertices, *textures, *numbers, *shared))
        resources.set_look(program, look, textures)
        return program

    return choose
