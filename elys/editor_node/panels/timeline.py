"""The timeline of a replay: scrub, step, loop. A live simulation has no other time than now."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

from elys.bus.messages.session import SessionStatus
from elys.editor_node.theme import ACCENT, FIELD, TEXT, TEXT_DIM, icons
from elys.editor_node.ui import Ui, centered_text, color_code, icon_button

TITLE: Final = f"{icons.ICON_FA_FILM}  Timeline###Timeline"
_TICK_DISTANCE: Final = 90.0  # [pixels] least distance between two labels


class TimelinePanel:
    """While the person scrubs the mark follows the pointer; let go, it shows the host's word again."""

    def __init__(self) -> None:
        self._scrubbed: float | None = None  # [s] where the pointer holds the mark

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE)[0]:
            status = ui.model.status
            if status is None or status.kind != "replay":
                imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
                centered_text(
                    "A live simulation goes only forward. Play a recording to go back and forth in it.",
                    imgui.get_content_region_avail().x,
                )
            else:
                self._draw_buttons(ui, status)
                self._draw_bar(ui, status)
        imgui.end()

    def _draw_buttons(self, ui: Ui, status: SessionStatus) -> None:
        model = ui.model
        if icon_button(icons.ICON_FA_BACKWARD_FAST, "start", "To the start"):
            model.seek(status.start_time)
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_BACKWARD_STEP, "back", "One tick back"):
            model.step(-1)
        imgui.same_line(0.0, 2.0)
        icon = icons.ICON_FA_PAUSE if status.playing else icons.ICON_FA_PLAY
        if icon_button(icon, "play", "Pause" if status.playing else "Play"):
            model.toggle_playing()
        ui.landmarks.note("timeline/play")
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_FORWARD_STEP, "forward", "One tick on"):
            model.step(1)
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_REPEAT, "loop", "Start again at the end", active=status.loop):
            model.set_loop(not status.loop)
        imgui.same_line(0.0, 14.0)
        imgui.align_text_to_frame_padding()
        shown = self._scrubbed if self._scrubbed is not None else status.simulation_time
        imgui.text_unformatted(f"{shown:.2f} s of {status.end_time:.2f} s")

    def _draw_bar(self, ui: Ui, status: SessionStatus) -> None:
        width, height = imgui.get_content_region_avail().x, imgui.get_frame_height() * 1.6
        if width < 10.0:
            return
        imgui.invisible_button("###bar", (width, height))
        ui.landmarks.note("timeline/bar")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        duration = max(status.end_time - status.start_time, 1e-6)
        if imgui.is_item_active():
            share = min(max((imgui.get_mouse_pos().x - low.x) / width, 0.0), 1.0)
            time = status.start_time + share * duration
            if time != self._scrubbed:
                self._scrubbed = time
                ui.model.seek(time)
        elif imgui.is_item_deactivated():
            self._scrubbed = None
        shown = self._scrubbed if self._scrubbed is not None else status.simulation_time
        place = low.x + width * min(max((shown - status.start_time) / duration, 0.0), 1.0)
        draw_list = imgui.get_window_draw_list()
        draw_list.add_rect_filled(low, high, color_code(FIELD), 4.0)
        draw_list.add_rect_filled(low, (place, high.y), color_code((*ACCENT[:3], 0.25)), 4.0)
        for time in _marks(status.start_time, status.end_time, width):
            x = low.x + width * (time - status.start_time) / duration
            draw_list.add_line((x, high.y - 6.0), (x, high.y), color_code(TEXT_DIM))
            if x < high.x - 20.0:
                draw_list.add_text((x + 3.0, low.y + 3.0), color_code(TEXT_DIM), f"{time:g}")
        draw_list.add_line((place, low.y), (place, high.y), color_code(TEXT), 2.0)


def _marks(start: float, end: float, width: float) -> list[float]:
    """Round times, far enough apart for their labels."""
    room = max(width / _TICK_DISTANCE, 1.0)
    least = max((end - start) / room, 1e-3)
    step = next(
        (base * 10.0**power for power in range(-3, 7) for base in (1.0, 2.0, 5.0) if base * 10.0**power >= least), 1e7
    )
    first = -(-start // step) * step
    return [round(first + place * step, 6) for place in range(int((end - first) / step) + 1)]
