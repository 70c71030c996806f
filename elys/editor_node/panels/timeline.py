"""The timeline: scrub, step, loop, bookmarks and markers, in a recording or in what a simulation's flight recorder keeps."""

from __future__ import annotations

from typing import Final, get_args

from imgui_bundle import imgui

from elys.bus.messages.session import SessionStatus
from elys.bus.messages.timeline import Marker, MarkerKind
from elys.editor_node.language import tr, tr_label
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ACCENT, ERROR, FIELD, GOOD, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.timeline import Cluster, Timeline, round_times
from elys.editor_node.ui import Ui, action_item, centered_text, color_code, dim_text, icon_button

TITLE: Final = f"{icons.ICON_FA_FILM}  Timeline###Timeline"
_LABEL_DISTANCE: Final = 90.0  # [pixels] least distance between two labels
_REACH: Final = 4.0  # [pixels] around a mark within which the pointer is on it
_MARK_HEIGHTS: Final = (4.0, 20.0)  # [pixels] of the weakest collision, and of the hardest and all else
_TOLD: Final = 6  # markers of one mark that its tooltip names
_RATES: Final = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
_COLORS: Final[dict[MarkerKind, Rgba]] = {
    "collision": WARNING,
    "trigger": ACCENT,
    "error": ERROR,
    "edit": GOOD,
    "event": TEXT_DIM,
}
_KINDS: Final[dict[MarkerKind, str]] = {
    "collision": "Collisions",
    "trigger": "Triggers",
    "error": "Errors",
    "edit": "Edits",
    "event": "Events",
}


