"""The menus File, Edit and Help: lines of actions."""

from __future__ import annotations

from imgui_bundle import imgui

from elys.editor_node.language import tr_label
from elys.editor_node.panels.hierarchy_menus import draw_select_menu
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.ui import Ui, action_item


def draw_file_menu(ui: Ui) -> None:
    """Scenes, assets, sessions and preferences."""
    if imgui.begin_menu(tr_label("File")):
        action_item(ui, "file.open")
        action_item(ui, "file.save")
        action_item(ui, "file.save_as")
        action_item(ui, "file.save_running")
        action_item(ui, "file.revert")
        action_item(ui, "file.changes")
        imgui.separator()
        action_item(ui, "assets.import")
        action_item(ui, "assets.folder")
        imgui.separator()
        action_item(ui, "file.connect")
        action_item(ui, "file.detach")
        imgui.separator()
        action_item(ui, "file.preferences")
        action_item(ui, "file.quit")
        imgui.end_menu()
    else:
        ui.landmarks.note("menu/file")


def draw_edit_menu(ui: Ui) -> None:
    """The history and what is selected."""
    history = ui.model.history
    ui.landmarks.note("menu/edit")
    if not imgui.begin_menu(tr_label("Edit")):
        return
    action_item(ui, "edit.undo", tr_sentence(f"Undo {history.undo_label}".strip()))
    action_item(ui, "edit.redo", tr_sentence(f"Redo {history.redo_label}".strip()))
    action_item(ui, "edit.history")
    imgui.separator()
    for name in (
        "edit.cut",
        "edit.copy",
        "edit.paste",
        "edit.duplicate",
        "edit.rename",
        "edit.group",
        "edit.drop",
        "edit.delete",
    ):
        action_item(ui, name)
    imgui.separator()
    action_item(ui, "edit.select_all")
    draw_select_menu(ui)
    action_item(ui, "edit.find")
    for name in ("search", "add_component", "fold_all", "unfold_all", "revert_all"):
        action_item(ui, f"inspector.{name}")
    imgui.end_menu()


def draw_help_menu(ui: Ui) -> None:
    """Keys, the tour, and what this is."""
    if imgui.begin_menu(tr_label("Help")):
        for name in ("help.keys", "help.tour", "help.about"):
            action_item(ui, name)
        imgui.end_menu()
    else:
        ui.landmarks.note("menu/help")
