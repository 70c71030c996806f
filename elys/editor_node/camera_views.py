"""Points of view of the viewport's camera: along the axes, places it was told to keep, and those of the scene's cameras."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import msgspec
import numpy as np

from elys.common.components import Camera
from elys.common.math import quaternion
from elys.common.math.poses import local_pose
from elys.common.scene import ComponentChanges
from elys.editor_node.camera import OrbitCamera
from elys.editor_node.language import tr
from elys.editor_node.model import EditorModel
from elys.editor_node.preferences import CameraPose

# From where one looks, as yaw and pitch [rad].
SIDES: Final = {
    "front": (0.0, 0.0),
    "back": (math.pi, 0.0),
    "right": (math.pi / 2.0, 0.0),
    "left": (-math.pi / 2.0, 0.0),
    "top": (0.0, -math.pi / 2.0),
    "bottom": (0.0, math.pi / 2.0),
}
PLACES: Final = tuple("123456789")
_REACH: Final = 10.0  # [m] to what the view of a scene's camera turns about
_DECIMALS: Final = 6


class CameraViews:
    """Lets a camera glide to points of view. `camera` is asked for the one that is meant each time."""

    def __init__(self, model: EditorModel, camera: Callable[[], OrbitCamera]) -> None:
        self._model = model
        self._camera = camera
        self.places: dict[str, CameraPose] = {}  # by digit

    def look_from_side(self, side: str) -> None:
        """A parallel view along an axis, from one of SIDES."""
        yaw, pitch = SIDES[side]
        self._glide(msgspec.structs.replace(self._camera().pose, yaw=yaw, pitch=pitch, is_parallel=True))

    def look_from(self, direction: tuple[float, float, float]) -> None:
        """From a direction in the world, at the same target and in the same kind of view."""
        x, y, z = np.array(direction) / np.linalg.norm(direction)
        pose = self._camera().pose
        yaw = math.atan2(x, z) if math.hypot(x, z) > 1e-6 else _nearest_quarter(pose.yaw)
        self._glide(msgspec.structs.replace(pose, yaw=yaw, pitch=-math.asin(float(y))))

    def toggle_parallel(self) -> None:
        """Between a parallel view and one in perspective."""
        pose = self._camera().pose
        self._glide(msgspec.structs.replace(pose, is_parallel=not pose.is_parallel))

    @property
    def is_parallel(self) -> bool:
        """Whether the view is a parallel one."""
        return self._camera().is_parallel

    # --- places ----------------------------------------------------------------------------------------------------

    def keep_place(self, digit: str) -> None:
        """Keeps the point of view under a digit, in the place of what was kept there."""
        self.places[digit] = self._camera().pose
        self._model.praise(tr("View {digit} kept", digit=digit))

    def go_to_place(self, digit: str) -> None:
        """Goes back to a kept point of view."""
        if digit in self.places:
            self._glide(self.places[digit])

    # --- cameras of the scene --------------------------------------------------------------------------------------

    @property
    def selected_camera(self) -> int:
        """The entity with a Camera that was selected last; 0 for none."""
        scene = self._model.scene
        cameras = [e for e in self._model.selection if scene.exists(e) and scene.echo_of(e, "Camera") is not None]
        return cameras[-1] if cameras else 0

    def look_through_selected(self) -> None:
        """Looks as the selected camera does, but upright where that one is tilted."""
        entity = self.selected_camera
        camera = self._model.scene.echo_of(entity, "Camera")
        if not isinstance(camera, Camera):
            return
        pose = self._model.scene.world_pose(entity)
        wanted = OrbitCamera()
        wanted.is_parallel = camera.projection == "orthographic"
        wanted.field_of_view = camera.field_of_view if not wanted.is_parallel else wanted.field_of_view
        distance = _REACH
        if wanted.is_parallel:
            distance = camera.ortho_height / (2.0 * math.tan(wanted.field_of_view / 2.0))
        wanted.look_from(pose.position, quaternion.rotate(np.array(pose.rotation), (0.0, 0.0, -1.0)), distance)
        self._glide(wanted.pose)

    def move_selected_here(self) -> None:
        """Puts the selected camera where the viewport looks from, as one edit."""
        entity, camera = self.selected_camera, self._camera()
        if not entity:
            return
        scene = self._model.scene
        place, turn = tuple(camera.position.tolist()), tuple(camera.rotation.tolist())
        if scene.parent_of(entity):
            place, turn = local_pose(*scene.world_pose(scene.parent_of(entity)), place, turn)
        position = tuple(round(value, _DECIMALS) + 0.0 for value in place)
        changes: dict[int, ComponentChanges] = {entity: {"Transform": {"position": position, "rotation": turn}}}
        self._model.edit.lay_over("Move to this view: {what}", changes)

    def _glide(self, pose: CameraPose) -> None:
        self._camera().glide_to(pose)
        self._model.request_redraw(0.0)


def _nearest_quarter(angle: float) -> float:
    """The multiple of a right angle that is nearest: a view from above or below keeps what is left and right."""
    return round(angle / (math.pi / 2.0)) * math.pi / 2.0
