"""What holds for the whole scene: shown by the inspector when nothing is selected."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import msgspec
from imgui_bundle import imgui

from elys.common.components import Component, ComponentDeclaration, FieldDeclaration, Kind
from elys.common.errors import ComponentError
from elys.common.scene import PictureSettings, SceneSettings
from elys.editor_node.field_search import shows_field
from elys.editor_node.field_values import values_of_each
from elys.editor_node.language import tr
from elys.editor_node.panels.field_rows import FieldActions, FieldRows, FieldState
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.ui import Ui, dim_text

_DEFAULTS: Final = SceneSettings()
TONES: Final = ("neutral", "agx", "none")


def _declare(
    name: str,
    kind: Kind,
    text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    defaults: SceneSettings | PictureSettings = _DEFAULTS,
) -> FieldDeclaration:
    return FieldDeclaration(
        name=name,
        kind=kind,
        default=getattr(defaults, name),
        text=text,
        unit=unit,
        minimum=minimum,
        maximum=maximum,
        step=1.0 if kind is Kind.INT else 0.05,
        choices=choices,
        dtype="f4",
        width=3 if kind in (Kind.VEC3, Kind.COLOR) else 1,
    )


_FIELDS: Final = (
    _declare("gravity", Kind.VEC3, "Acceleration of everything that falls.", unit="m/s2"),
    _declare("substeps", Kind.INT, "Steps of the contact solver in a tick: more are stiffer and dearer.", minimum=1, maximum=64),
    _declare("background", Kind.COLOR, "Colour behind everything, linear.", minimum=0.0),
    _declare("ambient", Kind.COLOR, "Light that reaches every surface from everywhere, linear.", minimum=0.0),
)  # fmt: skip
_picture = partial(_declare, defaults=_DEFAULTS.picture)
_PICTURE_FIELDS: Final = (
    _picture("exposure", Kind.FLOAT, "Stops by which pictures are brighter.", unit="EV", minimum=-32.0, maximum=32.0),
    _picture(
        "tone_mapping", Kind.CHOICE, "Neutral keeps colours, AgX is like film, none cuts at white.", choices=TONES
    ),
    _picture("bloom", Kind.FLOAT, "Share of light that is scattered around what is bright.", minimum=0.0, maximum=1.0),
    _picture("ambient_occlusion", Kind.FLOAT, "How much corners lose of light from around.", minimum=0.0, maximum=1.0),
    _picture("occlusion_radius", Kind.FLOAT, "How near things are that take it.", unit="m", minimum=0.01, maximum=1e3),
    _picture(
        "fog_density", Kind.FLOAT, "Share of light that fog takes a metre.", unit="1/m", minimum=0.0, maximum=100.0
    ),
    _picture("fog_falloff", Kind.FLOAT, "How fast fog thins with height.", unit="1/m", minimum=0.0, maximum=100.0),
    _picture("fog_color", Kind.COLOR, "Radiance of thick fog, linear.", minimum=0.0),
    _picture("fxaa", Kind.BOOL, "Smooths edges of the finished picture."),
    _picture("multiple_scattering", Kind.BOOL, "Gives rough metals back what a single bounce loses."),
    _picture("sampled_surroundings", Kind.BOOL, "Mirrors light from around rightly from every side. Slow."),
    _picture("specular_antialiasing", Kind.BOOL, "Keeps highlights from sparkling."),
)


# As components, so that their fields are checked and found like any others.
_SETTINGS: Final = ComponentDeclaration(name="Settings", struct=Component, text="", fields=_FIELDS)
_PICTURE: Final = ComponentDeclaration(name="Picture", struct=Component, text="", fields=_PICTURE_FIELDS)


def draw_scene_settings(ui: Ui, rows: FieldRows, search: str = "") -> None:
    """A line for each setting that may change while the scene runs, and that has each word of the search in its name."""
    scene = ui.model.scene
    imgui.push_font(ui.fonts.bold, 0.0)
    imgui.text_unformatted(scene.mirror.scene or tr("Scene"))
    imgui.pop_font()
    dim_text(
        tr("{count} entities, {rate} ticks a second", count=len(scene.mirror.entities), rate=scene.settings.tick_rate)
    )
    imgui.spacing()
    if not rows.begin("settings"):
        return
    for declared in _FIELDS:
        _draw_setting(ui, rows, search, _SETTINGS, declared, scene.settings, partial(_set, ui))
    for declared in _PICTURE_FIELDS:
        _draw_setting(ui, rows, search, _PICTURE, declared, scene.settings.picture, partial(_set_picture, ui))
    imgui.end_table()


def _draw_setting(
    ui: Ui,
    rows: FieldRows,
    search: str,
    owner: ComponentDeclaration,
    declared: FieldDeclaration,
    values: SceneSettings | PictureSettings,
    send: Callable[[str, Any, object], None],
) -> None:
    if not shows_field(search, owner, declared):
        return
    name, value = declared.name, getattr(values, declared.name)
    part = "picture/" if owner is _PICTURE else ""
    path = f"inspector/settings/{part}{name}"
    state = FieldState(is_default=value == declared.default)
    actions = FieldActions(reset=partial(send, name, declared.default, None))
    change = rows.draw(ui, declared, path, value, state, actions)
    if change is None:
        return
    try:
        chosen = values_of_each(owner, declared, {0: value}, change)[0]
    except ComponentError as error:
        rows.refuse(path, tr_sentence(str(error)))
        return
    if change.entry is not None:
        rows.show(path, chosen)
    send(name, chosen, change.stroke)


def _set_picture(ui: Ui, name: str, value: Any, stroke: object) -> None:
    _set(ui, "picture", msgspec.structs.replace(ui.model.scene.settings.picture, **{name: value}), stroke)


def _set(ui: Ui, name: str, value: Any, stroke: object) -> None:
    settings = msgspec.structs.replace(ui.model.scene.settings, **{name: value})
    ui.model.edit.set_settings(settings, stroke=stroke)
