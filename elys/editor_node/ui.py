"""What all panels share: the model, the fonts, the tool in hand, and where widgets came to stand on the screen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from imgui_bundle import imgui

from elys.editor_node.actions import Actions
from elys.editor_node.asset_folder import AssetFile
from elys.editor_node.attachments import Attachments
from elys.editor_node.fields import DraggedAsset
from elys.editor_node.key_bindings import KeyBindings
from elys.editor_node.language import tr
from elys.editor_node.link_meter import LinkMeter
from elys.editor_node.model import EditorModel
from elys.editor_node.preferences import Preferences
from elys.editor_node.theme import FILL, TEXT_DIM, Fonts, Rgba
from elys.editor_node.watching import Watches

Tool = Literal["select", "move", "rotate", "scale", "grab"]
Pivot = Literal["active", "median"]  # the entity selected last, or amid all
Rectangle = tuple[float, float, float, float]  # left, top, right, bottom [points]


@dataclass(slots=True)
class Tools:
    """What the pointer does in the viewports."""

    tool: Tool = "move"
    is_local: bool = False  # along the entity's own axes instead of the world's
    pivot: Pivot = "active"  # about which several entities are turned and scaled
    snaps: bool = False  # without Ctrl, which turns it about
    move_snap: float = 0.25  # [m]
    rotate_snap: float = 15.0  # [degrees]
    scale_snap: float = 0.1


@dataclass(slots=True)
class Landmarks:
    """Rectangles (left, top, right, bottom) of widgets by name, as of the last frame that drew them.

    They let a program find what a person sees: tests click there, tutorials point there.
    """

    is_wanted: bool = False
    pointed_at: frozenset[str] = frozenset()  # noted all the same: what the tour points at
    rectangles: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)

    def note(self, name: str) -> None:
        """Remembers where the last widget is."""
        if self.is_wanted or name in self.pointed_at:
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            self.rectangles[name] = (low.x, low.y, high.x, high.y)

    def center(self, name: str) -> tuple[float, float]:
        """The middle of a widget; KeyError if it was never drawn."""
        left, top, right, bottom = self.rectangles[name]
        return (left + right) / 2.0, (top + bottom) / 2.0


@dataclass(slots=True)
class Ui:
    """Handed to every panel's `draw`."""

    model: EditorModel
    fonts: Fonts
    actions: Actions
    keys: KeyBindings
    preferences: Preferences
    attachments: Attachments
    meter: LinkMeter
    tools: Tools = field(default_factory=Tools)
    landmarks: Landmarks = field(default_factory=Landmarks)
    watches: Watches = field(default_factory=Watches)
    dragged_asset: DraggedAsset | None = None  # what a payload of kind ASSET_PAYLOAD stands for
    focus: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] what the camera of the viewport used last looks at
    place_file: Callable[[AssetFile], None] = lambda file: (
        None
    )  # puts what it holds into the scene, where the view looks
    plot_field: Callable[[int, str, str], None] = lambda entity, component, field: None
    take_picture: Callable[[Path, Rectangle], None] = lambda path, rectangle: (
        None
    )  # of a part of the window, once it is drawn


def color_code(color: Rgba) -> int:
    """As draw lists take it."""
    return int(imgui.get_color_u32(imgui.ImVec4(*color)))


def icon_button(
    icon: str, name: str, tooltip: str, *, active: bool = False, enabled: bool = True, color: Rgba | None = None
) -> bool:
    """A flat square button with an icon; True when it is pressed."""
    height = imgui.get_frame_height()
    imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*FILL[:3], 0.30 if active else 0.0))
    if color is not None:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color))
    imgui.push_style_var_x(imgui.StyleVar_.frame_padding, 0.0)
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(f"{icon}###{name}", (height * 1.15, height))
    imgui.end_disabled()
    imgui.pop_style_var()
    imgui.pop_style_color(2 if color is not None else 1)
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(tooltip)
    return pressed


def action_item(ui: Ui, name: str, label: str = "") -> None:
    """A line of a menu that does an action: with its keys, a check mark if it is a switch, grey where it is impossible.

    `label` stands in for the action's own where there is more to say; it is shown as it is.
    """
    action = ui.actions[name]
    is_on = action.is_on() if action.is_on is not None else False
    text = f"{label or tr(action.label)}###{name}"
    if imgui.menu_item(text, ui.keys.label_of(name), is_on, ui.actions.may_run(name))[0]:
        action.run()
    ui.landmarks.note(f"menu/{name}")


def colored_text(color: Rgba, text: str) -> None:
    """Text that says by its colour what kind of thing it is."""
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color))
    imgui.text_unformatted(text)
    imgui.pop_style_color()


def dim_text(text: str) -> None:
    """Less important text."""
    colored_text(TEXT_DIM, text)


def with_keys(ui: Ui, text: str, name: str) -> str:
    """A tooltip, with the keys that do the same."""
    keys = ui.keys.label_of(name)
    return f"{text} ({keys})" if keys else text


def centered_text(text: str, width: float) -> None:
    """Wrapped text in the middle of what is left of the line."""
    size = imgui.calc_text_size(text, wrap_width=width)
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(0.0, (width - size.x) / 2.0))
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + size.x + 1.0)
    dim_text(text)
    imgui.pop_text_wrap_pos()
