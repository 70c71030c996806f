"""The hierarchy: the tree of entities, searched, sorted, selected, renamed, rearranged and switched here."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

from elys.bus.tree.filter import EVERYTHING, EntityFilter, FilterError, parse_filter
from elys.bus.tree.order import Order
from elys.bus.tree.rows import TreeRows
from elys.editor_node.fields import ENTITY_PAYLOAD
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels.hierarchy_menus import draw_add_menu, draw_examples, draw_orders
from elys.editor_node.panels.hierarchy_row import HierarchyRow
from elys.editor_node.theme import WARNING, icons
from elys.editor_node.ui import Ui, centered_text, icon_button

_SHARE: Final = 4e-3  # [s] of a frame for making the lines of a large scene anew
TITLE: Final = f"{icons.ICON_FA_SITEMAP}  Hierarchy###Hierarchy"


class HierarchyPanel:
    """Only the lines to be seen are drawn, so that fifty thousand entities cost no more than fifty."""

    def __init__(self) -> None:
        self.is_focused = False  # whether keys walk through the tree
        self.page = 10  # rows that are seen at once
        self._search = ""
        self._filter = EVERYTHING
        self._problem: FilterError | None = None
        self._order: Order = "scene"
        self._focuses_search = False
        self._row = HierarchyRow()
        self._revealed_version = -1
        self._scroll_to = 0

    def start_renaming(self, ui: Ui, entity: int) -> None:
        """Puts a text field where the entity's name is."""
        if ui.model.scene.exists(entity):
            ui.model.scene.reveal(entity)
            self._row.start_renaming(ui, entity)
            self._scroll_to = entity

    def start_searching(self) -> None:
        """Puts the text cursor where the search is."""
        self._focuses_search = True

    def search_for(self, text: str) -> None:
        """Shows what a search finds."""
        self._search = text
        try:
            self._filter, self._problem = parse_filter(text), None
        except FilterError as error:  # what was found before stays, until the sentence is whole
            self._problem = error

    def rows(self, ui: Ui) -> TreeRows:
        """The lines of the tree as this panel shows them; all of them, even where a frame shows them later."""
        return ui.model.scene.tree.show(self._filter, self._order)

    @property
    def filter(self) -> EntityFilter:
        """What the lines are found by."""
        return self._filter

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE)[0]:
            self._draw_search(ui)
            if imgui.begin_child("###tree", (0.0, 0.0), 0, imgui.WindowFlags_.no_nav.value):
                self.is_focused = imgui.is_window_focused()
                self._draw_tree(ui)
            imgui.end_child()
        else:
            self.is_focused = False
        imgui.end()

    def _draw_search(self, ui: Ui) -> None:
        spacing = imgui.get_style().item_inner_spacing.x
        button = imgui.get_frame_height() * 1.15 + spacing
        imgui.set_next_item_width(imgui.get_content_region_avail().x - 3.0 * button)
        if self._focuses_search:
            self._focuses_search = False
            imgui.set_keyboard_focus_here()
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {tr('Search, or t:Light')}"
        changed, text = imgui.input_text_with_hint("###search", hint, self._search)
        ui.landmarks.note("hierarchy/search")
        if changed:
            self.search_for(text)
        imgui.same_line(0.0, spacing)
        if icon_button(icons.ICON_FA_FILTER, "filters", tr("Ways to search"), active=self._filter is not EVERYTHING):
            imgui.open_popup("filters")
        ui.landmarks.note("hierarchy/filters")
        imgui.same_line(0.0, spacing)
        if icon_button(icons.ICON_FA_ARROW_DOWN_SHORT_WIDE, "order", tr("Order"), active=self._order != "scene"):
            imgui.open_popup("order")
        ui.landmarks.note("hierarchy/order")
        imgui.same_line(0.0, spacing)
        if icon_button(icons.ICON_FA_PLUS, "add", tr("Add an entity")):
            imgui.open_popup("add")
        ui.landmarks.note("hierarchy/add")
        self._draw_popups(ui)
        if self._problem is not None:
            self._draw_problem(ui, self._problem)

    def _draw_popups(self, ui: Ui) -> None:
        if imgui.begin_popup("filters"):
            chosen = draw_examples(ui)
            if chosen is not None:
                self.search_for(chosen)
            imgui.end_popup()
        if imgui.begin_popup("order"):
            self._order = draw_orders(ui, self._order)
            imgui.end_popup()
        if imgui.begin_popup("add"):
            draw_add_menu(ui, parent=0)
            imgui.end_popup()

    def _draw_problem(self, ui: Ui, problem: FilterError) -> None:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*WARNING))
        imgui.push_text_wrap_pos(0.0)
        imgui.text_unformatted(tr(problem.problem, **problem.values))
        imgui.pop_text_wrap_pos()
        imgui.pop_style_color()
        ui.landmarks.note("hierarchy/problem")

    def _draw_tree(self, ui: Ui) -> None:
        self._reveal_selection(ui)
        rows = ui.model.scene.tree.show(self._filter, self._order, share=_SHARE)
        if rows.is_behind:
            ui.model.request_redraw(0.0)
        elif not rows:
            self._draw_nothing(ui)
        imgui.push_style_var_y(imgui.StyleVar_.item_spacing, 1.0)
        height = imgui.get_frame_height()
        self.page = max(1, int(imgui.get_window_height() / (height + 1.0)) - 1)
        if self._scroll_to and not rows.is_behind:
            self._scroll(rows, height + 1.0)
        clipper = imgui.ListClipper()
        clipper.begin(len(rows), height + 1.0)
        while clipper.step():
            # What is drawn may open, close or end what is below it.
            for place in range(clipper.display_start, min(clipper.display_end, len(rows))):
                self._draw_row(ui, rows, place, height)
        clipper.end()
        imgui.pop_style_var()
        self._draw_rest(ui)

    def _draw_row(self, ui: Ui, rows: TreeRows, place: int, height: float) -> None:
        version = ui.model.selection.version
        self._row.draw(
            ui, rows, rows[place], height, is_dim=rows.is_filtered and rows.entities[place] not in rows.found
        )
        if ui.model.selection.version != version:
            self._revealed_version = ui.model.selection.version  # it is in sight: nothing to scroll to

    def _reveal_selection(self, ui: Ui) -> None:
        """What was selected elsewhere (in the viewport) is opened and scrolled to."""
        selection = ui.model.selection
        if selection.version != self._revealed_version:
            self._revealed_version = selection.version
            if selection.primary and ui.model.scene.exists(selection.primary):
                ui.model.scene.reveal(selection.primary)
                self._scroll_to = selection.primary

    def _scroll(self, rows: TreeRows, pitch: float) -> None:
        place = rows.place_of(self._scroll_to)
        self._scroll_to = 0
        if place < 0:
            return
        top, bottom, height = place * pitch, (place + 1) * pitch, imgui.get_window_height()
        if top < imgui.get_scroll_y():
            imgui.set_scroll_y(max(0.0, top - height * 0.3))
        elif bottom > imgui.get_scroll_y() + height:
            imgui.set_scroll_y(bottom - height * 0.7)

    def _draw_rest(self, ui: Ui) -> None:
        """What lies below the last line: a click selects nothing, a drop moves to the top."""
        size = imgui.get_content_region_avail()
        if size.y < 4.0 or size.x < 1.0:
            return
        if imgui.invisible_button("###rest", (size.x, size.y)):
            ui.model.selection.clear()
        ui.landmarks.note("hierarchy/rest")
        if imgui.begin_drag_drop_target():
            payload = imgui.accept_drag_drop_payload_py_id(ENTITY_PAYLOAD)
            if payload is not None:
                dragged, selection = payload.data_id, ui.model.selection
                ui.model.edit.reparent(selection.entities if dragged in selection else (dragged,), 0)
            imgui.end_drag_drop_target()
        if imgui.begin_popup_context_item("add here"):
            if imgui.begin_menu(tr_label("Add")):
                draw_add_menu(ui, parent=0)
                imgui.end_menu()
            imgui.end_popup()

    def _draw_nothing(self, ui: Ui) -> None:
        imgui.dummy((0.0, imgui.get_frame_height()))
        if self._filter is not EVERYTHING:
            text = tr("Nothing here is '{search}'", search=self._search)
        elif ui.model.scene.is_known:
            text = tr("The scene is empty")
        else:
            text = tr("Waiting for the scene")
        centered_text(text, imgui.get_content_region_avail().x)
