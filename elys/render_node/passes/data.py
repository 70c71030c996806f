"""Pictures of data instead of light: one value or colour a pixel of the surface seen there, exact where it is a number.

normals, albedo, roughness: what the shading would have read     depth, entity: what picking reads, for all pixels
wireframe: edges over plain surfaces                             overdraw: how often each pixel was shaded
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from elys.common.scene import PictureSettings
from elys.render_node.gpu import Format, Framebuffer, Program
from elys.render_node.instances import Batch
from elys.render_node.passes.drawing import ChooseProgram, depth_program, draw_calls
from elys.render_node.passes.shading import OpaquePass
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import Quality
from elys.render_node.resources import Geometry, Resources

DataKind = Literal["normals", "albedo", "roughness", "depth", "entity", "wireframe", "overdraw"]
DATA_KINDS: Final[tuple[DataKind, ...]] = get_args(DataKind)
LINE_SAMPLES: Final = 4  # a pixel, so that lines are smooth
LINE_OFFSET: Final = (-1.0, -2.0)  # lifts lines off the surfaces whose edges they are
PLAIN_BACKGROUND: Final = (0.02, 0.025, 0.035, 1.0)  # behind a wireframe; linear

# What `shaded.frag` puts into the picture. Surfaces below a wireframe are lit by a lamp at the eye.
_SHOWN: Final = {
    "normals": "shading_normal()",
    "albedo": "color.rgb",
    "roughness": "vec3(surface_metal().y)",
    "wireframe": "vec3(0.02 + 0.12 * abs(dot(smooth_normal(), direction_to_eye(relative))))",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shown(Quality):
    """Makes the shading put an expression of its own into the picture."""

    expression: str

    def surface_defines(self, picture: PictureSettings) -> tuple[str, ...]:
        return (f"SHOWN {self.expression}",)


class DataPass:
    """Draws one kind of data at a time into framebuffers of its own. See-through surfaces count as solid."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._targets: dict[tuple[object, ...], Framebuffer] = {}
        self._shading: dict[str, OpaquePass] = {}

    def draw(self, plan: PicturePlan, kind: DataKind) -> NDArray[Any]:
        """Values (H, W, C), the upper row first.

        normals: f32 [3] unit vectors along the world's axes, 0 where nothing is. albedo: f32 [3] linear. roughness: f32 [1].
        depth: f32 [1] m along the way the camera looks, infinite where nothing is. entity: u32 [1], 0 where nothing is.
        wireframe: f32 [3] linear colours. overdraw: f32 [1] fragments shaded.
        """
        solid = replace(plan, opaque=[*plan.opaque, *plan.transparent], transparent=[])
        match kind:
            case "entity":
                return self._hits(solid).read(0)[::-1].copy()
            case "depth":
                return _depths(plan, self._hits(solid).read(1)[::-1])
            case "overdraw":
                return self._overdraw(plan)
            case "wireframe":
                return self._wireframe(plan)[..., :3]
            case "normals" | "albedo":
                return self._shown(solid, kind)[..., :3]
            case "roughness":
                return self._shown(solid, kind)[..., :1]

    def _shown(self, plan: PicturePlan, kind: DataKind) -> NDArray[np.float32]:
        target = self._target(plan, ("rgba32f",))
        target.use()
        target.clear()
        self._shade(plan, kind, target)
        return np.ascontiguousarray(target.read()[::-1])

    def _hits(self, plan: PicturePlan) -> Framebuffer:
        """Ids and places relative to the eye, as PickingPass has them for one pixel."""
        target = self._target(plan, ("r32ui", "rgba32f"))
        target.use()
        target.clear()
        self._resources.context.set_state(depth_test="less", cull="back")
        draw_calls(self._resources, plan, plan.opaque, self._placed(plan, "PICKED"))
        return target

    def _overdraw(self, plan: PicturePlan) -> NDArray[np.float32]:
        """Counts in the order and with the tests of a picture: what is hidden by something drawn before costs nothing."""
        target = self._target(plan, ("r32f",))
        target.use()
        target.clear()
        self._resources.context.set_state(depth_test="less", blend="add", cull="back")
        choose = self._placed(plan, "SILHOUETTE")
        draw_calls(self._resources, plan, plan.opaque, choose)
        target.use(depth_write=False)
        draw_calls(self._resources, plan, plan.transparent, choose)
        return np.ascontiguousarray(target.read()[::-1])

    def _wireframe(self, plan: PicturePlan) -> NDArray[np.float32]:
        context = self._resources.context
        samples = min(LINE_SAMPLES, context.max_samples)
        target = self._target(plan, ("rgba16f",), samples)
        target.use()
        target.clear(PLAIN_BACKGROUND)
        self._shade(plan, "wireframe", target)
        target.use(depth_write=False)
        context.set_state(depth_test="less_equal", wireframe=True, polygon_offset=LINE_OFFSET)
        choose = self._placed(plan, "SILHOUETTE")
        draw_calls(self._resources, plan, [*plan.opaque, *plan.transparent], choose)
        context.set_state()
        finished = target
        if samples:
            finished = self._target(plan, ("rgba16f",))
            target.resolve_into(finished)
        return np.ascontiguousarray(finished.read()[::-1].astype(np.float32))

    def _shade(self, plan: PicturePlan, kind: DataKind, target: Framebuffer) -> None:
        shading = self._shading.get(kind)
        if shading is None:
            quality = _Shown(
                samples=0,
                single_shadow_tap=True,
                shadow_size=0,
                lamp_shadow_size=0,
                to_screen=True,
                expression=_SHOWN[kind],
            )
            shading = self._shading[kind] = OpaquePass(self._resources, quality)
        shading.draw(plan, target)

    def _placed(self, plan: PicturePlan, define: str) -> ChooseProgram:
        def choose(_: Geometry, batch: Batch) -> Program:
            program = depth_program(self._resources, plan, batch.look, define)
            program.set("target_from_relative", plan.view.clip_from_relative)
            return program

        return choose

    def _target(self, plan: PicturePlan, forms: tuple[Format, ...], samples: int = 0) -> Framebuffer:
        """A framebuffer of the plan's size; those of other sizes are let go."""
        size = (plan.view.width, plan.view.height)
        self._targets = {key: target for key, target in self._targets.items() if key[:2] == size}
        key = (*size, forms, samples)
        if key not in self._targets:
            self._targets[key] = Framebuffer(
                self._resources.context, *size, forms, depth=True, samples=samples, smooth=False
            )
        return self._targets[key]


def _depths(plan: PicturePlan, places: NDArray[np.float32]) -> NDArray[np.float32]:
    """Metres (H, W, 1) along the camera's axis of places (H, W, 4) relative to the eye, whose last component is 0 for none."""
    forward = -plan.view.world_from_view[:, 2].astype(np.float32)
    depth = places[..., :3] @ forward
    return np.where(places[..., 3] > 0.0, depth, np.float32(np.inf))[..., None].astype(np.float32)
