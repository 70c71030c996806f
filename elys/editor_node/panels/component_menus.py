"""What is done with whole components: the menu on each one's header, and the list of those that can be added."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.components import Component, ComponentDeclaration, declarations
from elys.common.errors import ComponentError
from elys.editor_node.component_clipboard import components_in, text_of
from elys.editor_node.field_search import offers
from elys.editor_node.language import tr, tr_label
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, dim_text

_ICONS: Final = {
    "Transform": icons.ICON_FA_UP_DOWN_LEFT_RIGHT,
    "RigidBody": icons.ICON_FA_WEIGHT_HANGING,
    "Collider": icons.ICON_FA_SHAPES,
    "Joint": icons.ICON_FA_LINK,
    "MeshRenderer": icons.ICON_FA_CUBE,
    "Material": icons.ICON_FA_PALETTE,
    "Light": icons.ICON_FA_LIGHTBULB,
    "Environment": icons.ICON_FA_CLOUD_SUN,
    "Camera": icons.ICON_FA_VIDEO,
    "Animation": icons.ICON_FA_PERSON_RUNNING,
    "InputMap": icons.ICON_FA_GAMEPAD,
    "AnimationBlend": icons.ICON_FA_PERSON_RUNNING,
    "AnimationLayer": icons.ICON_FA_LAYER_GROUP,
    "AnimationMarkers": icons.ICON_FA_FLAG,
    "RootMotion": icons.ICON_FA_SHOE_PRINTS,
    "Script": icons.ICON_FA_CODE,
}
_LIST_LINES: Final = 16  # of a list that is longer the rest is scrolled to


def component_icon(name: str) -> str:
    """The picture beside a component's name."""
    return _ICONS.get(name, icons.ICON_FA_PUZZLE_PIECE)


def copy_components(ui: Ui, components: dict[str, Component]) -> None:
    """Puts components into the system's clipboard."""
    imgui.set_clipboard_text(text_of(components, ui.model.scene))


def copied_components(ui: Ui) -> dict[str, dict[str, Any]]:
    """What the clipboard holds; none where it holds anything else."""
    try:
        return components_in(imgui.get_clipboard_text(), ui.model.scene)
    except ComponentError:
        return {}


def paste_values(ui: Ui, entities: Sequence[int], component: str) -> None:
    """Gives the copied values to all that have the component; says why where they are none."""
    try:
        found = components_in(imgui.get_clipboard_text(), ui.model.scene)
    except ComponentError as error:
        ui.model.say("error", tr_sentence(str(error)))
        return
    if component in found:
        ui.model.edit.set_fields(entities, component, found[component])


def paste_as_new(ui: Ui, entities: Sequence[int]) -> None:
    """Adds the copied components to those of the entities that lack them; who has one already gets its values."""
    try:
        found = components_in(imgui.get_clipboard_text(), ui.model.scene)
    except ComponentError as error:
        ui.model.say("error", tr_sentence(str(error)))
        return
    ui.model.edit.lay_over(
        "Paste {components} into {what}",
        {entity: dict(found) for entity in entities},
        components=", ".join(found),
    )


def draw_component_menu(
    ui: Ui, declaration: ComponentDeclaration, entities: Sequence[int], component_of: Callable[[str], Component]
) -> None:
    """The button at the end of a component's header and what it opens."""
    name = declaration.name
    imgui.push_style_color(imgui.Col_.button, 0)
    if imgui.button(f"{icons.ICON_FA_ELLIPSIS_VERTICAL}###menu", (imgui.get_frame_height(), 0.0)):
        imgui.open_popup("component")
    imgui.pop_style_color()
    ui.landmarks.note(f"inspector/{name}/menu")
    if not imgui.begin_popup("component"):
        return
    copied = copied_components(ui)
    if imgui.menu_item(tr_label("Copy component"), "", False)[0]:
        copy_components(ui, {name: component_of(name)})
    ui.landmarks.note("component/copy")
    if imgui.menu_item(tr_label("Paste values"), "", False, name in copied)[0]:
        paste_values(ui, entities, name)
    ui.landmarks.note("component/paste")
    if imgui.menu_item(tr_label("Paste as new component"), "", False, bool(copied))[0]:
        paste_as_new(ui, entities)
    ui.landmarks.note("component/paste_new")
    imgui.separator()
    if imgui.menu_item(tr_label("Reset to defaults"), "", False)[0]:
        defaults = {declared.name: declared.default for declared in declaration.fields}
        ui.model.edit.set_fields(entities, name, defaults)
    ui.landmarks.note("component/reset")
    if imgui.menu_item(tr_label("Remove component"), "", False)[0]:
        ui.model.edit.remove_component(entities, name)
    ui.landmarks.note("component/remove")
    imgui.end_popup()


