"""How a session is looked at: viewports, places to go back to, and tools, found again when the editor comes back to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from elys.editor_node.preferences import CameraPose, SessionState
from elys.editor_node.ui import Tools
from elys.editor_node.viewports import Viewports


def session_state(viewports: Viewports, tools: Tools, places: Mapping[str, CameraPose]) -> SessionState:
    """What is kept."""
    values = {field.name: getattr(tools, field.name) for field in fields(tools)}
    return SessionState(
        views=viewports.states(),
        places=dict(places),
        tools={name: value for name, value in values.items() if isinstance(value, (str, bool, float))},
    )


def restore_session(state: SessionState, viewports: Viewports, tools: Tools, places: dict[str, CameraPose]) -> None:
    """Looks so again; tools of another version that are of another kind now stay as they are."""
    viewports.restore(state.views)
    places.clear()
    places.update(state.places)
    for field in fields(tools):
        kept = state.tools.get(field.name)
        if kept is not None and type(kept) is type(getattr(tools, field.name)):
            setattr(tools, field.name, kept)
