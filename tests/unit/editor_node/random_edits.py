"""Edits at random, of every kind that a person can make."""

from __future__ import annotations

import asyncio
from pathlib import Path

from hypothesis import strategies as st

from elys.common.scene import EntityRecord, SceneSettings

# Each action is a kind and some numbers, read as indices into whatever is there when it is made.
ACTIONS = st.lists(
    st.tuples(
        st.sampled_from(
            (
                *("rename", "reparent", "place", "enable", "move", "turn", "mass", "add", "remove", "spawn"),
                *("duplicate", "delete", "settings", "undo", "redo"),
            )
        ),
        st.integers(0, 1000),
        st.integers(0, 1000),
        st.integers(0, 3),
    ),
    max_size=14,
)


def perform(stage, action):
    """Starts one of them at an editor's model; None where it changes nothing."""
    kind, first, second, count = action
    model, edit, scene = stage.model, stage.model.edit, stage.model.scene
    everyone = list(scene.mirror.entities)
    if not everyone and kind not in ("spawn", "undo", "redo", "settings"):
        return None
    chosen = [everyone[(first + 7 * step) % len(everyone)] for step in range(count + 1)] if everyone else []
    other = ([0, *everyone])[second % (len(everyone) + 1)]
    match kind:
        case "rename":
            return edit.rename(chosen[0], f"Name {second}")
        case "reparent":
            return edit.reparent(chosen, other)
        case "place":
            return edit.reparent(chosen, other, second % 4)
        case "enable":
            return edit.set_enabled(chosen, second % 2 == 0)
        case "move":
            return edit.set_fields(chosen, "Transform", {"position": (first / 7.0, second / 3.0, -1.5)})
        case "turn":
            return edit.set_fields(chosen, "Transform", {"rotation": (first + 1.0, 2.0, second / 9.0, 0.5)})
        case "mass":
            return edit.set_fields(chosen, "RigidBody", {"mass": 1.0 + second})
        case "add":
            return edit.add_component(chosen, ("Camera", "Light", "Script")[second % 3])
        case "remove":
            return edit.remove_component(chosen, ("Transform", "Material", "RigidBody")[second % 3])
        case "spawn":
            return edit.spawn(("Box", "Empty", "Light")[second % 3], parent=other if count else 0)
        case "duplicate" | "delete":
            model.selection.replace(chosen)
            return edit.duplicate() if kind == "duplicate" else edit.delete()
        case "group":
            model.selection.replace(chosen)
            return model.tree.group()
        case "paste":
            model.selection.replace(chosen)
            return asyncio.ensure_future(model.tree.paste(directory=Path())) if model.tree.copy() else None
        case "lay over":  # as pasting components and going back to a prefab do
            changes = {"Light": {"intensity": 1.0 + second}, ("Material", "Collider", "RigidBody")[second % 3]: None}
            return edit.lay_over("Revert to the prefab: {what}", dict.fromkeys(chosen, changes))
        case "drop":
            return edit.spawn_records("Add", model_records(second / 9.0))
        case "settings":
            return edit.set_settings(SceneSettings(substeps=1 + second % 8))
        case "undo":
            return model.history.undo() if model.history.undo_label else None
        case "redo":
            return model.history.redo() if model.history.redo_label else None


def model_records(height: float) -> list[EntityRecord]:
    """What a model that is let go in a viewport makes: a tree of entities."""
    root = EntityRecord(name="Model", components={"Transform": {"position": [0.5, height, 0.0]}})
    part = EntityRecord(
        name="Part",
        parent=0,
        components={"Transform": {"position": [0.0, 1.0, 0.0]}, "MeshRenderer": {"mesh": "box"}, "Collider": {}},
    )
    return [root, part]
