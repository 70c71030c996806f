"""The browser of assets: a folder's models, images, scenes and lights, to be dragged into the scene."""

from __future__ import annotations

from typing import Final

import numpy as np
from imgui_bundle import imgui

from elys.common.errors import BusError
from elys.editor_node.asset_browsing import ORDERS, AssetBrowsing, project_folder
from elys.editor_node.asset_folder import AssetFile
from elys.editor_node.asset_library import AssetLibrary
from elys.editor_node.asset_placing import Point, ground_point
from elys.editor_node.asset_uses import PREFAB
from elys.editor_node.fields import ASSET_PAYLOAD
from elys.editor_node.gpu import TextureShelf
from elys.editor_node.language import tr, tr_title
from elys.editor_node.panels.asset_dialogs import AssetDialogs
from elys.editor_node.panels.asset_tiles import FILE_PAYLOAD, AssetTiles, size_text
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.theme import ERROR, WARNING, icons
from elys.editor_node.ui import Ui, colored_text, dim_text, icon_button, with_keys

TITLE: Final = f"{icons.ICON_FA_FOLDER_OPEN}  Assets###Assets"
_LOOKED_AT: Final = 8  # frames: while the panels take their places each is seen for one or two
_SMALLEST, _LARGEST = 24.0, 192.0  # [px at 96 dpi] of a tile


