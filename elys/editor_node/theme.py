"""How the editor looks: colours, spacing and fonts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import imgui_bundle
from imgui_bundle import imgui
from imgui_bundle.immapp import icons_fontawesome_6 as icons  # noqa: F401  all panels take it from here

Rgb = tuple[float, float, float]
Rgba = tuple[float, float, float, float]


def _rgb(code: int) -> Rgb:
    return ((code >> 16 & 255) / 255, (code >> 8 & 255) / 255, (code & 255) / 255)


def _rgba(code: int, alpha: float = 1.0) -> Rgba:
    return (*_rgb(code), alpha)


BACKGROUND: Final = _rgb(0x131417)
PANEL: Final = _rgba(0x1C1E22)
PANEL_LOW: Final = _rgba(0x17181C)
POPUP: Final = _rgba(0x212429, 0.99)
FIELD: Final = _rgba(0x101114)
FIELD_HOVERED: Final = _rgba(0x1A1C21)
BUTTON: Final = _rgba(0x2B2E35)
BUTTON_HOVERED: Final = _rgba(0x373B44)
LINE: Final = _rgba(0x0E0F11)
EDGE: Final = _rgba(0x34373E)
TEXT: Final = _rgba(0xD6D9DE)
TEXT_DIM: Final = _rgba(0x868C96)
ACCENT: Final = _rgba(0x4C8DFF)
GOOD: Final = _rgba(0x5BBF7A)
WARNING: Final = _rgba(0xE5B454)
ERROR: Final = _rgba(0xEF6B62)
AXIS_X: Final = _rgba(0xD9484F)
AXIS_Y: Final = _rgba(0x6BA539)
AXIS_Z: Final = _rgba(0x3F7FD9)
AXES: Final = (AXIS_X, AXIS_Y, AXIS_Z)

FONT_SIZE: Final = 15.0  # at 96 dpi


@dataclass(frozen=True, slots=True)
class Fonts:
    """The editor's faces; Font Awesome's icons are merged into `regular` and `bold`."""

    regular: imgui.ImFont
    bold: imgui.ImFont
    mono: imgui.ImFont


def load_fonts() -> Fonts:
    """Roboto, Roboto Bold and Inconsolata from imgui_bundle's assets."""
    directory = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
    regular = _add_font(directory / "Roboto" / "Roboto-Regular.ttf")
    _merge_icons(directory)
    bold = _add_font(directory / "Roboto" / "Roboto-Bold.ttf")
    _merge_icons(directory)
    mono = _add_font(directory / "Inconsolata-Medium.ttf")
    imgui.get_io().font_default = regular
    return Fonts(regular=regular, bold=bold, mono=mono)


def _add_font(path: Path, config: imgui.ImFontConfig | None = None, size: float = FONT_SIZE) -> imgui.ImFont:
    return imgui.get_io().fonts.add_font_from_file_ttf(str(path), size, config)


def _merge_icons(directory: Path) -> None:
    config = imgui.ImFontConfig()
    config.merge_mode = True
    config.glyph_min_advance_x = FONT_SIZE
    config.glyph_offset = imgui.ImVec2(0.0, 1.0)
    config.pixel_snap_h = True
    _add_font(directory / "Font_Awesome_6_Free-Solid-900.otf", config, FONT_SIZE * 0.86)


def apply_theme(scale: float) -> None:
    """Sets colours and spacing of the current context, enlarged for the display by `scale`."""
    style = imgui.get_style()
    _apply_spacing(style)
    style.scale_all_sizes(scale)
    style.font_scale_dpi = scale
    for name, color in _COLORS.items():
        style.set_color_(getattr(imgui.Col_, name), imgui.ImVec4(*color))


def _apply_spacing(style: imgui.Style) -> None:
    style.window_padding = imgui.ImVec2(10, 8)
    style.frame_padding = imgui.ImVec2(8, 4)
    style.item_spacing = imgui.ImVec2(8, 5)
    style.item_inner_spacing = imgui.ImVec2(6, 4)
    style.cell_padding = imgui.ImVec2(6, 3)
    style.indent_spacing = 16
    style.scrollbar_size = 12
    style.grab_min_size = 10
    style.window_rounding = 6
    style.child_rounding = 4
    style.frame_rounding = 4
    style.popup_rounding = 6
    style.scrollbar_rounding = 6
    style.grab_rounding = 3
    style.tab_rounding = 4
    style.window_border_size = 1
    style.child_border_size = 0
    style.popup_border_size = 1
    style.frame_border_size = 0
    style.tab_bar_overline_size = 2
    style.docking_separator_size = 2
    style.separator_text_border_size = 1
    style.window_menu_button_position = imgui.Dir.none
    style.window_title_align = imgui.ImVec2(0.0, 0.5)
    style.hover_delay_short = 0.25


_CLEAR: Final = (0.0, 0.0, 0.0, 0.0)
_COLORS: Final[dict[str, Rgba]] = {
    "text": TEXT,
    "text_disabled": TEXT_DIM,
    "text_selected_bg": (*ACCENT[:3], 0.40),
    "text_link": ACCENT,
    "input_text_cursor": ACCENT,
    "window_bg": PANEL,
    "child_bg": _CLEAR,
    "popup_bg": POPUP,
    "border": EDGE,
    "border_shadow": _CLEAR,
    "frame_bg": FIELD,
    "frame_bg_hovered": FIELD_HOVERED,
    "frame_bg_active": _rgba(0x22252B),
    "title_bg": PANEL_LOW,
    "title_bg_active": PANEL_LOW,
    "title_bg_collapsed": PANEL_LOW,
    "menu_bar_bg": PANEL_LOW,
    "scrollbar_bg": _CLEAR,
    "scrollbar_grab": _rgba(0x3A3E46),
    "scrollbar_grab_hovered": _rgba(0x4A4F59),
    "scrollbar_grab_active": _rgba(0x5A606B),
    "check_mark": ACCENT,
    "slider_grab": _rgba(0x4A4F59),
    "slider_grab_active": ACCENT,
    "button": BUTTON,
    "button_hovered": BUTTON_HOVERED,
    "button_active": (*ACCENT[:3], 0.75),
    "header": (*ACCENT[:3], 0.28),
    "header_hovered": _rgba(0xFFFFFF, 0.06),
    "header_active": (*ACCENT[:3], 0.40),
    "separator": LINE,
    "separator_hovered": (*ACCENT[:3], 0.6),
    "separator_active": ACCENT,
    "resize_grip": _CLEAR,
    "resize_grip_hovered": (*ACCENT[:3], 0.5),
    "resize_grip_active": ACCENT,
    "tab": PANEL_LOW,
    "tab_hovered": BUTTON_HOVERED,
    "tab_selected": PANEL,
    "tab_selected_overline": ACCENT,
    "tab_dimmed": PANEL_LOW,
    "tab_dimmed_selected": PANEL,
    "tab_dimmed_selected_overline": EDGE,
    "docking_preview": (*ACCENT[:3], 0.35),
    "docking_empty_bg": _rgba(0x131417),
    "plot_lines": ACCENT,
    "plot_histogram": ACCENT,
    "table_header_bg": PANEL_LOW,
    "table_border_strong": LINE,
    "table_border_light": LINE,
    "table_row_bg": _CLEAR,
    "table_row_bg_alt": _rgba(0xFFFFFF, 0.015),
    "tree_lines": EDGE,
    "drag_drop_target": ACCENT,
    "nav_cursor": (*ACCENT[:3], 0.7),
    "modal_window_dim_bg": _rgba(0x000000, 0.5),
}
