"""What the hand holds in a viewport, and how it takes hold."""

from __future__ import annotations

from elys.editor_node.actions import Action
from elys.editor_node.ui import Tool, Tools


def tool_actions(tools: Tools) -> tuple[Action, ...]:
    """All of them."""

    def take(tool: Tool, label: str, key: str) -> Action:
        return Action(
            name=f"tool.{tool}",
            label=label,
            keys=(key,),
            run=lambda: setattr(tools, "tool", tool),
            is_on=lambda: tools.tool == tool,
        )

    return (
        take("select", "Select", "Q"),
        take("move", "Move", "W"),
        take("rotate", "Rotate", "E"),
        take("scale", "Scale", "R"),
        take("grab", "Drag bodies", "G"),
        Action(
            name="tool.local",
            label="Along the entity's own axes",
            run=lambda: setattr(tools, "is_local", not tools.is_local),
            is_on=lambda: tools.is_local,
        ),
        Action(
            name="tool.median",
            label="Turn and scale about the middle",
            run=lambda: setattr(tools, "pivot", "active" if tools.pivot == "median" else "median"),
            is_on=lambda: tools.pivot == "median",
        ),
        Action(
            name="tool.snap",
            label="Snap",
            run=lambda: setattr(tools, "snaps", not tools.snaps),
            is_on=lambda: tools.snaps,
        ),
    )
