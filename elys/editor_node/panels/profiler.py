"""The profiler: what ticks cost, stage by stage, as a strip of the last seconds and as bars of the last tick."""

from __future__ import annotations

from typing import Final

import numpy as np
from imgui_bundle import imgui

from elys.editor_node.language import tr, tr_title
from elys.editor_node.theme import FIELD, SERIES, TEXT_DIM, icons
from elys.editor_node.ui import Ui, centered_text, color_code, dim_text

TITLE: Final = f"{icons.ICON_FA_GAUGE_HIGH}  Profiler###Profiler"


class ProfilerPanel:
    """Reads the profiles that the host publishes each tick."""

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            profiles = ui.model.profiles
            if not profiles:
                imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
                centered_text(tr("No tick was measured yet"), imgui.get_content_region_avail().x)
            else:
                self._draw_summary(ui)
                self._draw_stages(ui)
        imgui.end()

    def _draw_summary(self, ui: Ui) -> None:
        totals = np.array([profile.total for profile in ui.model.profiles], np.float32)
        newest = ui.model.profiles[-1]
        counts = "     ".join(f"{value} {tr(name)}" for name, value in newest.counts.items())
        median, worst = np.percentile(totals, (50, 99))
        figures = {"total": f"{newest.total:.2f}", "median": f"{median:.2f}", "worst": f"{worst:.2f}"}
        dim_text(tr("tick {total} ms     median {median}     p99 {worst}", **figures) + f"     {counts}")
        size = (imgui.get_content_region_avail().x, imgui.get_frame_height() * 1.6)
        imgui.plot_histogram("###ticks", totals, scale_min=0.0, scale_max=float(totals.max()), graph_size=size)

    def _draw_stages(self, ui: Ui) -> None:
        newest = ui.model.profiles[-1]
        longest = max(*newest.stages.values(), 1e-6) if newest.stages else 1.0
        label = max((imgui.calc_text_size(name).x for name in newest.stages), default=0.0) + 12.0
        height = imgui.get_text_line_height()
        for place, (name, cost) in enumerate(newest.stages.items()):
            dim_text(name.replace("_", " "))
            imgui.same_line(label)
            low = imgui.get_cursor_screen_pos()
            room = max(imgui.get_content_region_avail().x - 70.0, 10.0)
            imgui.dummy((room, height))
            draw_list = imgui.get_window_draw_list()
            draw_list.add_rect_filled(
                (low.x, low.y + 2.0), (low.x + room, low.y + height - 2.0), color_code(FIELD), 3.0
            )
            right = low.x + max(room * cost / longest, 2.0)
            color = color_code(SERIES[place % len(SERIES)])
            draw_list.add_rect_filled((low.x, low.y + 2.0), (right, low.y + height - 2.0), color, 3.0)
            draw_list.add_text((low.x + room + 8.0, low.y), color_code(TEXT_DIM), f"{cost:.3f} ms")
