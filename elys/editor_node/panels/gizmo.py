"""The gizmo over the viewport: moves, turns and scales the selection, drawn with the camera of the picture below it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from imgui_bundle import imgui, imguizmo
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import WorldPose
from elys.common.components import Transform
from elys.common.errors import ComponentError
from elys.common.math import matrix, quaternion
from elys.common.math.poses import local_pose
from elys.editor_node.camera import clip_from_view, view_from_world
from elys.editor_node.ui import Tool, Ui

_OPERATIONS: Final = {
    "move": imguizmo.im_guizmo.OPERATION.translate,
    "rotate": imguizmo.im_guizmo.OPERATION.rotate,
    "scale": imguizmo.im_guizmo.OPERATION.scale,
}
_FIELDS: Final = {"move": ("position",), "rotate": ("position", "rotation"), "scale": ("scale",)}
_DECIMALS: Final = 6  # ImGuizmo works in 32 bits: finer digits are noise


@dataclass(slots=True)
class _Drag:
    """What stood where when the drag began."""

    poses: dict[int, WorldPose]
    scales: dict[int, tuple[float, float, float]]  # local ones
    pivot: WorldPose
    world_from_local: NDArray[np.float64]  # (4, 4), as the gizmo has it now
    stroke: object = field(default_factory=object)


class Gizmo:
    """Edits the Transforms of the topmost selected entities; a drag is one entry of the history."""

    def __init__(self, number: int = 1) -> None:
        """`number` of its viewport: a drag belongs to the one that it began in."""
        self._number = number
        self._drag: _Drag | None = None
        self.is_over = False  # the pointer is on a handle
        self._targets_key: tuple[int, int, int, int] = (-1, -1, -1, -1)
        self._found: list[int] = []

    @property
    def is_used(self) -> bool:
        """Whether a handle is being dragged."""
        return self._drag is not None

    def draw(self, ui: Ui, camera: ViewCamera, rectangle: tuple[float, float, float, float]) -> None:
        """Draws it over the picture at `rectangle` (x, y, width, height) that was taken with `camera`."""
        targets = self._targets(ui)
        if not targets or ui.tools.tool in ("select", "grab") or ui.model.is_replay:
            self._drag, self.is_over = None, False
            return
        tool: Tool = ui.tools.tool
        primary = targets[-1]
        pose = ui.model.scene.world_pose(primary)
        if ui.tools.pivot == "median":
            pose = pose._replace(position=self._middle(ui, targets))
        drag = self._drag
        before = drag.world_from_local if drag is not None else _mat4(pose)
        imguizmo.im_guizmo.push_id(self._number)
        after, changed = self._manipulate(ui, tool, camera, rectangle, before)
        is_using = imguizmo.im_guizmo.is_using()
        imguizmo.im_guizmo.pop_id()
        # Handles of another viewport that are being dragged are not under the pointer here.
        self.is_over = imguizmo.im_guizmo.is_over() and imgui.is_window_hovered()
        if not is_using:
            self._drag = None
            return
        if drag is None:
            drag = self._drag = self._begin(ui, targets, pose)
        drag.world_from_local = after
        if changed:
            self._send(ui, tool, drag)

    @staticmethod
    def _middle(ui: Ui, targets: list[int]) -> tuple[float, float, float]:
        """The mean of where the targets are [m]."""
        x, y, z = np.mean([ui.model.scene.world_pose(entity).position for entity in targets], axis=0).tolist()
        return x, y, z

    def _targets(self, ui: Ui) -> list[int]:
        """Topmost selected entities with a Transform that are not locked, the primary one (or what is above it) last."""
        scene = ui.model.scene
        key = (ui.model.selection.version, scene.structure_version, scene.transforms_version, scene.marks.version)
        if key != self._targets_key:
            self._targets_key, self._found = key, self._find_targets(ui)
        return self._found

    def _find_targets(self, ui: Ui) -> list[int]:
        model = ui.model
        tops = [e for e in model.edit.tops(model.selection) if not model.scene.marks.is_marked("locked", e)]
        primary = model.selection.primary
        while primary and primary not in tops and model.scene.exists(primary):
            primary = model.scene.parent_of(primary)
        tops = [entity for entity in tops if model.scene.echo_of(entity, "Transform") is not None]
        return sorted(tops, key=lambda entity: entity == primary)

    def _begin(self, ui: Ui, targets: list[int], pivot: WorldPose) -> _Drag:
        scene = ui.model.scene
        scales = {}
        for entity in targets:
            transform = scene.component_of(entity, "Transform")
            assert isinstance(transform, Transform)
            scales[entity] = transform.scale
        poses = {entity: scene.world_pose(entity) for entity in targets}
        return _Drag(poses, scales, pivot, _mat4(pivot))

    def _manipulate(
        self,
        ui: Ui,
        tool: Tool,
        camera: ViewCamera,
        rectangle: tuple[float, float, float, float],
        before: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], bool]:
        guizmo = imguizmo.im_guizmo
        _, _, width, height = rectangle
        guizmo.set_orthographic(camera.ortho_height > 0.0)
        guizmo.set_drawlist(imgui.get_window_draw_list())
        guizmo.set_rect(*rectangle)
        guizmo.set_gizmo_size_clip_space(0.13)
        _apply_style()
        is_local = ui.tools.is_local or tool == "scale"
        manipulated = guizmo.Matrix16(_column_major(before))
        changed = guizmo.manipulate(
            guizmo.Matrix16(_column_major(view_from_world(camera))),
            guizmo.Matrix16(_column_major(clip_from_view(camera, width / height))),
            _OPERATIONS[tool],
            guizmo.MODE.local if is_local else guizmo.MODE.world,
            manipulated,
            None,
            self._snap(ui, tool) if imgui.get_io().key_ctrl != ui.tools.snaps else None,
        )
        after = np.array(manipulated.values, np.float64).reshape(4, 4).T
        return after, bool(changed)

    def _snap(self, ui: Ui, tool: Tool) -> Any:
        step = getattr(ui.tools, f"{tool}_snap")
        return imguizmo.im_guizmo.Matrix3([step, step, step])

    def _send(self, ui: Ui, tool: Tool, drag: _Drag) -> None:
        position, rotation, scale = matrix.decompose_affine(drag.world_from_local[:3])
        values: dict[int, dict[str, Any]] = {}
        for entity, pose in drag.poses.items():
            match tool:
                case "move":
                    moved = np.array(pose.position) + position - np.array(drag.pivot.position)
                    values[entity] = self._local(ui, entity, moved, np.array(pose.rotation), ("position",))
                case "rotate":
                    turn = quaternion.multiply(rotation, quaternion.conjugate(np.array(drag.pivot.rotation)))
                    arm = np.array(pose.position) - np.array(drag.pivot.position)
                    place = np.array(drag.pivot.position) + quaternion.rotate(turn, arm)
                    turned = quaternion.normalize(quaternion.multiply(turn, np.array(pose.rotation)))
                    fields = ("rotation",) if len(drag.poses) == 1 else ("position", "rotation")
                    values[entity] = self._local(ui, entity, place, turned, fields)
                case _:
                    ratio = scale / np.where(np.array(drag.pivot.scale) == 0.0, 1.0, np.array(drag.pivot.scale))
                    values[entity] = {"scale": _rounded(np.array(drag.scales[entity]) * ratio)}
                    if np.any(np.array(pose.position) != np.array(drag.pivot.position)):
                        values[entity] |= self._local(
                            ui, entity, _spread(drag.pivot, ratio, pose), rotation, ("position",)
                        )
        try:
            ui.model.edit.set_each(values, "Transform", stroke=drag.stroke)
        except ComponentError as error:
            ui.model.say("error", str(error))

    def _local(
        self, ui: Ui, entity: int, position: Any, rotation: Any, fields: tuple[str, ...]
    ) -> dict[str, tuple[float, ...]]:
        """A place in the world as fields of the Transform, in the parent's space."""
        place, turn = tuple(position.tolist()), tuple(rotation.tolist())
        parent = ui.model.scene.parent_of(entity)
        if parent:
            place, turn = local_pose(*ui.model.scene.world_pose(parent), place, turn)
        local = {"position": _rounded(place), "rotation": turn}
        return {name: local[name] for name in fields}


