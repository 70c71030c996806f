"""Folders and files of the asset browser as tiles or lines, with their thumbnails; dragged from here to fields and views."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

from elys.editor_node.asset_browsing import AssetBrowsing
from elys.editor_node.asset_folder import AssetFile, AssetType
from elys.editor_node.asset_library import AssetLibrary
from elys.editor_node.fields import DraggedAsset, drag_asset
from elys.editor_node.gpu import TextureShelf
from elys.editor_node.language import tr
from elys.editor_node.theme import ACCENT, ERROR, FIELD, FILL, HEADER, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, color_code, colored_text, dim_text

FILE_PAYLOAD: Final = (
    "elys_asset_file"  # an asset that a view takes and no field: what a payload stands for is the panel's
)
LIST_BELOW: Final = 48.0  # [px at 96 dpi] of a tile's edge, less is a list
ICONS: Final[dict[AssetType, str]] = {
    "model": icons.ICON_FA_CUBES,
    "image": icons.ICON_FA_IMAGE,
    "light": icons.ICON_FA_SUN,
    "scene": icons.ICON_FA_CLAPPERBOARD,
    "prefab": icons.ICON_FA_BOXES_STACKED,
    "heights": icons.ICON_FA_MOUNTAIN_SUN,
}
_WORDS: Final[dict[AssetType, str]] = {
    "model": "model",
    "image": "image",
    "light": "light all around",
    "scene": "scene",
    "prefab": "prefab",
    "heights": "heights",
}


class AssetTiles:
    """Draws what is shown of a folder, and no more than can be seen of it."""

    def __init__(self, library: AssetLibrary, browsing: AssetBrowsing, shelf: TextureShelf[object]) -> None:
        self._library = library
        self._browsing = browsing
        self._shelf = shelf
        self.dragged: AssetFile | None = None  # what a payload from here stands for
        self.opened: AssetFile | None = None  # what was double-clicked in this frame

    def draw(self, ui: Ui) -> None:
        """Fills the rest of the window."""
        self.opened = None
        self._library.begin_frame()
        folders, files = self._browsing.shown(self._library.listing)
        size = ui.preferences.asset_size
        if imgui.begin_child("###tiles", (0.0, 0.0)):
            if not folders and not files:
                self._draw_nothing()
            elif size < LIST_BELOW:
                self._draw_lines(ui, folders, files)
            else:
                self._draw_grid(ui, folders, files, size * imgui.get_style().font_scale_dpi)
        imgui.end_child()
        if self._shelf.is_behind:
            ui.model.request_redraw(0.0)

    def _draw_nothing(self) -> None:
        if self._library.folder is None or not self._library.folder.is_known:
            dim_text(tr("Looking through the folder..."))
        elif self._browsing.search.strip():
            dim_text(tr("Nothing is called so"))
        else:
            dim_text(tr("No assets here: drop files on the window, or choose another folder"))

    def _draw_grid(self, ui: Ui, folders: list[str], files: list[AssetFile], edge: float) -> None:
        spacing = imgui.get_style().item_spacing
        columns = max(1, int((imgui.get_content_region_avail().x + spacing.x) / (edge + spacing.x)))
        height = edge + imgui.get_text_line_height_with_spacing()
        count = len(folders) + len(files)
        clipper = imgui.ListClipper()
        clipper.begin((count + columns - 1) // columns, height + spacing.y)
        while clipper.step():
            for row in range(clipper.display_start, clipper.display_end):
                for place in range(row * columns, min((row + 1) * columns, count)):
                    if place > row * columns:
                        imgui.same_line()
                    imgui.push_id(place)
                    self._draw_item(ui, folders, files, place, (edge, height))
                    imgui.pop_id()
        clipper.end()

    def _draw_lines(self, ui: Ui, folders: list[str], files: list[AssetFile]) -> None:
        height = imgui.get_text_line_height_with_spacing() * 1.3
        width = imgui.get_content_region_avail().x
        clipper = imgui.ListClipper()
        clipper.begin(len(folders) + len(files), height + imgui.get_style().item_spacing.y)
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                imgui.push_id(place)
                self._draw_item(ui, folders, files, place, (width, height))
                imgui.pop_id()
        clipper.end()

    def _draw_item(
        self, ui: Ui, folders: list[str], files: list[AssetFile], place: int, size: tuple[float, float]
    ) -> None:
        low = imgui.get_cursor_screen_pos()
        pressed = imgui.invisible_button("###item", size)
        is_hovered = imgui.is_item_hovered()
        is_doubled = is_hovered and imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
        if place < len(folders):
            folder = folders[place]
            name = folder.rpartition("/")[2]
            ui.landmarks.note(f"assets/{name}/")
            _draw_ground((low.x, low.y), size, is_hovered=is_hovered, is_selected=False)
            _draw_icon((low.x, low.y), size, icons.ICON_FA_FOLDER, ACCENT)
            _draw_name((low.x, low.y), size, name, TEXT)
            if is_doubled:
                self._browsing.enter(folder)
            return
        file = files[place - len(folders)]
        ui.landmarks.note(f"assets/{file.name}")
        if pressed:
            self._browsing.selected = file.path
        if is_doubled:
            self.opened = file
        self._drag(ui, file)
        content = self._library.content(file)
        _draw_ground((low.x, low.y), size, is_hovered=is_hovered, is_selected=self._browsing.selected == file.path)
        self._draw_picture((low.x, low.y), size, file, has_error=content is not None and bool(content.error))
        has_error = content is not None and bool(content.error)
        _draw_name((low.x, low.y), size, file.name, ERROR if has_error else TEXT)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip) and imgui.get_drag_drop_payload_py_id() is None:
            self._draw_tooltip(file)

    def _draw_picture(
        self, low: tuple[float, float], size: tuple[float, float], file: AssetFile, *, has_error: bool
    ) -> None:
        pixels = self._library.picture(file)
        name = self._shelf.name(file.version, pixels) if pixels is not None else 0
        if not name or pixels is None:
            icon = icons.ICON_FA_TRIANGLE_EXCLAMATION if has_error else ICONS[file.type]
            _draw_icon(low, size, icon, WARNING if has_error else TEXT_DIM)
            return
        edge = min(size)
        inset = edge * 0.06
        height, width, _ = pixels.shape
        scale = (edge - 2.0 * inset) / max(height, width)
        left = low[0] + (edge - width * scale) / 2.0
        top = low[1] + (edge - height * scale) / 2.0
        imgui.get_window_draw_list().add_image_rounded(
            imgui.ImTextureRef(name),
            (left, top),
            (left + width * scale, top + height * scale),
            (0.0, 0.0),
            (1.0, 1.0),
            imgui.color_convert_float4_to_u32((1.0, 1.0, 1.0, 1.0)),
            imgui.get_style().frame_rounding,
        )

    def _drag(self, ui: Ui, file: AssetFile) -> None:
        """Lets fields take it as soon as the host has what they would name; views take it at once."""
        content = self._library.content(file)
        held = content.dragged if content is not None else None
        if held is not None and imgui.is_item_activated():
            self._library.give(file)
        if held is not None and self._library.is_at_host(file):
            choices, kind = tuple(held[0].items()), held[1]
            if imgui.is_item_active():
                self.dragged = file
            is_one = len(choices) == 1
            reference = choices[0][1] if is_one else ""
            drag_asset(
                ui,
                DraggedAsset(reference=reference, choices=() if is_one else choices, kind=kind, name=file.name),
            )
        elif imgui.begin_drag_drop_source():
            self.dragged, ui.dragged_asset = file, None
            imgui.set_drag_drop_payload_py_id(FILE_PAYLOAD, 0)
            imgui.text_unformatted(file.name)
            imgui.end_drag_drop_source()

    def _draw_tooltip(self, file: AssetFile) -> None:
        content = self._library.content(file)
        if not imgui.begin_tooltip():
            return
        imgui.push_text_wrap_pos(imgui.get_font_size() * 26.0)
        imgui.text_unformatted(file.name)
        place = f" - {file.folder}" if file.folder and self._browsing.search.strip() else ""
        dim_text(f"{tr(_WORDS[file.type])}, {size_text(file.size)}{place}")
        if content is not None and content.error:
            colored_text(ERROR, content.error)
        elif content is not None and content.note:
            colored_text(WARNING, content.note)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def size_text(size: int) -> str:
    """A file's size as people say it."""
    if size < 1024:
        return f"{size} B"
    value, unit = size / 1024.0, "KiB"
    for larger in ("MiB", "GiB"):
        if value < 1024.0:
            break
        value, unit = value / 1024.0, larger
    return f"{value:.1f} {unit}" if value < 10.0 else f"{value:.0f} {unit}"


