"""How a session is looked at: camera and tools, to be found again when the editor comes back to it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from elys.editor_node.camera import OrbitCamera
from elys.editor_node.preferences import SessionState
from elys.editor_node.ui import Tools


def session_state(camera: OrbitCamera, tools: Tools) -> SessionState:
    """What is kept."""
    x, y, z = camera.target.tolist()
    values = {field.name: getattr(tools, field.name) for field in fields(tools)}
    return SessionState(
        target=(x, y, z),
        yaw=camera.yaw,
        pitch=camera.pitch,
        distance=camera.distance,
        tools={name: value for name, value in values.items() if isinstance(value, (str, bool, float))},
    )


def restore_session(state: SessionState, camera: OrbitCamera, tools: Tools) -> None:
    """Looks so again; tools of another version that are of another kind now stay as they are."""
    camera.target = np.array(state.target, dtype=np.float64)
    camera.yaw, camera.pitch, camera.distance = state.yaw, state.pitch, state.distance
    for field in fields(tools):
        kept = state.tools.get(field.name)
        if kept is not None and type(kept) is type(getattr(tools, field.name)):
            setattr(tools, field.name, kept)
