"""How the editor looks: colours, spacing and fonts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, overload

import imgui_bundle
from imgui_bundle import imgui
from imgui_bundle.immapp import icons_fontawesome_6 as icons  # noqa: F401  all panels take it from here

from elys.editor_node.preferences import Theme

Rgba = Sequence[float]  # red, green, blue, alpha in 0 to 1


class Shade(Sequence[float]):
    """A colour by its name, as the theme in use has it: panels keep theirs, and a change of theme shows in the next frame."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name

    def __len__(self) -> int:
        return 4

    @overload
    def __getitem__(self, place: int) -> float: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[float, float, float]: ...  # [:3], all there is need of
    def __getitem__(self, place: int | slice) -> float | tuple[float, ...]:
        return _used[self.name][place]

    def __repr__(self) -> str:
        return f"Shade({self.name!r})"


def _rgba(code: int, alpha: float = 1.0) -> tuple[float, float, float, float]:
    return (code >> 16 & 255) / 255, (code >> 8 & 255) / 255, (code & 255) / 255, alpha


def _faint(shade: Shade, alpha: float) -> tuple[float, ...]:
    return (*shade[:3], alpha)


# What is read stands out by 4.5 to 1 from all that it is read on (WCAG 2.1, 1.4.3); `contrast` measures it.
THEMES: Final[dict[Theme, dict[str, tuple[float, float, float, float]]]] = {
    "dark": {
        "background": _rgba(0x131417),
        "panel": _rgba(0x1C1E22),
        "panel_low": _rgba(0x17181C),
        "popup": _rgba(0x212429, 0.99),
        "field": _rgba(0x101114),
        "field_hovered": _rgba(0x1A1C21),
        "field_active": _rgba(0x22252B),
        "button": _rgba(0x2B2E35),
        "button_hovered": _rgba(0x373B44),
        "line": _rgba(0x0E0F11),
        "edge": _rgba(0x34373E),
        "grab": _rgba(0x3A3E46),
        "grab_hovered": _rgba(0x4A4F59),
        "grab_active": _rgba(0x5A606B),
        "hover": _rgba(0xFFFFFF, 0.06),
        "stripe": _rgba(0xFFFFFF, 0.015),
        "header": _rgba(0xFFFFFF, 0.045),
        "notice": _rgba(0x121316, 0.92),
        "dim_screen": _rgba(0x000000, 0.5),
        "text": _rgba(0xD6D9DE),
        "text_dim": _rgba(0xA3A9B3),
        "accent": _rgba(0x7FB0FF),
        "fill": _rgba(0x4C8DFF),
        "good": _rgba(0x5BBF7A),
        "warning": _rgba(0xE5B454),
        "error": _rgba(0xF58C85),
        "axis_x": _rgba(0xE5656B),
        "axis_y": _rgba(0x78B545),
        "axis_z": _rgba(0x6A9EEA),
        "on_axis": _rgba(0x0D0D0F),
        "series_1": _rgba(0xE6B354),
        "series_2": _rgba(0x9A80E0),
        "series_3": _rgba(0x4DB3B3),
        "series_4": _rgba(0xD980B3),
        "series_5": _rgba(0x9CA3AD),
    },
    "light": {
        "background": _rgba(0xC9CED6),
        "panel": _rgba(0xF4F5F7),
        "panel_low": _rgba(0xE6E8EC),
        "popup": _rgba(0xFFFFFF, 0.99),
        "field": _rgba(0xFFFFFF),
        "field_hovered": _rgba(0xF0F2F5),
        "field_active": _rgba(0xE4E8EE),
        "button": _rgba(0xDDE1E7),
        "button_hovered": _rgba(0xCFD5DD),
        "line": _rgba(0xC3C8D0),
        "edge": _rgba(0xB4BAC4),
        "grab": _rgba(0xB4BAC4),
        "grab_hovered": _rgba(0x9AA1AD),
        "grab_active": _rgba(0x7F8794),
        "hover": _rgba(0x000000, 0.06),
        "stripe": _rgba(0x000000, 0.025),
        "header": _rgba(0x000000, 0.05),
        "notice": _rgba(0xFBFBFC, 0.94),
        "dim_screen": _rgba(0x30343A, 0.45),
        "text": _rgba(0x1B1E24),
        "text_dim": _rgba(0x4A515C),
        "accent": _rgba(0x0B4FC4),
        "fill": _rgba(0x3B7DF0),
        "good": _rgba(0x13602F),
        "warning": _rgba(0x6F4700),
        "error": _rgba(0xA31515),
        "axis_x": _rgba(0xC22A32),
        "axis_y": _rgba(0x33700C),
        "axis_z": _rgba(0x1F5FC0),
        "on_axis": _rgba(0xFFFFFF),
        "series_1": _rgba(0x8A5A00),
        "series_2": _rgba(0x5B3FB0),
        "series_3": _rgba(0x0B6B6B),
        "series_4": _rgba(0x9A2F70),
        "series_5": _rgba(0x5A626E),
    },
}
_used: dict[str, tuple[float, float, float, float]] = THEMES["dark"]