def _draw_ground(low: tuple[float, float], size: tuple[float, float], *, is_hovered: bool, is_selected: bool) -> None:
    draw_list = imgui.get_window_draw_list()
    high = (low[0] + size[0], low[1] + size[1])
    rounding = imgui.get_style().frame_rounding
    if is_selected:
        draw_list.add_rect_filled(low, high, color_code((*FILL[:3], 0.30)), rounding)
    elif is_hovered:
        draw_list.add_rect_filled(low, high, color_code(HEADER), rounding)
    elif size[0] <= size[1]:
        draw_list.add_rect_filled(low, (high[0], low[1] + size[0]), color_code(FIELD), rounding)


def _draw_icon(low: tuple[float, float], size: tuple[float, float], icon: str, color: Rgba) -> None:
    edge = min(size)
    font = imgui.get_font()
    height = edge * 0.42 if size[0] <= size[1] else imgui.get_font_size()
    imgui.push_font(font, height / imgui.get_style().font_scale_main / imgui.get_style().font_scale_dpi)
    extent = imgui.calc_text_size(icon)
    imgui.pop_font()
    place = (low[0] + (edge - extent.x) / 2.0, low[1] + (edge - extent.y) / 2.0)
    imgui.get_window_draw_list().add_text(font, height, place, color_code(color), icon)


def _draw_name(low: tuple[float, float], size: tuple[float, float], name: str, color: Rgba) -> None:
    """Below a tile, shortened to its width; beside the icon of a line."""
    draw_list = imgui.get_window_draw_list()
    if size[0] > size[1]:
        top = low[1] + (size[1] - imgui.get_text_line_height()) / 2.0
        draw_list.add_text((low[0] + size[1] * 1.25, top), color_code(color), name)
        return
    shown = name
    while len(shown) > 4 and imgui.calc_text_size(shown).x > size[0]:
        shown = f"{shown.rstrip('…')[:-2]}…"
    left = low[0] + max(0.0, (size[0] - imgui.calc_text_size(shown).x) / 2.0)
    draw_list.add_text((left, low[1] + size[0] + 2.0), color_code(color), shown)