class AddComponentPopup:
    """The button below the components and its list, searched while it is open."""

    def __init__(self) -> None:
        self.opens = False  # asked for from elsewhere
        self._search = ""
        self._types_on = False  # Enter found nothing: the person types another word

    def draw(self, ui: Ui, entities: Sequence[int], owned: Collection[str]) -> None:
        """Draws the button, and the list while it is open."""
        imgui.spacing()
        pressed = imgui.button(f"{icons.ICON_FA_PLUS}  {tr('Add component')}###add component", (-1.0, 0.0))
        ui.landmarks.note("inspector/add")
        if pressed or self.opens:
            self.opens, self._search = False, ""
            imgui.open_popup("add component")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        imgui.set_next_window_pos((low.x, high.y + 2.0), imgui.Cond_.appearing.value)
        imgui.set_next_window_size((high.x - low.x, 0.0))
        if not imgui.begin_popup("add component"):
            return
        if imgui.is_window_appearing() or self._types_on:
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._search = imgui.input_text_with_hint("###search", tr("Search"), self._search, flags)
        ui.landmarks.note("component/search")
        chosen = self._draw_list(ui, owned, takes_first=entered)
        self._types_on = entered and not chosen
        if chosen:
            ui.model.edit.add_component(entities, chosen)
            imgui.close_current_popup()
        copied = copied_components(ui)
        if copied:
            imgui.separator()
            label = tr("Paste {names}", names=", ".join(copied))
            if imgui.menu_item(f"{icons.ICON_FA_PASTE}   {label}###paste", "", False)[0]:
                paste_as_new(ui, entities)
            ui.landmarks.note("component/paste_copied")
        imgui.end_popup()

    def _draw_list(self, ui: Ui, owned: Collection[str], *, takes_first: bool) -> str:
        """The components by group, with what each is; the name of the one that was chosen."""
        found = offers(self._search, declarations(), owned)
        if takes_first and found:
            return found[0].declaration.name
        if not found:
            dim_text(tr("No component is called so"))
        chosen, group = "", ""
        line = imgui.get_text_line_height_with_spacing()
        height = min(line * _LIST_LINES, line * (2.0 * len(found) + len({offer.group for offer in found}) + 1.0))
        if imgui.begin_child("###list", (0.0, height)):
            for offer in found:
                if offer.group != group:
                    group = offer.group
                    imgui.separator_text(tr(group))
                name = offer.declaration.name
                if imgui.selectable(f"{component_icon(name)}   {name}###{name}", False)[0]:
                    chosen = name
                ui.landmarks.note(f"component/{name}")
                imgui.indent()
                dim_text(_fitting(tr(offer.declaration.text), imgui.get_content_region_avail().x))
                imgui.unindent()
                if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
                    imgui.set_tooltip(tr(offer.declaration.text))
        imgui.end_child()
        return chosen


def _fitting(text: str, width: float) -> str:
    """A text, cut short where the line ends."""
    if imgui.calc_text_size(text).x <= width:
        return text
    length = len(text)
    while length > 1 and imgui.calc_text_size(f"{text[:length]}...").x > width:
        length -= max(1, length // 16)
    return f"{text[:length]}..."