def _spread(pivot: WorldPose, ratio: NDArray[np.float64], pose: WorldPose) -> NDArray[np.float64]:
    """Where something comes to stand when what is around the pivot is scaled along the pivot's axes."""
    turn = np.array(pivot.rotation)
    arm = quaternion.rotate(quaternion.conjugate(turn), np.array(pose.position) - np.array(pivot.position))
    return np.asarray(np.array(pivot.position) + quaternion.rotate(turn, arm * ratio), np.float64)


def _mat4(pose: WorldPose) -> NDArray[np.float64]:
    return np.asarray(matrix.affine_to_mat4(matrix.compose_affine(*map(np.array, pose))), np.float64)


def _column_major(rows: NDArray[np.float64]) -> list[float]:
    return [float(value) for value in rows.T.ravel()]


def _rounded(values: Any) -> tuple[float, ...]:
    return tuple(round(float(value), _DECIMALS) + 0.0 for value in values)


def _apply_style() -> None:
    style = imguizmo.im_guizmo.get_style()
    style.translation_line_thickness = 3.0
    style.translation_line_arrow_size = 7.0
    style.rotation_line_thickness = 2.5
    style.rotation_outer_line_thickness = 2.0
    style.scale_line_thickness = 3.0
    style.scale_line_circle_size = 6.0
