"""Diagnostics: energy, overlap, errors of joints and of the solver over the last seconds, with the entities they are at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from imgui_bundle import imgui

from elys.bus.messages.physics import Diagnostics
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_title
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, centered_text, dim_text

TITLE: Final = f"{icons.ICON_FA_HEART_PULSE}  Diagnostics###Diagnostics"


class _Curve(NamedTuple):
    """One figure over time: what it is called, how it is read and written, and which entities it is at."""

    label: str
    value: Callable[[Diagnostics], float]
    form: str
    entities: Callable[[Diagnostics], Sequence[int]]


_CURVES: Final = (
    _Curve("energy", lambda d: d.kinetic + d.potential, "{:.6g} J", lambda d: ()),
    _Curve("kinetic energy", lambda d: d.kinetic, "{:.4g} J", lambda d: ()),
    _Curve("deepest overlap", lambda d: 1000.0 * d.deepest_overlap, "{:.3f} mm", lambda d: d.deepest),
    _Curve("residual", lambda d: d.residual, "{:.2g} m/s", lambda d: d.restless),
    _Curve("worst joint", lambda d: 1000.0 * d.joint_error, "{:.3f} mm", lambda d: (d.joint,)),
    _Curve("its angle", lambda d: d.joint_angle_error, "{:.2g} rad", lambda d: (d.turned_joint,)),
)


class DiagnosticsPanel:
    """Reads what the host measures each tick, which it does while somebody listens."""

    def __init__(self, instruments: Instruments) -> None:
        self._instruments = instruments

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            ui.watches.keep("diagnostics", self._instruments.watch_measured)
            measured = self._instruments.measured
            if not measured:
                imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
                centered_text(tr("No tick was measured yet"), imgui.get_content_region_avail().x)
            else:
                newest = measured[-1]
                dim_text(_summary(newest))
                for curve in _CURVES:
                    _draw_curve(ui, curve, measured)
        imgui.end()


def _summary(newest: Diagnostics) -> str:
    momentum = "  ".join(f"{value:.3g}" for value in newest.momentum)
    awake = tr(
        "{awake} of {bodies} bodies awake in {islands} islands",
        awake=newest.awake,
        bodies=newest.bodies,
        islands=newest.islands,
    )
    contacts = tr("{count} contacts", count=newest.contacts)
    return f"{awake}     {contacts}     " + tr("momentum {momentum} kg m/s", momentum=momentum)


def _draw_curve(ui: Ui, curve: _Curve, measured: Sequence[Diagnostics]) -> None:
    values, newest = np.array([curve.value(found) for found in measured], np.float32), measured[-1]
    height = imgui.get_frame_height()
    size = (min(imgui.get_content_region_avail().x * 0.35, 12.0 * height), height)
    imgui.plot_lines(f"###{curve.label}", values, graph_size=size)
    imgui.same_line()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(f"{tr(curve.label)}  {curve.form.format(curve.value(newest))}")
    for place, entity in enumerate(curve.entities(newest)):
        if entity and ui.model.scene.exists(entity):
            imgui.same_line()
            if imgui.small_button(f"{ui.model.scene.name_of(entity)}###{curve.label} {place}"):
                ui.model.selection.replace((entity,))
            ui.landmarks.note(f"diagnostics/{curve.label}/{place}")