class TimelinePanel:
    """While the person scrubs the mark follows the pointer; let go, it shows the host's word again."""

    def __init__(self) -> None:
        self._scrubbed: float | None = None  # [s] where the pointer holds the mark
        self._is_panning = False

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE)[0]:
            status, line = ui.model.status, ui.model.timeline
            if ui.attachments.forked_from:
                self._draw_fork(ui)
            if status is None or not (line.can_wind or status.kind == "replay"):
                imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
                centered_text(
                    tr("Nothing is kept to go back to yet. What happens from now on can be looked at again here."),
                    imgui.get_content_region_avail().x,
                )
            else:
                line.ask_for_markers()
                self._draw_buttons(ui, status)
                self._draw_choices(ui)
                self._draw_bar(ui, status)
        imgui.end()

    def _draw_fork(self, ui: Ui) -> None:
        """Of a fork, where it comes from."""
        imgui.align_text_to_frame_padding()
        dim_text(tr("A fork of a recording"))
        imgui.same_line()
        if imgui.button(tr_label("Back to the recording", "back")):
            ui.actions.run("time.back_to_recording")
        ui.landmarks.note("timeline/back")

    # --- buttons ---------------------------------------------------------------------------------------------------

    def _draw_buttons(self, ui: Ui, status: SessionStatus) -> None:
        line = ui.model.timeline
        _button(ui, icons.ICON_FA_BACKWARD_FAST, "time.start")
        _button(ui, icons.ICON_FA_BACKWARD_STEP, "time.step_back")
        _button(ui, icons.ICON_FA_PAUSE if status.playing else icons.ICON_FA_PLAY, "time.play")
        _button(ui, icons.ICON_FA_FORWARD_STEP, "time.step")
        _button(ui, icons.ICON_FA_FORWARD_FAST, "time.end")
        imgui.same_line(0.0, 10.0)
        self._draw_rate(ui, status)
        imgui.same_line(0.0, 10.0)
        _button(ui, icons.ICON_FA_CHEVRON_LEFT, "time.previous_marker")
        _button(ui, icons.ICON_FA_CHEVRON_RIGHT, "time.next_marker")
        imgui.same_line(0.0, 10.0)
        imgui.align_text_to_frame_padding()
        shown = self._scrubbed if self._scrubbed is not None else status.simulation_time
        imgui.text_unformatted(tr("{time} s of {end} s", time=f"{shown:.2f}", end=f"{status.end_time:.2f}"))
        if ui.model.is_replay:
            imgui.same_line(0.0, 10.0)
            _button(ui, icons.ICON_FA_CODE_FORK, "time.fork")
            imgui.new_line()
        if line.is_rewound:
            imgui.same_line(0.0, 10.0)
            if imgui.button(tr_label("Return to now", "now")):
                line.go_to_end()
            ui.landmarks.note("timeline/now")
            imgui.same_line(0.0, 4.0)
            if imgui.button(tr_label("Go on from here", "resume")):
                line.go_on_from_here()
            imgui.set_item_tooltip(tr("Another future begins here: what was kept of later is forgotten"))
            ui.landmarks.note("timeline/resume")

    def _draw_rate(self, ui: Ui, status: SessionStatus) -> None:
        imgui.set_next_item_width(imgui.get_frame_height() * 3.0)
        if imgui.begin_combo("###rate", f"{status.rate:g}x" if status.rate else tr("max")):
            for offer in _RATES:
                if imgui.selectable(f"{offer:g}x", offer == status.rate)[0]:
                    ui.model.set_rate(offer)
                ui.landmarks.note(f"timeline/rate/{offer:g}")
            imgui.end_combo()
        else:
            ui.landmarks.note("timeline/rate")
        imgui.set_item_tooltip(tr("Simulated seconds in a second"))
        imgui.same_line(0.0, 2.0)

    def _draw_choices(self, ui: Ui) -> None:
        line = ui.model.timeline
        if icon_button(icons.ICON_FA_REPEAT, "loop", tr("Loop"), active=line.loops):
            line.toggle_loop()
        ui.landmarks.note("timeline/loop")
        imgui.same_line(0.0, 2.0)
        _button(ui, icons.ICON_FA_RIGHT_FROM_BRACKET, "time.loop_start")
        _button(ui, icons.ICON_FA_RIGHT_TO_BRACKET, "time.loop_end")
        _button(ui, icons.ICON_FA_XMARK, "time.forget_loop")
        imgui.same_line(0.0, 10.0)
        _button(ui, icons.ICON_FA_BOOKMARK, "time.bookmark")
        if imgui.button(f"{tr('Bookmarks')} ({len(line.bookmarks.all)})###bookmarks"):
            imgui.open_popup("###bookmark list")
        ui.landmarks.note("timeline/bookmarks")
        self._draw_bookmarks(ui, line)
        imgui.same_line(0.0, 4.0)
        if imgui.button(f"{tr('Markers')} ({len(line.markers)})###markers"):
            imgui.open_popup("###marker choice")
        ui.landmarks.note("timeline/markers")
        self._draw_kinds(ui, line)
        if line.is_zoomed:
            imgui.same_line(0.0, 4.0)
            if imgui.button(tr_label("Show all", "all")):
                line.show_all()
            ui.landmarks.note("timeline/all")

    def _draw_bookmarks(self, ui: Ui, line: Timeline) -> None:
        if not imgui.begin_popup("###bookmark list"):
            return
        for number, bookmark in enumerate(line.bookmarks.all):
            imgui.push_id(number)
            if imgui.button(f"{bookmark.time:.2f} s###go"):
                line.go_to(bookmark.time)
            ui.landmarks.note(f"timeline/bookmark/{number}")
            imgui.same_line()
            imgui.set_next_item_width(imgui.get_frame_height() * 8.0)
            entered, name = imgui.input_text("###name", bookmark.name, imgui.InputTextFlags_.enter_returns_true.value)
            ui.landmarks.note(f"timeline/bookmark/{number}/name")
            imgui.same_line()
            is_gone = icon_button(icons.ICON_FA_TRASH, "remove", tr("Forget this bookmark"))
            ui.landmarks.note(f"timeline/bookmark/{number}/remove")
            imgui.pop_id()
            if is_gone:
                line.bookmarks.remove(bookmark)
            elif entered:
                line.bookmarks.rename(bookmark, name)
        if not line.bookmarks.all:
            dim_text(tr("None yet"))
        action_item(ui, "time.bookmark")
        imgui.end_popup()

    def _draw_kinds(self, ui: Ui, line: Timeline) -> None:
        if not imgui.begin_popup("###marker choice"):
            return
        for kind in get_args(MarkerKind):
            imgui.push_style_color(imgui.Col_.check_mark, imgui.ImVec4(*_COLORS[kind]))
            changed, is_shown = imgui.checkbox(tr_label(_KINDS[kind]), kind in line.shown_kinds)
            imgui.pop_style_color()
            ui.landmarks.note(f"timeline/kind/{kind}")
            if changed:
                (line.shown_kinds.add if is_shown else line.shown_kinds.discard)(kind)
        imgui.set_next_item_width(imgui.get_frame_height() * 6.0)
        logarithmic = imgui.SliderFlags_.logarithmic.value
        least = imgui.slider_float(tr_label("Least impulse"), line.least_impulse, 0.0, 1e4, "%.3g N s", logarithmic)
        line.least_impulse = max(least[1], 0.0)
        ui.landmarks.note("timeline/impulse")
        imgui.end_popup()

    # --- the bar ---------------------------------------------------------------------------------------------------

    def _draw_bar(self, ui: Ui, status: SessionStatus) -> None:
        room = imgui.get_content_region_avail()
        width, height = room.x, max(imgui.get_frame_height() * 1.8, min(room.y, imgui.get_frame_height() * 3.0))
        if width < 10.0:
            return
        line = ui.model.timeline
        buttons = imgui.ButtonFlags_.mouse_button_left.value | imgui.ButtonFlags_.mouse_button_middle.value
        imgui.invisible_button("###bar", (width, height), buttons)
        ui.landmarks.note("timeline/bar")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        clusters = line.clusters(width)
        pointed = self._pointed(clusters, low.x, high.y) if imgui.is_item_hovered() else None
        self._take_pointer(line, low.x, width, pointed)
        shown = self._scrubbed if self._scrubbed is not None else status.simulation_time
        self._paint(line, low, high, shown, clusters)
        if pointed is not None and self._scrubbed is None:
            imgui.set_tooltip("\n".join(_told(ui, marker) for marker in pointed.markers[:_TOLD]) + _more(pointed))

    def _pointed(self, clusters: list[Cluster], left: float, bottom: float) -> Cluster | None:
        """The mark under the pointer: marks stand in the lower half of the bar."""
        pointer = imgui.get_mouse_pos()
        if pointer.y < bottom - imgui.get_frame_height():
            return None
        near = [cluster for cluster in clusters if abs(left + cluster.x - pointer.x) <= _REACH]
        return min(near, key=lambda cluster: abs(left + cluster.x - pointer.x), default=None)

    def _take_pointer(self, line: Timeline, left: float, width: float, pointed: Cluster | None) -> None:
        """Scrubs, jumps to a mark, zooms with the wheel and pans with the middle button."""
        io, x = imgui.get_io(), imgui.get_mouse_pos().x - left
        first, last = line.view
        if imgui.is_item_hovered() and io.mouse_wheel != 0.0:
            line.zoom(0.8**io.mouse_wheel, line.time_at(x, width))
        if imgui.is_item_active() and imgui.is_mouse_dragging(imgui.MouseButton_.middle.value, 0.0):
            line.pan(-io.mouse_delta.x * (last - first) / width)
        elif imgui.is_item_activated() and pointed is not None:
            line.go_to(pointed.markers[0].time)
        elif (
            imgui.is_item_active()
            and imgui.is_mouse_down(imgui.MouseButton_.left.value)
            and not self._is_on_mark(pointed)
        ):
            start, end = line.span
            time = min(max(line.time_at(min(max(x, 0.0), width), width), start), end)
            if time != self._scrubbed:
                self._scrubbed = time
                line.go_to(time)
        elif imgui.is_item_deactivated():
            self._scrubbed = None

    def _is_on_mark(self, pointed: Cluster | None) -> bool:
        """Whether the button went down on a mark and has not moved since: a click, no scrubbing."""
        return self._scrubbed is None and pointed is not None and not imgui.is_mouse_dragging(0)

    def _paint(
        self, line: Timeline, low: imgui.ImVec2, high: imgui.ImVec2, shown: float, clusters: list[Cluster]
    ) -> None:
        draw_list, width = imgui.get_window_draw_list(), high.x - low.x
        first, last = line.view
        draw_list.push_clip_rect(low, high, True)
        draw_list.add_rect_filled(low, high, color_code(FIELD), 4.0)
        kept = [low.x + line.x_of(time, width) for time in line.span]
        draw_list.add_rect_filled((kept[0], low.y), (kept[1], high.y), color_code((*TEXT_DIM[:3], 0.15)), 4.0)
        place = low.x + line.x_of(shown, width)
        draw_list.add_rect_filled((kept[0], low.y), (place, high.y), color_code((*ACCENT[:3], 0.25)), 4.0)
        if line.is_looping and line.can_wind:
            ends = [low.x + line.x_of(time, width) for time in line.loop]
            draw_list.add_rect_filled((ends[0], low.y), (ends[1], low.y + 4.0), color_code(GOOD))
            for x in ends:
                draw_list.add_line((x, low.y), (x, high.y), color_code((*GOOD[:3], 0.6)))
        for time in round_times(first, last, width, _LABEL_DISTANCE):
            x = low.x + line.x_of(time, width)
            draw_list.add_line((x, low.y), (x, low.y + 6.0), color_code(TEXT_DIM))
            if x < high.x - 20.0:
                draw_list.add_text((x + 3.0, low.y + 3.0), color_code(TEXT_DIM), f"{time:g}")
        hardest = max((cluster.impulse for cluster in clusters), default=0.0)
        for cluster in clusters:
            first_kind = cluster.markers[0].kind
            share = (cluster.impulse / hardest) ** 0.5 if first_kind == "collision" and hardest > 0.0 else 1.0
            x, tall = low.x + cluster.x, _MARK_HEIGHTS[0] + share * (_MARK_HEIGHTS[1] - _MARK_HEIGHTS[0])
            color = color_code(_COLORS[first_kind])
            draw_list.add_rect_filled((x - 1.5, high.y - 2.0 - tall), (x + 1.5, high.y - 2.0), color, 1.0)
        for bookmark in line.bookmarks.all:
            x = low.x + line.x_of(bookmark.time, width)
            draw_list.add_triangle_filled((x - 5.0, low.y), (x + 5.0, low.y), (x, low.y + 8.0), color_code(TEXT))
        draw_list.add_line((place, low.y), (place, high.y), color_code(TEXT), 2.0)
        draw_list.pop_clip_rect()


