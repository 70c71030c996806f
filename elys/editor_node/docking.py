"""Where windows stand: the layout of the beginning, that of four views, and places for viewports that come later."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.panels import (
    assets,
    changes,
    console,
    diagnostics,
    hierarchy,
    history_list,
    inspector,
    plan,
    plots,
    profiler,
    timeline,
    topics,
)
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.viewports import Viewports

_DOCK_NAME: Final = "editor"
# Left, right and lower panels take these shares of the window; the viewports have the rest.
_LEFT_SHARE: Final = 0.19
_RIGHT_SHARE: Final = 0.29
_LOWER_SHARE: Final = 0.27
_LOWER: Final = (
    console.TITLE,
    assets.TITLE,
    timeline.TITLE,
    profiler.TITLE,
    plots.TITLE,
    diagnostics.TITLE,
    topics.TITLE,
    plan.TITLE,
    history_list.TITLE,
    changes.TITLE,
)


class Docking:
    """Places windows before they are drawn; where a person moves them they stay."""

    def __init__(self, viewports: Viewports, *, load: Callable[[str], None]) -> None:
        """`load` places all windows as `imgui.save_ini_settings_to_memory` once told, before the next frame."""
        self._viewports = viewports
        self.load = load
        self._is_reset = False
        self._waiting: dict[int, ViewportPanel | None] = {}  # numbers of those to be placed, and beside whom
        viewports.on_open = self._welcome

    def reset(self) -> None:
        """The layout of the beginning, with all viewports that are open, before the next frame."""
        self._is_reset = True

    def place(self, panel: ViewportPanel, beside: ViewportPanel) -> None:
        """Halves the place of one viewport for another, before the next frame."""
        self._waiting[panel.number] = beside

    def submit(self) -> bool:
        """Call it before the windows are drawn. Whether the layout of the beginning was built."""
        dock = imgui.get_id(_DOCK_NAME)
        is_built = imgui.internal.dock_builder_get_node(dock) is None or self._is_reset
        if is_built:
            self._build(dock)
        for number, beside in self._waiting.items():
            panel = next((panel for panel in self._viewports if panel.number == number), None)
            if panel is not None and (beside is not None or not _has_place(panel)):
                _halve(beside or self._viewports.first, panel)
        self._waiting.clear()
        # Passing through spares a background that panels cover anyway: on software GL every layer of pixels is dear.
        imgui.dock_space_over_viewport(
            dock, imgui.get_main_viewport(), imgui.DockNodeFlags_.passthru_central_node.value
        )
        return is_built

    def _welcome(self, panel: ViewportPanel) -> None:
        """Whoever was open before comes back to the place it had, if that is still there."""
        self._waiting.setdefault(panel.number, None)

    def _build(self, dock: int) -> None:
        self._is_reset = False
        self._waiting.clear()
        builder = imgui.internal
        builder.dock_builder_remove_node(dock)
        builder.dock_builder_add_node(dock, imgui.internal.DockNodeFlagsPrivate_.dock_space.value)
        builder.dock_builder_set_node_pos(dock, imgui.get_main_viewport().work_pos)
        builder.dock_builder_set_node_size(dock, imgui.get_main_viewport().work_size)
        left = builder.dock_builder_split_node(dock, imgui.Dir.left, _LEFT_SHARE)
        right = builder.dock_builder_split_node(left.id_at_opposite_dir, imgui.Dir.right, _RIGHT_SHARE)
        lower = builder.dock_builder_split_node(right.id_at_opposite_dir, imgui.Dir.down, _LOWER_SHARE)
        builder.dock_builder_dock_window(hierarchy.TITLE, left.id_at_dir)
        builder.dock_builder_dock_window(inspector.TITLE, right.id_at_dir)
        for title in _LOWER:
            builder.dock_builder_dock_window(title, lower.id_at_dir)
        _fill(lower.id_at_opposite_dir, list(self._viewports))
        builder.dock_builder_finish(dock)


def _fill(node: int, panels: list[ViewportPanel]) -> None:
    """One beside another; three and four in two rows, the first above left."""
    builder = imgui.internal
    rows = [node]
    if len(panels) > 2:
        halves = builder.dock_builder_split_node(node, imgui.Dir.down, 0.5)
        rows = [halves.id_at_opposite_dir, halves.id_at_dir]
    for place, row in enumerate(rows):
        pair = panels[2 * place : 2 * place + 2]
        if len(pair) == 2:
            halves = builder.dock_builder_split_node(row, imgui.Dir.right, 0.5)
            builder.dock_builder_dock_window(pair[1].title, halves.id_at_dir)
            row = halves.id_at_opposite_dir
        builder.dock_builder_dock_window(pair[0].title, row)


def _halve(old: ViewportPanel, new: ViewportPanel) -> None:
    """Along the longer edge; a viewport that floats freely keeps its place, and the new one floats as well."""
    window = imgui.internal.find_window_by_name(f"###{old.name}")
    if window is None or not window.dock_id or imgui.internal.dock_builder_get_node(window.dock_id) is None:
        return
    _, _, width, height = old.rectangle
    way = imgui.Dir.right if width >= height else imgui.Dir.down
    halves = imgui.internal.dock_builder_split_node(window.dock_id, way, 0.5)
    imgui.internal.dock_builder_dock_window(new.title, halves.id_at_dir)


def _has_place(panel: ViewportPanel) -> bool:
    """Whether its window stood somewhere that is still there."""
    name = f"###{panel.name}"
    window = imgui.internal.find_window_by_name(name)
    settings = imgui.internal.find_window_settings_by_id(imgui.internal.im_hash_str(name))
    if window is None and settings is None:
        return False
    dock_id = window.dock_id if window is not None else settings.dock_id
    return not dock_id or imgui.internal.dock_builder_get_node(dock_id) is not None
