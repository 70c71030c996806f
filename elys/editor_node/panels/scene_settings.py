"""What holds for the whole scene: shown by the inspector when nothing is selected."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import msgspec
from imgui_bundle import imgui

from elys.common.components import FieldDeclaration, Kind
from elys.common.scene import SceneSettings
from elys.editor_node.panels.field_rows import FieldRows
from elys.editor_node.ui import Ui, dim_text

_DEFAULTS: Final = SceneSettings()


def _declare(
    name: str, kind: Kind, text: str, *, unit: str = "", minimum: float | None = None, maximum: float | None = None
) -> FieldDeclaration:
    return FieldDeclaration(
        name=name,
        kind=kind,
        default=getattr(_DEFAULTS, name),
        text=text,
        unit=unit,
        minimum=minimum,
        maximum=maximum,
        step=1.0 if kind is Kind.INT else 0.05,
        choices=(),
        dtype="f4",
        width=1 if kind is Kind.INT else 3,
    )


_FIELDS: Final = (
    _declare("gravity", Kind.VEC3, "Acceleration of everything that falls.", unit="m/s2"),
    _declare("substeps", Kind.INT, "Steps of the contact solver in a tick: more are stiffer and dearer.", minimum=1, maximum=64),
    _declare("background", Kind.COLOR, "Colour behind everything, linear.", minimum=0.0),
    _declare("ambient", Kind.COLOR, "Light that reaches every surface from everywhere, linear.", minimum=0.0),
)  # fmt: skip


def draw_scene_settings(ui: Ui, rows: FieldRows) -> None:
    """A line for each setting that may change while the scene runs."""
    scene = ui.model.scene
    imgui.push_font(ui.fonts.bold, 0.0)
    imgui.text_unformatted(scene.mirror.scene or "Scene")
    imgui.pop_font()
    dim_text(f"{len(scene.mirror.entities)} entities, {scene.settings.tick_rate} ticks a second")
    imgui.spacing()
    if not rows.begin("settings"):
        return
    for declared in _FIELDS:
        name = declared.name
        change = rows.draw(
            ui,
            declared,
            f"inspector/settings/{name}",
            (getattr(scene.settings, name),),
            reset=partial(_set, ui, name, declared.default, None),
        )
        if change is not None:
            _set(ui, name, change.value, change.stroke)
    imgui.end_table()


def _set(ui: Ui, name: str, value: Any, stroke: object) -> None:
    settings = msgspec.structs.replace(ui.model.scene.settings, **{name: value})
    ui.model.edit.set_settings(settings, stroke=stroke)