class AssetsPanel:
    """Shows one folder; `library` reads it."""

    def __init__(self, library: AssetLibrary, shelf: TextureShelf[object]) -> None:
        self.library = library
        self.browsing = AssetBrowsing()
        self.dialogs = AssetDialogs(library, self.browsing)
        self.tiles = AssetTiles(library, self.browsing, shelf)
        self.shows_missing = False
        self._shelf = shelf
        self._starts_search = False
        self._comes_to_front = 0  # frames: a tab is in front when its window has kept the focus into the next one
        self._frames_seen = 0

    def begin_frame(self) -> None:
        """Call it before a frame is built, whether this is seen in it or not."""
        self._shelf.begin_frame()

    def search(self) -> None:
        """Puts the cursor into the search."""
        self._starts_search, self._comes_to_front = True, 2

    def toggle_missing(self) -> None:
        """Shows what the scene names and nobody has, or the folder again."""
        self.shows_missing = not self.shows_missing
        self._comes_to_front = 2

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if self._comes_to_front:
            self._comes_to_front -= 1
            imgui.set_next_window_focus()
            ui.model.request_redraw(0.0)
        is_visible = imgui.begin(tr_title(TITLE))[0]
        self._frames_seen = self._frames_seen + 1 if is_visible else 0
        # A folder that was chosen before is followed from the start; else nothing is read until somebody looks.
        if self.library.folder is None and (self._frames_seen > _LOOKED_AT or ui.preferences.recent_folders):
            self.library.open(project_folder(ui.preferences, ui.model.file.path))
        if is_visible:
            if self.library.folder is None:
                ui.model.request_redraw(0.0)
            self._draw_bar(ui)
            if self.shows_missing:
                self._draw_missing(ui)
            else:
                line = imgui.get_frame_height_with_spacing()
                if imgui.begin_child("###shown", (0.0, -line)):
                    self.tiles.draw(ui)
                imgui.end_child()
                self._draw_selected(ui)
                if self.tiles.opened is not None:
                    self.place(ui, self.tiles.opened)
        imgui.end()
        self.dialogs.draw(ui)

    def _draw_bar(self, ui: Ui) -> None:
        if icon_button(icons.ICON_FA_FOLDER_OPEN, "folder", tr("Show another folder")):
            self.dialogs.ask_folder()
        ui.landmarks.note("assets/choose")
        imgui.same_line()
        root = self.library.listing.root
        names = [(root.name or str(root), ""), *self.browsing.parts()]
        for number, (name, folder) in enumerate(names):
            if number:
                imgui.same_line(0.0, 2.0)
                dim_text(icons.ICON_FA_CHEVRON_RIGHT)
                imgui.same_line(0.0, 2.0)
            if imgui.button(f"{name}###part {number}"):
                self.browsing.enter(folder)
            ui.landmarks.note(f"assets/part/{number}")
        if self.library.listing.cut:
            imgui.same_line()
            colored_text(WARNING, icons.ICON_FA_TRIANGLE_EXCLAMATION)
            imgui.set_item_tooltip(tr("The folder is too large, or part of it may not be read: not all is shown"))
        width = imgui.get_font_size() * 12.0
        right = imgui.get_font_size() * 33.0
        imgui.same_line(max(imgui.get_cursor_pos_x() + 8.0, imgui.get_window_width() - right))
        imgui.set_next_item_width(width)
        if self._starts_search:
            self._starts_search = False
            imgui.set_keyboard_focus_here()
        _, self.browsing.search = imgui.input_text_with_hint("###search", tr("Search, t:image"), self.browsing.search)
        ui.landmarks.note("assets/search")
        self._draw_view_choice(ui)

    def _draw_view_choice(self, ui: Ui) -> None:
        imgui.same_line()
        imgui.set_next_item_width(imgui.get_font_size() * 5.0)
        if imgui.begin_combo("###order", tr(self.browsing.order.capitalize())):
            for order in ORDERS:
                if imgui.selectable(f"{tr(order.capitalize())}###{order}", order == self.browsing.order)[0]:
                    self.browsing.order = order
                ui.landmarks.note(f"assets/order/{order}")
            imgui.end_combo()
        else:
            ui.landmarks.note("assets/order")
        imgui.same_line()
        imgui.set_next_item_width(imgui.get_font_size() * 6.0)
        size = min(max(ui.preferences.asset_size, _SMALLEST), _LARGEST)
        _, ui.preferences.asset_size = imgui.slider_float("###size", size, _SMALLEST, _LARGEST, "")
        ui.landmarks.note("assets/size")
        imgui.set_item_tooltip(tr("Size of the tiles; the smallest are a list"))
        imgui.same_line()
        if icon_button(icons.ICON_FA_FILE_IMPORT, "import", with_keys(ui, tr("Import files"), "assets.import")):
            self.dialogs.ask_import()
        ui.landmarks.note("assets/import")
        imgui.same_line()
        tooltip = tr("What the scene names and nobody has")
        if icon_button(icons.ICON_FA_LINK_SLASH, "missing", tooltip, active=self.shows_missing):
            self.shows_missing = not self.shows_missing
        ui.landmarks.note("assets/missing")

    # --- what is selected ------------------------------------------------------------------------------------------

    def _draw_selected(self, ui: Ui) -> None:
        file = next((f for f in self.library.listing.files if f.path == self.browsing.selected), None)
        if file is None:
            dim_text(tr("{count} assets", count=len(self.library.listing.files)))
            return
        content = self.library.content(file)
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(file.name)
        imgui.same_line()
        dim_text(size_text(file.size))
        imgui.same_line()
        if content is None:
            return
        if content.error:
            colored_text(ERROR, content.error)
            return
        users = list(dict.fromkeys(use.entity for use in self.library.uses(content)))
        text = tr("Used by {count} entities", count=len(users)) if users else tr("Not used in the scene")
        imgui.begin_disabled(not users)
        if imgui.small_button(f"{text}###users"):
            ui.model.selection.replace(users)
        imgui.end_disabled()
        ui.landmarks.note("assets/users")

    # --- what is missing -------------------------------------------------------------------------------------------

    def _draw_missing(self, ui: Ui) -> None:
        mirror = ui.model.scene.mirror
        if self.library.missing_of != (mirror.epoch, mirror.sequence):
            self.library.look_for_missing()
        missing = self.library.missing
        if self.library.missing_error:
            colored_text(ERROR, self.library.missing_error)
        elif missing is None:
            dim_text(tr("Asking the simulation what it has..."))
        elif not missing:
            dim_text(tr("Nothing is missing: the simulation has all that the scene names"))
        else:
            self._draw_missing_table(ui)

    def _draw_missing_table(self, ui: Ui) -> None:
        rows = [(asset.reference, use) for asset in self.library.missing or () for use in asset.uses]
        flags = imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg | imgui.TableFlags_.resizable
        if not imgui.begin_table("###missing table", 3, flags.value):
            return
        imgui.table_setup_scroll_freeze(0, 1)
        for label in (tr("Entity"), tr("Field"), tr("Asset that nobody has")):
            imgui.table_setup_column(label)
        imgui.table_headers_row()
        clipper = imgui.ListClipper()
        clipper.begin(len(rows))
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                reference, use = rows[place]
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.push_id(place)
                is_selected = use.entity in ui.model.selection
                spanning = imgui.SelectableFlags_.span_all_columns.value
                if imgui.selectable("###row", is_selected, spanning)[0]:
                    ui.model.selection.replace((use.entity,))
                ui.landmarks.note(f"assets/missing/{place}")
                imgui.pop_id()
                imgui.same_line()
                imgui.text_unformatted(ui.model.scene.name_of(use.entity))
                imgui.table_next_column()
                imgui.text_unformatted(use.component if use.component == PREFAB else f"{use.component}.{use.field}")
                imgui.table_next_column()
                dim_text(reference)
        clipper.end()
        imgui.end_table()

    # --- putting into the scene ------------------------------------------------------------------------------------

    def place(self, ui: Ui, file: AssetFile) -> None:
        """Puts an asset where the viewport's camera looks, an image on what is selected."""
        if ui.model.is_replay:
            return
        point = np.array(ui.focus, dtype=np.float64)
        ui.model.session.start(self._place(file, point, ui.model.selection.primary))

    def take_drop(self, ui: Ui, viewport: ViewportPanel) -> None:
        """Call it after a viewport's picture: takes an asset that is let go over it."""
        if not imgui.begin_drag_drop_target():
            return
        carried = self.tiles.dragged
        taken = imgui.accept_drag_drop_payload_py_id(ASSET_PAYLOAD)
        if taken is None:
            taken = imgui.accept_drag_drop_payload_py_id(FILE_PAYLOAD)
        imgui.end_drag_drop_target()
        if taken is not None and carried is not None and not ui.model.is_replay:
            mouse = imgui.get_mouse_pos()
            ui.model.session.start(self._drop(ui, viewport, carried, mouse.x, mouse.y))

    async def _drop(self, ui: Ui, viewport: ViewportPanel, file: AssetFile, mouse_x: float, mouse_y: float) -> None:
        """Where what is seen under the pointer is; where nothing is, on the ground."""
        stream = viewport.stream
        left, top, width, height = viewport.rectangle
        across, down = (mouse_x - left) / width, (mouse_y - top) / height
        camera = stream.shown.camera if stream.shown is not None else viewport.camera.view
        point = ground_point(camera, width / height, 2.0 * across - 1.0, 1.0 - 2.0 * down, ui.focus)
        onto = 0
        if stream.shown is not None:
            try:
                reply = await stream.pick(int(across * stream.shown.width), int(down * stream.shown.height))
            except BusError as error:
                ui.model.say("warning", tr("What is under the pointer is not known: {error}", error=error))
            else:
                if ui.model.scene.exists(reply.entity):
                    onto, point = reply.entity, np.array(reply.position, dtype=np.float64)
        await self._place(file, point, onto)

    async def _place(self, file: AssetFile, point: Point, onto: int) -> None:
        await self.library.placing.place(file, point, onto=onto)
