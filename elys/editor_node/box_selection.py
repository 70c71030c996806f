"""Which entities a rectangle that is dragged over the viewport selects: those whose middle is seen in it."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.editor_node.camera import clip_from_view, view_from_world
from elys.editor_node.scene_mirror import EditorScene

Box = tuple[float, float, float, float]  # left, bottom, right, top; -1 to 1 over the picture, y up

_SEEN_AS: Final = ("MeshRenderer", "Collider", "Light", "Camera")


def entities_in_box(scene: EditorScene, camera: ViewCamera, aspect: float, box: Box) -> list[int]:
    """Those in the order of the scene. Who is locked, hidden or switched off is left out, and what is a group alone."""
    candidates, middles = _candidates(scene)
    clip = (
        np.column_stack((middles, np.ones(len(middles)))) @ (clip_from_view(camera, aspect) @ view_from_world(camera)).T
    )
    left, bottom, right, top = box
    depth = clip[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, z = (clip[:, axis] / depth for axis in range(3))
    inside = (depth > 1e-9) & (x >= left) & (x <= right) & (y >= bottom) & (y <= top) & (np.abs(z) <= 1.0)
    marks = scene.marks
    return [
        candidates[row]
        for row in np.flatnonzero(inside).tolist()
        if scene.is_world_enabled(candidates[row])
        and not marks.is_marked("locked", candidates[row])
        and not marks.is_marked("hidden", candidates[row])
    ]


def _candidates(scene: EditorScene) -> tuple[list[int], NDArray[np.float64]]:
    """Who can be seen, and where their middles (N, 3) are [m]; bodies where the newest state frame has them."""
    frame = scene.frame
    positions = frame.position.tolist() if frame is not None else []
    candidates, middles = [], []
    for entity, found in scene.mirror.entities.items():
        if any(name in found.components for name in _SEEN_AS) and "Transform" in found.components:
            row = scene.mirror.frame_row(entity)
            candidates.append(entity)
            middles.append(positions[row] if row >= 0 else scene.world_pose(entity).position)
    return candidates, np.array(middles, dtype=np.float64).reshape(-1, 3)
