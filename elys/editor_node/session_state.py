"""How a session is looked at: camera, the places it goes back to, and tools, found again when the editor comes back to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import msgspec

from elys.editor_node.camera import OrbitCamera
from elys.editor_node.preferences import CameraPose, SessionState
from elys.editor_node.ui import Tools


def session_state(camera: OrbitCamera, tools: Tools, places: Mapping[str, CameraPose]) -> SessionState:
    """What is kept."""
    values = {field.name: getattr(tools, field.name) for field in fields(tools)}
    return SessionState(
        **msgspec.structs.asdict(camera.pose),
        places=dict(places),
        tools={name: value for name, value in values.items() if isinstance(value, (str, bool, float))},
    )


def restore_session(state: SessionState, camera: OrbitCamera, tools: Tools, places: dict[str, CameraPose]) -> None:
    """Looks so again; tools of another version that are of another kind now stay as they are."""
    camera.pose = CameraPose(**{name: getattr(state, name) for name in CameraPose.__struct_fields__})
    places.clear()
    places.update(state.places)
    for field in fields(tools):
        kept = state.tools.get(field.name)
        if kept is not None and type(kept) is type(getattr(tools, field.name)):
            setattr(tools, field.name, kept)
