"""The profiler: what ticks, pictures and the editor's own frames cost, stage by stage; now, over time, and at their worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from imgui_bundle import imgui, implot
from numpy.typing import NDArray

from elys.editor_node.frame_profiles import REST, Figures, ProfileTrack, Sample, flame
from elys.editor_node.instruments import EDITOR, SIMULATION, Instruments
from elys.editor_node.language import tr, tr_title
from elys.editor_node.panels.plot_style import line_spec, plot_colors, shaded_spec
from elys.editor_node.theme import BACKGROUND, ERROR, FIELD, SERIES, TEXT, TEXT_DIM, Rgba, icons
from elys.editor_node.ui import Ui, centered_text, color_code, colored_text, dim_text, icon_button

TITLE: Final = f"{icons.ICON_FA_GAUGE_HIGH}  Profiler###Profiler"
_CURVE_INTERVAL: Final = 0.2  # [s] between two looks at all samples
_STAGE_TEXT_MARGIN: Final = 8.0  # [points] a name must have beside it to stand on its bar
_LIST_WIDTH: Final = 22.0  # [letters] of the list of stages


class _Curves(NamedTuple):
    """What is drawn of a track, made a few times a second: nobody reads figures that change faster."""

    made_at: float  # [s] by ImGui's clock
    track: ProfileTrack
    figures: Figures
    names: list[str]
    numbers: NDArray[np.float64]  # (N,)
    rows: NDArray[np.float64]  # (S + 1, N) [ms]


class ProfilerPanel:
    """Shows one track at a time: the simulation, a view of a render node, or the editor itself."""

    def __init__(self, instruments: Instruments) -> None:
        self._instruments = instruments
        self.shown = SIMULATION
        self._curves: _Curves | None = None

    @property
    def track(self) -> ProfileTrack | None:
        """The one that is shown; None before anything of it was measured."""
        return self._instruments.tracks.get(self.shown)

    def hold_worst(self) -> None:
        """Holds the dearest tick or frame of the last minute."""
        if self.track is not None:
            self.track.hold(self.track.worst)

    def release(self) -> None:
        """Shows the newest again."""
        if self.track is not None:
            self.track.hold(None)

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            ui.watches.keep("ticks", self._instruments.watch_ticks)
            ui.watches.keep("views", self._instruments.watch_views)
            ui.watches.keep("editor frames", lambda: lambda: None)
            self._draw_choice(ui)
            track = self.track
            if track is None or track.chosen is None:
                imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
                centered_text(tr("No tick was measured yet"), imgui.get_content_region_avail().x)
            else:
                self._draw_track(ui, track, track.chosen)
        imgui.end()

    def _draw_choice(self, ui: Ui) -> None:
        names = list(dict.fromkeys((SIMULATION, *sorted(self._instruments.tracks), EDITOR)))
        imgui.set_next_item_width(imgui.get_font_size() * 11.0)
        if imgui.begin_combo("###track", track_label(self.shown)):
            for name in names:
                if imgui.selectable(f"{track_label(name)}###{name}", name == self.shown)[0]:
                    self.shown = name
                ui.landmarks.note(f"profiler/track/{name}")
            imgui.end_combo()
        else:
            ui.landmarks.note("profiler/track")
        track = self.track
        if track is None:
            return
        imgui.same_line()
        has_worst = track.worst is not None
        if icon_button(icons.ICON_FA_FIRE, "worst", tr("Hold the worst of the last minute"), enabled=has_worst):
            self.hold_worst()
        ui.landmarks.note("profiler/worst")
        imgui.same_line(0.0, 2.0)
        is_held = track.held is not None
        tooltip = tr("Show the newest again") if is_held else tr("Hold this one")
        if icon_button(icons.ICON_FA_THUMBTACK, "hold", tooltip, active=is_held):
            track.hold(None if is_held else track.chosen)
        ui.landmarks.note("profiler/hold")
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        dim_text(_summary(self._curves_of(track).figures, track.budget))

    def _curves_of(self, track: ProfileTrack) -> _Curves:
        now, made = imgui.get_time(), self._curves
        if made is None or made.track is not track or now > made.made_at + _CURVE_INTERVAL:
            figures, names, samples = track.figures(), track.stage_names(), track.drawn()
            assert figures is not None  # a track is made for its first sample
            numbers = np.array([sample.number for sample in samples], np.float64)
            made = self._curves = _Curves(now, track, figures, names, numbers, track.stacked(names, samples))
        return made

    # --- one track -------------------------------------------------------------------------------------------------

    def _draw_track(self, ui: Ui, track: ProfileTrack, chosen: Sample) -> None:
        curves = self._curves_of(track)
        colors = stage_colors(curves.names)
        self._draw_chosen(track, chosen)
        draw_flame(ui, chosen, colors, budget=track.budget)
        width = imgui.get_content_region_avail().x - imgui.get_font_size() * _LIST_WIDTH
        self._draw_curves(ui, curves, colors, max(width, imgui.get_font_size() * 8.0))
        imgui.same_line()
        if imgui.begin_child("###stages"):
            _draw_stages(chosen, colors)
        imgui.end_child()

    def _draw_chosen(self, track: ProfileTrack, chosen: Sample) -> None:
        which = tr("held") if track.held is not None else tr("newest")
        counts = "     ".join(f"{value} {tr(name)}" for name, value in chosen.counts.items())
        late = "     " + tr("{late} ms late", late=f"{chosen.late:.2f}") if chosen.late > 0.01 else ""
        text = tr("{which}: {number}, {total} ms", which=which, number=chosen.number, total=f"{chosen.total:.3f}")
        is_over = bool(track.budget) and chosen.total > track.budget
        colored_text(ERROR if is_over else TEXT, text)
        imgui.same_line(0.0, 20.0)
        dim_text(f"{counts}{late}")

    def _draw_curves(self, ui: Ui, curves: _Curves, colors: Mapping[str, Rgba], width: float) -> None:
        track, names, numbers, rows = curves.track, curves.names, curves.numbers, curves.rows
        flags = implot.Flags_.no_legend | implot.Flags_.no_mouse_text | implot.Flags_.no_menus | implot.Flags_.no_title
        with plot_colors():
            if not implot.begin_plot("###curves", (width, -1.0), int(flags)):
                return
            quiet = implot.AxisFlags_.no_label | implot.AxisFlags_.no_highlight
            implot.setup_axes("", "", int(quiet | implot.AxisFlags_.auto_fit), int(quiet | implot.AxisFlags_.lock_min))
            top = max(float(rows[-1].max()), track.budget) * 1.1 or 1.0
            implot.setup_axis_limits(implot.ImAxis_.y1.value, 0.0, top, implot.Cond_.always.value)
            implot.setup_axis_format(implot.ImAxis_.y1.value, "%g ms")
            for place, name in enumerate(names):
                implot.plot_shaded(f"###{name}", numbers, rows[place], rows[place + 1], shaded_spec(colors[name]))
            if track.budget:
                implot.plot_inf_lines("###budget", np.array([track.budget]), line_spec(ERROR, horizontal=True))
            marks = [sample.number for sample in (track.worst, track.held) if sample is not None]
            if marks:
                implot.plot_inf_lines("###marks", np.array(marks, np.float64), line_spec(TEXT_DIM))
            if implot.is_plot_hovered():
                self._point_at(track, implot.get_plot_mouse_pos().x)
            implot.end_plot()
        ui.landmarks.note("profiler/curves")

    def _point_at(self, track: ProfileTrack, number: float) -> None:
        near = track.nearest(number)
        if near is None:
            return
        imgui.set_tooltip(tr("{number}: {total} ms. Click: hold it", number=near.number, total=f"{near.total:.3f}"))
        if imgui.is_mouse_clicked(0):
            track.hold(near)


def track_label(name: str) -> str:
    """What a track is called."""
    kind, _, which = name.partition(" ")
    return f"{tr(kind)} {which}" if which else tr(kind)


def stage_colors(names: Sequence[str]) -> dict[str, Rgba]:
    """A colour for each stage, in turns; what no stage accounts for is quiet."""
    return {name: TEXT_DIM if name == REST else SERIES[place % len(SERIES)] for place, name in enumerate(names)}


def stage_label(name: str) -> str:
    """A stage as a person reads it."""
    return tr(name) if name == REST else name.replace("_", " ")


def draw_flame(ui: Ui, sample: Sample, colors: Mapping[str, Rgba], *, budget: float) -> None:
    """The stages of one tick or frame side by side in their order, parts below what they are parts of, and the budget's line."""
    bars = flame(sample)
    low, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    height = imgui.get_text_line_height() + 4.0
    depth = max((bar.depth for bar in bars), default=0)
    imgui.invisible_button("###flame", (width, height * (depth + 1)))
    ui.landmarks.note("profiler/flame")
    draw_list, scale = imgui.get_window_draw_list(), width / max(sample.total, budget, 1e-6)
    draw_list.add_rect_filled((low.x, low.y), (low.x + width, low.y + height * (depth + 1)), color_code(FIELD), 3.0)
    mouse, hovered = imgui.get_mouse_pos(), imgui.is_item_hovered()
    for bar in bars:
        left, top = low.x + bar.start * scale, low.y + bar.depth * height
        right, bottom = left + max(bar.length * scale, 1.0), top + height
        color = colors.get(bar.name, TEXT_DIM)
        draw_list.add_rect_filled((left, top), (max(right - 1.0, left + 1.0), bottom - 1.0), color_code(color))
        text = stage_label(bar.name.rpartition(".")[2])
        if imgui.calc_text_size(text).x + _STAGE_TEXT_MARGIN < right - left:
            draw_list.add_text((left + 4.0, top + 1.0), color_code(BACKGROUND), text)
        if hovered and left <= mouse.x < right and top <= mouse.y < bottom:
            imgui.set_tooltip(f"{stage_label(bar.name)}  {bar.length:.3f} ms")
    if budget:
        x = low.x + budget * scale - 1.0
        draw_list.add_line((x, low.y), (x, low.y + height * (depth + 1)), color_code(ERROR), 2.0)


def _draw_stages(sample: Sample, colors: Mapping[str, Rgba]) -> None:
    """The own time of every stage, the dearest first."""
    for name, cost in sorted(sample.own.items(), key=lambda item: -item[1]):
        at, size = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        imgui.get_window_draw_list().add_rect_filled(
            (at.x, at.y + 3.0), (at.x + size - 6.0, at.y + size - 3.0), color_code(colors.get(name, TEXT_DIM)), 2.0
        )
        imgui.dummy((size, size))
        imgui.same_line(0.0, 2.0)
        dim_text(f"{cost:8.3f} ms  {stage_label(name)}")


def _summary(figures: Figures, budget: float) -> str:
    text = tr(
        "mean {mean} ms     median {median}     p99 {p99}     worst {longest}",
        mean=f"{figures.mean:.2f}",
        median=f"{figures.median:.2f}",
        p99=f"{figures.p99:.2f}",
        longest=f"{figures.longest:.2f}",
    )
    if not budget:
        return text
    over = tr("{count} of {all} over {budget} ms", count=figures.over_budget, all=figures.sample_count,
              budget=f"{budget:.2f}")  # fmt: skip
    return f"{text}     {over}"
