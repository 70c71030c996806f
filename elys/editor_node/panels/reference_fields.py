"""References to entities and assets: dropped, picked from a list that is searched, taken away, or followed to what they name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from imgui_bundle import imgui

from elys.common.asset_kinds import expected_kind
from elys.common.assets import PRIMITIVES
from elys.common.components import FieldDeclaration, Kind, declaration_of, declarations
from elys.editor_node.fields import (
    ENTITY_PAYLOAD,
    MIXED,
    FieldContext,
    FieldEdit,
    PickState,
    asset_label,
    dropped_asset,
    element_width,
    label_item,
    small_button,
)
from elys.editor_node.language import tr
from elys.editor_node.panels.pick_list import draw_list, open_list
from elys.editor_node.scene_mirror import EditorScene
from elys.editor_node.theme import icons

LISTED: Final = 500  # of what is found so many are shown: who needs more types another letter


def edit_entity(value: int, context: FieldContext) -> FieldEdit:
    """The entity's name; another one is dropped here from the hierarchy, or picked."""
    edit = FieldEdit()
    scene, is_mixed = context.scene, context.mixed[0]
    label = MIXED if is_mixed else scene.name_of(value) if value else tr("none")
    width = element_width(1, buttons=3)
    imgui.button("###value", (width, 0.0))
    context.note()
    label_item(f"{icons.ICON_FA_CUBE}  {label}")
    if value and not is_mixed and not scene.exists(value):
        imgui.set_item_tooltip(tr("This entity is not there any more"))
    if imgui.begin_drag_drop_target():
        payload = imgui.accept_drag_drop_payload_py_id(ENTITY_PAYLOAD)
        if payload is not None and scene.exists(payload.data_id):
            edit.choose(payload.data_id)
        imgui.end_drag_drop_target()
    if small_button(icons.ICON_FA_CROSSHAIRS, "pick", tr("Pick an entity"), context):
        open_list(context.picking)
    found = draw_list(context, _entities(scene, context.picking), scene.name_of)
    if found is not None:
        edit.choose(found)
    has_value = bool(value) or is_mixed
    if small_button(icons.ICON_FA_XMARK, "clear", tr("None"), context, enabled=has_value):
        edit.choose(0)
    if small_button(
        icons.ICON_FA_ARROW_RIGHT, "follow", tr("Select it"), context, enabled=scene.exists(value), only_looks=True
    ):
        context.ui.model.selection.replace((value,))
    return edit


def edit_asset(field: FieldDeclaration, value: str, context: FieldContext) -> FieldEdit:
    """Its name, sent when Enter is pressed or the person goes elsewhere; another asset is dropped here or picked."""
    edit = FieldEdit()
    is_mixed = context.mixed[0]
    shown = "" if is_mixed else asset_label(field, value)
    imgui.set_next_item_width(element_width(1, buttons=3))
    _, text = imgui.input_text_with_hint("###value", MIXED if is_mixed else "", shown)
    context.note()
    if imgui.is_item_deactivated_after_edit() and text != shown:
        edit.choose(text)
    if shown != value and not is_mixed and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(value)
    dropped = dropped_asset(context.ui, expected_kind(field.name))
    if dropped is not None and dropped.choices:
        open_list(context.picking)
        context.picking.offered = dict(dropped.choices)
    elif dropped is not None:
        edit.choose(dropped.reference)
    if small_button(icons.ICON_FA_CROSSHAIRS, "pick", tr("Pick one that the scene knows"), context):
        open_list(context.picking)
    found = draw_list(context, _assets(context.scene, field, context.picking), _asset_name(field, context.picking))
    if found is not None:
        edit.choose(found)
    is_empty = value == field.default and not is_mixed
    if small_button(icons.ICON_FA_XMARK, "clear", tr("None"), context, enabled=not is_empty):
        edit.choose(field.default)
    users_wanted = small_button(
        icons.ICON_FA_ARROW_RIGHT,
        "follow",
        tr("Select all that use it"),
        context,
        enabled=bool(value) and not is_mixed,
        only_looks=True,
    )
    if users_wanted:
        context.ui.model.selection.replace(users_of(context.scene, value))
    return edit


def users_of(scene: EditorScene, asset: str) -> list[int]:
    """The entities that name an asset in any field."""
    fields = _asset_fields()
    return [
        entity.id
        for entity in scene.mirror.in_order()
        if any(
            getattr(component, name) == asset
            for kind, component in entity.components.items()
            for name in fields.get(kind, ())
        )
    ]


def known_assets(scene: EditorScene, field: FieldDeclaration) -> list[str]:
    """What a field could hold of what the scene names anywhere: built-in meshes, then assets of its kind."""
    kind = expected_kind(field.name)
    fields = {
        component: [name for name in names if expected_kind(name) == kind]
        for component, names in _asset_fields().items()
    }
    found = {
        getattr(component, name)
        for entity in scene.mirror.entities.values()
        for owner, component in entity.components.items()
        for name in fields.get(owner, ())
    }
    built_in = list(PRIMITIVES) if field.name == "mesh" else []
    return built_in + sorted(found - {"", *built_in})


def _asset_fields() -> dict[str, list[str]]:
    found = {name: [f.name for f in declaration_of(name).fields if f.kind is Kind.ASSET] for name in declarations()}
    return {name: fields for name, fields in found.items() if fields}


def _entities(scene: EditorScene, state: PickState) -> Callable[[], Sequence[int]]:
    def found() -> Sequence[int]:
        key = (scene.structure_version, state.search)
        if state.found_for != key:
            words = state.search.casefold().split()
            state.found_for = key
            state.found = []
            for entity in scene.mirror.in_order():
                name = entity.name.casefold()
                if all(word in name for word in words):
                    state.found.append(entity.id)
                    if len(state.found) == LISTED:
                        break
        return state.found

    return found


def _assets(scene: EditorScene, field: FieldDeclaration, state: PickState) -> Callable[[], Sequence[str]]:
    def found() -> Sequence[str]:
        key = (scene.structure_version, field.name)
        if state.kept_for != key:
            state.kept_for, state.kept = key, known_assets(scene, field)
        words = state.search.casefold().split()
        if state.offered:
            named = [ref for name, ref in state.offered.items() if all(word in name.casefold() for word in words)]
            return named[:LISTED]
        fitting = [a for a in state.kept if all(w in f"{asset_label(field, a)} {a}".casefold() for w in words)]
        return fitting[:LISTED]

    return found


def _asset_name(field: FieldDeclaration, state: PickState) -> Callable[[str], str]:
    names = {reference: name for name, reference in state.offered.items()}
    return lambda asset: names.get(asset) or asset_label(field, asset)
