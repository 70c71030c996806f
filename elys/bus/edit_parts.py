"""What of a scene an edit changes, part by part: the measure by which two people's edits get in each other's way."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from elys.bus.messages.commands import (
    AddComponent,
    Batch,
    Command,
    Edit,
    RemoveComponent,
    Rename,
    Reparent,
    SetComponent,
    SetEnabled,
    SetSettings,
)

Part = tuple[int, str]  # an entity (0: the scene) and a component's name, or one of those below

NAME: Final = "name"
PLACE: Final = "place in the tree"
SWITCH: Final = "switch"
SETTINGS: Final = "settings"


def edits_of(command: Command) -> tuple[Edit, ...]:
    """The edits that a command consists of; () for one that is none."""
    if isinstance(command, Batch):
        return command.edits
    return (command,) if isinstance(command, Edit) else ()


def parts_of(edits: Iterable[Edit]) -> list[Part]:
    """What edits change of what is there, each part once; spawning and ending entities is no change of theirs."""
    parts: dict[Part, None] = {}
    for edit in edits:
        match edit:
            case SetComponent() | AddComponent() | RemoveComponent():
                parts[edit.entity, edit.component] = None
            case Rename():
                parts[edit.entity, NAME] = None
            case SetEnabled():
                parts[edit.entity, SWITCH] = None
            case Reparent():
                parts[edit.entity, PLACE] = None
                if edit.keep_world_pose:
                    parts[edit.entity, "Transform"] = None
            case SetSettings():
                parts[0, SETTINGS] = None
    return list(parts)
