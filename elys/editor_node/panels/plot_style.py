"""How plots look: in the colours of the theme."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from imgui_bundle import imgui, implot

from elys.editor_node.theme import EDGE, FIELD, PANEL, TEXT, TEXT_DIM, Rgba

_COLORS: Final[dict[implot.Col_, Rgba]] = {
    implot.Col_.frame_bg: PANEL,
    implot.Col_.plot_bg: FIELD,
    implot.Col_.plot_border: EDGE,
    implot.Col_.axis_grid: EDGE,
    implot.Col_.axis_tick: EDGE,
    implot.Col_.axis_text: TEXT_DIM,
    implot.Col_.legend_bg: PANEL,
    implot.Col_.legend_border: EDGE,
    implot.Col_.legend_text: TEXT,
    implot.Col_.inlay_text: TEXT,
    implot.Col_.crosshairs: TEXT_DIM,
}


@contextmanager
def plot_colors() -> Iterator[None]:
    """Plots within it have the theme's colours, and little around them."""
    for place, color in _COLORS.items():
        implot.push_style_color(place.value, imgui.ImVec4(*color))
    implot.push_style_var(implot.StyleVar_.plot_padding.value, imgui.ImVec2(6.0, 6.0))
    implot.push_style_var(implot.StyleVar_.label_padding.value, imgui.ImVec2(4.0, 3.0))
    implot.push_style_var(implot.StyleVar_.plot_min_size.value, imgui.ImVec2(60.0, 30.0))  # panels may be low
    try:
        yield
    finally:
        implot.pop_style_var(3)
        implot.pop_style_color(len(_COLORS))


def line_spec(color: Rgba, *, weight: float = 1.5, horizontal: bool = False) -> implot.Spec:
    """A line of a plot."""
    spec = implot.Spec()
    spec.line_color = imgui.ImVec4(*color)
    spec.line_weight = weight
    if horizontal:
        spec.flags = implot.InfLinesFlags_.horizontal.value
    return spec


def shaded_spec(color: Rgba) -> implot.Spec:
    """What is filled between two lines."""
    spec = implot.Spec()
    spec.fill_color = imgui.ImVec4(*color)
    spec.fill_alpha = 0.85
    spec.line_color = imgui.ImVec4(*color)
    return spec
