"""The plan: what the simulation and the pictures do, what they leave out, and why."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Final

from imgui_bundle import imgui

from elys.bus.messages.plan import StagePlan
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_label, tr_title
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import GOOD, TEXT, TEXT_DIM, WARNING, icons
from elys.editor_node.ui import Ui, colored_text, dim_text

TITLE: Final = f"{icons.ICON_FA_LIST_CHECK}  Plan###Plan"


class PlanPanel:
    """Asks the host while it is drawn; render nodes tell with each picture."""

    def __init__(self, instruments: Instruments) -> None:
        self._instruments = instruments
        self._shows_off = True

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            ui.watches.keep("views", self._instruments.watch_views)
            plan = self._instruments.plan
            plan.refresh(time.monotonic())
            if ui.model.is_playing:
                ui.model.request_redraw(0.5)
            _, self._shows_off = imgui.checkbox(tr_label("What is off, too"), self._shows_off)
            ui.landmarks.note("plan/off")
            width = imgui.get_content_region_avail().x / 2.0 - imgui.get_style().item_spacing.x
            if imgui.begin_child("###physics", (width, 0.0)):
                self._draw_physics(ui)
            imgui.end_child()
            imgui.same_line()
            if imgui.begin_child("###pictures"):
                self._draw_pictures(ui)
            imgui.end_child()
        imgui.end()

    def _draw_physics(self, ui: Ui) -> None:
        imgui.separator_text(tr("Simulation"))
        plan = self._instruments.plan
        if plan.newest is None:
            dim_text(tr_sentence(plan.refusal) or tr("waiting for the answer"))
            return
        numbers = {"tick": plan.newest.tick, "bodies": plan.newest.bodies, "contacts": plan.newest.contacts}
        dim_text(tr("tick {tick}: {bodies} bodies, {contacts} contacts", **numbers))
        self._draw_stages(ui, "physics", plan.newest.stages)

    def _draw_pictures(self, ui: Ui) -> None:
        if not self._instruments.views:
            imgui.separator_text(tr("Pictures"))
            dim_text(tr("no picture was drawn since this is shown"))
        for view, profile in self._instruments.views.items():
            imgui.separator_text(f"{tr('view')} {view}")
            dim_text(f"{profile.width} x {profile.height}    {profile.total:.2f} ms    {profile.node}")
            self._draw_stages(ui, f"view/{view}", profile.passes)

    def _draw_stages(self, ui: Ui, name: str, stages: Iterable[StagePlan]) -> None:
        flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_fixed_fit
        if not imgui.begin_table(f"###{name}", 3, int(flags)):
            return
        imgui.table_setup_column("###stage")
        imgui.table_setup_column("###switch")
        imgui.table_setup_column("###why", imgui.TableColumnFlags_.width_stretch.value)
        for stage in stages:
            if not stage.is_on and not self._shows_off:
                continue
            imgui.table_next_row()
            imgui.table_next_column()
            colored_text(TEXT if stage.is_on else TEXT_DIM, tr(stage.name.replace("_", " ")))
            ui.landmarks.note(f"plan/{name}/{stage.name}")
            imgui.table_next_column()
            colored_text(*_switch(stage))
            imgui.table_next_column()
            imgui.push_text_wrap_pos(0.0)
            dim_text(tr_sentence(stage.why))
            imgui.pop_text_wrap_pos()
        imgui.end_table()


def _switch(stage: StagePlan) -> tuple[tuple[float, ...], str]:
    if stage.is_forced:
        return tuple(WARNING), tr("forced")
    return (tuple(GOOD), tr("on")) if stage.is_on else (tuple(TEXT_DIM), tr("off"))
