"""The actions of the hierarchy: clipboard, grouping, marks, selecting others, and walking through the tree with keys."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from elys.bus.tree.rows import TreeRows
from elys.editor_node import related_entities
from elys.editor_node.actions import Action
from elys.editor_node.entity_marks import Mark
from elys.editor_node.ui import Ui


class TreePanel(Protocol):
    """What the actions need of the panel."""

    is_focused: bool
    page: int

    def rows(self, ui: Ui) -> TreeRows:
        """The lines as the panel shows them."""

    def start_searching(self) -> None:
        """Puts the text cursor into the search."""


def tree_actions(ui: Ui, panel: TreePanel) -> tuple[Action, ...]:
    """All of them."""
    return (
        *_clipboard_actions(ui, panel),
        *_mark_actions(ui),
        *_select_actions(ui, panel),
        *_opening_actions(ui),
        *_walking_actions(ui, panel),
    )


def _clipboard_actions(ui: Ui, panel: TreePanel) -> tuple[Action, ...]:
    tree, selection = ui.model.tree, ui.model.selection

    def any_selected() -> bool:
        return len(selection) > 0

    return (
        Action(name="edit.cut", label="Cut", keys=("Ctrl+X",), run=tree.cut, is_possible=any_selected),
        Action(name="edit.copy", label="Copy", keys=("Ctrl+C",), run=tree.copy, is_possible=any_selected),
        Action(name="edit.paste", label="Paste", keys=("Ctrl+V",), run=ui.model.paste),
        Action(name="edit.group", label="Group", keys=("Ctrl+G",), run=tree.group, is_possible=any_selected),
        Action(name="edit.find", label="Find", keys=("Ctrl+F",), run=panel.start_searching),
    )


def _mark_actions(ui: Ui) -> tuple[Action, ...]:
    marks, selection = ui.model.scene.marks, ui.model.selection

    def are_all(mark: Mark) -> bool:
        return len(selection) > 0 and all(marks.has(mark, entity) for entity in selection)

    def turn(mark: Mark) -> None:
        marks.set(mark, selection.entities, not are_all(mark))

    return (
        Action(
            name="tree.lock",
            label="Locked",
            keys=("Ctrl+L",),
            run=lambda: turn("locked"),
            is_possible=lambda: len(selection) > 0,
            is_on=lambda: are_all("locked"),
        ),
        Action(
            name="tree.hide",
            label="Hidden in this editor",
            keys=("Ctrl+H",),
            run=lambda: turn("hidden"),
            is_possible=lambda: len(selection) > 0,
            is_on=lambda: are_all("hidden"),
        ),
        Action(
            name="tree.show_all",
            label="Show all that is hidden",
            keys=("Ctrl+Shift+H",),
            run=lambda: marks.clear("hidden"),
            is_possible=lambda: bool(marks.own("hidden")),
        ),
        Action(
            name="tree.unlock_all",
            label="Unlock all",
            keys=("Ctrl+Shift+L",),
            run=lambda: marks.clear("locked"),
            is_possible=lambda: bool(marks.own("locked")),
        ),
    )


def _select_actions(ui: Ui, panel: TreePanel) -> tuple[Action, ...]:
    model = ui.model
    selection, scene, mirror = model.selection, model.scene, model.scene.mirror

    def any_selected() -> bool:
        return len(selection) > 0

    def select(entities: Iterable[int]) -> None:
        found = list(entities)
        if found:  # to have nothing instead would be no help
            selection.replace(found)

    def invert() -> None:
        rows = panel.rows(ui)
        shown = rows.found if rows.is_filtered else None
        selection.replace(
            entity
            for entity in related_entities.others_than(rows.entities, selection)
            if shown is None or entity in shown
        )

    return (
        Action(
            name="select.children",
            label="Children",
            run=lambda: select(related_entities.children_of(mirror, selection)),
            is_possible=any_selected,
        ),
        Action(
            name="select.parent",
            label="Parent",
            run=lambda: select(related_entities.parents_of(mirror, selection)),
            is_possible=any_selected,
        ),
        Action(name="select.inverse", label="Inverse", keys=("Ctrl+I",), run=invert),
        Action(
            name="select.same_components",
            label="Those with the same components",
            run=lambda: select(related_entities.of_same_components(mirror, selection.primary)),
            is_possible=any_selected,
        ),
        Action(
            name="select.back",
            label="What was selected before",
            keys=("Alt+Left Arrow",),
            run=lambda: selection.go_back(scene.exists),
            is_possible=lambda: selection.has_past,
            repeats=True,
        ),
        Action(
            name="select.forward",
            label="What was selected after",
            keys=("Alt+Right Arrow",),
            run=lambda: selection.go_forward(scene.exists),
            is_possible=lambda: selection.has_future,
            repeats=True,
        ),
    )


def _opening_actions(ui: Ui) -> tuple[Action, ...]:
    tree, selection = ui.model.scene.tree, ui.model.selection

    def any_selected() -> bool:
        return len(selection) > 0

    return (
        Action(name="tree.expand_all", label="Open all", run=lambda: tree.set_all_open(True)),
        Action(name="tree.collapse_all", label="Close all", run=lambda: tree.set_all_open(False)),
        Action(
            name="tree.open_below",
            label="Open all below",
            run=lambda: tree.set_all_open(True, selection.entities),
            is_possible=any_selected,
        ),
        Action(
            name="tree.close_below",
            label="Close all below",
            run=lambda: tree.set_all_open(False, selection.entities),
            is_possible=any_selected,
        ),
    )


def _walking_actions(ui: Ui, panel: TreePanel) -> tuple[Action, ...]:
    """Possible only while the hierarchy has the keyboard: elsewhere these keys mean something else."""
    walk = ui.model.walk

    def is_here() -> bool:
        return panel.is_focused

    def both(name: str, label: str, key: str) -> tuple[Action, Action]:
        """Going there, and selecting all on the way."""

        def go(*, extends: bool) -> None:
            panel.rows(ui)  # as they are now
            match name:
                case "first":
                    walk.go_to(0, extends=extends)
                case "last":
                    walk.go_to(-1, extends=extends)
                case "page_up" | "page_down":
                    walk.step(panel.page if name == "page_down" else -panel.page, extends=extends)
                case _:
                    walk.step(1 if name == "down" else -1, extends=extends)

        return (
            Action(
                name=f"tree.{name}",
                label=label,
                keys=(key,),
                run=lambda: go(extends=False),
                is_possible=is_here,
                repeats=True,
            ),
            Action(
                name=f"tree.extend_{name}",
                label=f"{label}, selecting all on the way",
                keys=(f"Shift+{key}",),
                run=lambda: go(extends=True),
                is_possible=is_here,
                repeats=True,
            ),
        )

    return (
        *both("up", "Line above", "Up Arrow"),
        *both("down", "Line below", "Down Arrow"),
        *both("page_up", "Page above", "Page Up"),
        *both("page_down", "Page below", "Page Down"),
        *both("first", "First line", "Home"),
        *both("last", "Last line", "End"),
        Action(
            name="tree.in",
            label="Open, or go below",
            keys=("Right Arrow",),
            run=walk.go_in,
            is_possible=is_here,
            repeats=True,
        ),
        Action(
            name="tree.out",
            label="Close, or go above",
            keys=("Left Arrow",),
            run=walk.go_out,
            is_possible=is_here,
            repeats=True,
        ),
    )