BACKGROUND: Final = Shade("background")
PANEL: Final = Shade("panel")
PANEL_LOW: Final = Shade("panel_low")
POPUP: Final = Shade("popup")
FIELD: Final = Shade("field")
FIELD_HOVERED: Final = Shade("field_hovered")
BUTTON: Final = Shade("button")
BUTTON_HOVERED: Final = Shade("button_hovered")
LINE: Final = Shade("line")
EDGE: Final = Shade("edge")
HEADER: Final = Shade("header")  # behind the title of a group within a panel
NOTICE: Final = Shade("notice")  # behind text that stands on a picture
DIM_SCREEN: Final = Shade("dim_screen")  # over everything that a question covers
TEXT: Final = Shade("text")
TEXT_DIM: Final = Shade("text_dim")
ACCENT: Final = Shade("accent")
FILL: Final = Shade("fill")  # of what is selected or under way; never of a text
GOOD: Final = Shade("good")
WARNING: Final = Shade("warning")
ERROR: Final = Shade("error")
AXIS_X: Final = Shade("axis_x")
AXIS_Y: Final = Shade("axis_y")
AXIS_Z: Final = Shade("axis_z")
AXES: Final = (AXIS_X, AXIS_Y, AXIS_Z)
ON_AXIS: Final = Shade("on_axis")  # a letter on one of them
SERIES: Final = (AXIS_Z, AXIS_Y, Shade("series_1"), AXIS_X, *(Shade(f"series_{number}") for number in range(2, 6)))

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


def apply_theme(scale: float, *, theme: Theme = "dark", font_scale: float = 1.0) -> None:
    """Sets colours and spacing of the current context: enlarged for the display by `scale`, its text by `font_scale` as well."""
    global _used
    _used = THEMES[theme]
    style = imgui.get_style()
    _restore_sizes(style)
    _apply_spacing(style)
    style.scale_all_sizes(
        scale * max(1.0, font_scale**0.5)
    )  # larger text wants more room around it, but not as much more
    style.font_scale_dpi = scale
    style.font_scale_main = font_scale
    for name, color in _colors().items():
        style.set_color_(getattr(imgui.Col_, name), imgui.ImVec4(*color))


def contrast(text: Rgba, ground: Rgba) -> float:
    """How far two opaque colours stand apart, 1 to 21: the ratio of relative luminances of WCAG 2.1."""
    low, high = sorted((_luminance(text), _luminance(ground)))
    return (high + 0.05) / (low + 0.05)


def _luminance(color: Rgba) -> float:
    red, green, blue = ((c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4) for c in color[:3])
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def _restore_sizes(style: imgui.Style) -> None:
    """All sizes as ImGui has them at first: `scale_all_sizes` multiplies what it finds, and rounds it."""
    fresh = imgui.Style()
    for name in dir(fresh):
        value = getattr(fresh, name)
        if not name.startswith(("_", "font_")) and isinstance(value, (float, imgui.ImVec2)):
            setattr(style, name, value)


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


def _colors() -> dict[str, Rgba]:
    return {
        "text": TEXT,
        "text_disabled": TEXT_DIM,
        "text_selected_bg": _faint(FILL, 0.40),
        "text_link": ACCENT,
        "input_text_cursor": ACCENT,
        "window_bg": PANEL,
        "child_bg": _CLEAR,
        "popup_bg": POPUP,
        "border": EDGE,
        "border_shadow": _CLEAR,
        "frame_bg": FIELD,
        "frame_bg_hovered": FIELD_HOVERED,
        "frame_bg_active": Shade("field_active"),
        "title_bg": PANEL_LOW,
        "title_bg_active": PANEL_LOW,
        "title_bg_collapsed": PANEL_LOW,
        "menu_bar_bg": PANEL_LOW,
        "scrollbar_bg": _CLEAR,
        "scrollbar_grab": Shade("grab"),
        "scrollbar_grab_hovered": Shade("grab_hovered"),
        "scrollbar_grab_active": Shade("grab_active"),
        "check_mark": ACCENT,
        "slider_grab": Shade("grab_hovered"),
        "slider_grab_active": ACCENT,
        "button": BUTTON,
        "button_hovered": BUTTON_HOVERED,
        "button_active": _faint(FILL, 0.75),
        "header": _faint(FILL, 0.28),
        "header_hovered": Shade("hover"),
        "header_active": _faint(FILL, 0.40),
        "separator": LINE,
        "separator_hovered": _faint(FILL, 0.6),
        "separator_active": ACCENT,
        "resize_grip": _CLEAR,
        "resize_grip_hovered": _faint(FILL, 0.5),
        "resize_grip_active": ACCENT,
        "tab": PANEL_LOW,
        "tab_hovered": BUTTON_HOVERED,
        "tab_selected": PANEL,
        "tab_selected_overline": ACCENT,
        "tab_dimmed": PANEL_LOW,
        "tab_dimmed_selected": PANEL,
        "tab_dimmed_selected_overline": EDGE,
        "docking_preview": _faint(FILL, 0.35),
        "docking_empty_bg": BACKGROUND,
        "plot_lines": ACCENT,
        "plot_histogram": ACCENT,
        "table_header_bg": PANEL_LOW,
        "table_border_strong": LINE,
        "table_border_light": LINE,
        "table_row_bg": _CLEAR,
        "table_row_bg_alt": Shade("stripe"),
        "tree_lines": EDGE,
        "drag_drop_target": ACCENT,
        "nav_cursor": _faint(FILL, 0.7),
        "modal_window_dim_bg": DIM_SCREEN,
    }
