"""One widget for each kind of field, made from its declaration alone. The larger ones stand in panels/*_fields.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from imgui_bundle import imgui

from elys.common.assets.store import PREFIX, AssetKind, is_reference
from elys.common.assets.texture import split_texture
from elys.common.components import FieldDeclaration
from elys.editor_node.curve_editing import CurveView
from elys.editor_node.expressions import Entry
from elys.editor_node.field_values import NameOffer
from elys.editor_node.language import tr
from elys.editor_node.rotations import Degrees
from elys.editor_node.scene_mirror import EditorScene

if TYPE_CHECKING:
    from elys.editor_node.ui import Ui

ENTITY_PAYLOAD: Final = "elys_entity"  # what the hierarchy lets one drag: an entity's id
ASSET_PAYLOAD: Final = "elys_asset"  # what an asset browser lets one drag: see `drag_asset`
MIXED: Final = "—"  # shown where several entities differ


@dataclass(frozen=True, slots=True, kw_only=True)
class DraggedAsset:
    """What is carried from an asset browser to a field: the text that the field is to hold, and what that is."""

    reference: str = ""  # a content reference, or a file as scene files name it; none where there are `choices`
    choices: tuple[tuple[str, str], ...] = ()  # names and references of which the person is to take one
    kind: AssetKind | None = None  # None where it is not known: any field takes it then
    name: str = ""  # as it is called while it is carried


@dataclass(slots=True)
class FieldEdit:
    """What a person did to a field in this frame."""

    value: Any = None  # the new value, if it changed
    changed: bool = False
    began: bool = False  # took hold of the widget
    ended: bool = False  # let go of it
    axis: int | None = None  # the one element of several that changed
    entry: Entry | None = None  # what was typed: to be applied to each entity's own value, which `value` is not

    def watch(self) -> None:
        """Adds what happened to the last ImGui item."""
        self.began |= imgui.is_item_activated()
        self.ended |= imgui.is_item_deactivated()

    def choose(self, value: Any) -> None:
        """A new value as a whole, at once."""
        self.changed, self.value = True, value


@dataclass(slots=True)
class NumberTyping:
    """The number that is being typed, of which there is one at most, and what is wrong with it."""

    place: str = ""  # path/axis of the field
    text: str = ""
    starts: bool = False  # the text field is to take the keyboard
    wanted: str = ""  # the place to go on to
    drawn: list[str] = field(default_factory=list)  # places of numbers in the order of this frame
    order: list[str] = field(default_factory=list)  # of the frame before

    def start(self, place: str, text: str) -> None:
        """From the next frame on a text field stands at that place."""
        self.place, self.text, self.starts, self.wanted = place, text, True, ""

    def stop(self) -> None:
        """The number is shown again."""
        self.place = self.text = ""

    def go_on(self, place: str, step: int) -> None:
        """Types the next number (+1) or the one before (-1)."""
        if place in self.order:
            self.wanted = self.order[(self.order.index(place) + step) % len(self.order)]

    def begin_frame(self) -> None:
        """Call it before the first number is drawn."""
        self.order, self.drawn = self.drawn, []


@dataclass(slots=True)
class PickState:
    """What was searched in the popup of a reference that is open."""

    search: str = ""
    found_for: tuple[Any, ...] = ()
    found: list[Any] = field(default_factory=list)
    kept: list[Any] = field(default_factory=list)  # all there are, while the popup is open
    kept_for: tuple[Any, ...] = ()
    offered: dict[str, str] = field(
        default_factory=dict
    )  # references by name: what a file that was dropped has to choose from


@dataclass(slots=True)
class CurveState:
    """The curve that a person was at last."""

    path: str = ""
    chosen: int = -1  # key; -1 for none
    view: CurveView | None = None  # that stays while something is held


@dataclass(slots=True)
class FieldContext:
    """What a widget needs besides the value."""

    ui: Ui
    path: str  # component/field, for ids
    mixed: tuple[bool, ...]  # for each element whether the selected entities differ
    typing: NumberTyping
    picking: PickState
    curves: CurveState
    refuse: Callable[[str], None]  # tells beside the field why what was typed is no value
    angles: Degrees = (0.0, 0.0, 0.0)  # of a rotation, as they stand in its fields
    offer: NameOffer | None = None  # of a text: what is known that it may name

    @property
    def scene(self) -> EditorScene:
        """What the bus last said."""
        return self.ui.model.scene

    def note(self, part: str = "") -> None:
        """Remembers where the last widget is."""
        self.ui.landmarks.note(f"{self.path}/{part}" if part else self.path)


def drag_asset(ui: Ui, asset: DraggedAsset) -> None:
    """Call it after the widget of an asset: lets it be dragged to fields that hold such assets."""
    if imgui.begin_drag_drop_source():
        # A payload of ImGui's is a number here: what it stands for is carried beside it.
        ui.dragged_asset = asset
        imgui.set_drag_drop_payload_py_id(ASSET_PAYLOAD, 0)
        imgui.text_unformatted(asset.name or asset.reference)
        imgui.end_drag_drop_source()


def dropped_asset(ui: Ui, kind: AssetKind | None) -> DraggedAsset | None:
    """The asset that was let go over the last widget, if it is of that kind (None: of any)."""
    dropped = None
    if imgui.begin_drag_drop_target():
        carried = ui.dragged_asset
        fits = carried is not None and (None in (kind, carried.kind) or kind == carried.kind)
        if fits and imgui.accept_drag_drop_payload_py_id(ASSET_PAYLOAD) is not None:
            dropped = carried
        imgui.end_drag_drop_target()
    return dropped


def asset_label(declared: FieldDeclaration, value: str) -> str:
    """What an asset field says: a content reference by what it is and its first digits, else the value itself."""
    reference, options = split_texture(value)
    if not is_reference(reference):
        return value
    what = declared.name if declared.name in ("mesh", "heights", "clips") else "image"
    return f"{tr(what)} {reference.removeprefix(PREFIX)[:8]}{options}"


def inner_spacing() -> float:
    """Between widgets that share a line."""
    return imgui.get_style().item_inner_spacing.x


def element_width(count: int, *, buttons: int = 0) -> float:
    """Of each of `count` widgets that share the rest of the line with square buttons behind them."""
    taken = buttons * (imgui.get_frame_height() + inner_spacing())
    return (imgui.get_content_region_avail().x - taken - inner_spacing() * (count - 1)) / count


def small_button(
    icon: str, name: str, tooltip: str, context: FieldContext, *, enabled: bool = True, only_looks: bool = False
) -> bool:
    """A square button on the same line; one that changes nothing (`only_looks`) can be pressed in a recording too."""
    is_freed = only_looks and context.ui.model.is_replay  # from what disables all fields of a recording
    if is_freed:
        imgui.end_disabled()
    imgui.same_line(0.0, inner_spacing())
    imgui.begin_disabled(not enabled)
    imgui.push_style_var_x(imgui.StyleVar_.frame_padding, 0.0)
    pressed = imgui.button(f"{icon}###{name}", (imgui.get_frame_height(), 0.0))
    imgui.pop_style_var()
    imgui.end_disabled()
    context.note(name)
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(tooltip)
    if is_freed:
        imgui.begin_disabled(True)
    return pressed


def label_item(text: str, *, color: int | None = None, room: float = 0.0) -> None:
    """Writes on the last item: a name may hold anything, and in a label ## would hide what follows.

    `room` is left free at its right [pixels]; the colour is that of texts unless another is given.
    """
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    left = low.x + imgui.get_style().frame_padding.x
    top = low.y + (high.y - low.y - imgui.get_text_line_height()) / 2.0
    draw_list = imgui.get_window_draw_list()
    draw_list.push_clip_rect(low, (high.x - room, high.y), True)
    draw_list.add_text((left, top), imgui.get_color_u32(imgui.Col_.text) if color is None else color, text)
    draw_list.pop_clip_rect()