def _button(ui: Ui, icon: str, name: str) -> None:
    """A button that does an action, with its keys in the tooltip, and what comes next beside it."""
    action, keys = ui.actions[name], ui.keys.label_of(name)
    tooltip = f"{tr(action.label)} ({keys})" if keys else tr(action.label)
    if icon_button(icon, name, tooltip, enabled=action.is_possible()):
        action.run()
    ui.landmarks.note(f"timeline/{name.removeprefix('time.')}")
    imgui.same_line(0.0, 2.0)


def _told(ui: Ui, marker: Marker) -> str:
    """A line about a marker."""
    scene = ui.model.scene
    one, other = scene.name_of(marker.entity), scene.name_of(marker.other)
    match marker.kind:
        case "collision":
            text = tr("{one} hits {other}: {impulse} N s", one=one, other=other, impulse=f"{marker.strength:.3g}")
        case "trigger":
            text = tr("{other} enters {one}", one=one, other=other)
        case "edit" if marker.entity:
            text = f"{tr('Edited')}: {tr_sentence(marker.text)}, {one}"
        case "edit":
            text = f"{tr('Edited')}: {tr_sentence(marker.text)}"
        case _:
            text = tr_sentence(marker.text)
    return f"{marker.time:.2f} s   {text}"


def _more(cluster: Cluster) -> str:
    count = len(cluster.markers) - _TOLD
    return "\n" + tr("and {count} more", count=count) if count > 0 else ""
