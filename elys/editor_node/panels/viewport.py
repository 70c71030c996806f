"""A viewport: the newest picture a render node sent, and over it what belongs to the editor alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.camera import OrbitCamera
from elys.editor_node.gpu import ViewportPicture
from elys.editor_node.language import tr, tr_title
from elys.editor_node.panels.gizmo import Gizmo
from elys.editor_node.panels.view_cube import ViewCube
from elys.editor_node.theme import FILL, GOOD, NOTICE, PANEL_LOW, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, color_code
from elys.editor_node.view_look import ViewLook
from elys.editor_node.view_stream import View, ViewStream

TITLE: Final = f"{icons.ICON_FA_EXPAND}  Viewport###Viewport"


class ViewportPanel:
    """Asks for pictures of its own size and shows them with the camera they were stamped with."""

    def __init__(self, stream: ViewStream, picture: ViewportPicture, camera: OrbitCamera, *, number: int = 1) -> None:
        self.number = number
        self.name = "Viewport" if number == 1 else f"Viewport{number}"  # of its window
        self.stream = stream
        self.picture = picture
        self.camera = camera
        self.look = ViewLook()
        self.gizmo = Gizmo(number)
        self.cube = ViewCube()
        self.rectangle = (0.0, 0.0, 1.0, 1.0)  # x, y, width, height of the picture in the window
        self.is_hovered = False
        self.selection_box: tuple[float, float, float, float] | None = None  # being dragged: two corners in the window
        self.hand_line: tuple[float, float, float, float] | None = (
            None  # of a body being dragged: held point and target
        )
        self.held = 0  # the body being dragged
        self.is_seen = False  # in the last frame
        self.was_focused = False  # its window got the keyboard in the last frame
        self.is_marked = False  # as the one of several that keys mean
        self.is_played = False  # keys and mouse go to the game
        self.wants_close = False  # the cross of its tab was pressed
        self._has_focus = False

    @property
    def takes_mouse(self) -> bool:
        """Whether what the pointer does belongs to the scene and not to a widget."""
        return self.is_hovered and not self.gizmo.is_over and not self.gizmo.is_used

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.rectangle[2] / max(self.rectangle[3], 1.0)

    @property
    def title(self) -> str:
        """Its window's, in the chosen language."""
        if self.number == 1:
            return tr_title(TITLE)
        return f"{icons.ICON_FA_EXPAND}  {tr('Viewport')} {self.number}###{self.name}"

    def rest(self) -> None:
        """It is not seen: no pictures are asked for."""
        self.stream.rest()
        self.is_seen = self.is_hovered = self.was_focused = self._has_focus = False

    def landmark(self, part: str) -> str:
        """What a part of it is called by those who point at it: "viewport/picture", "viewport2/picture"."""
        return f"{self.name.lower()}/{part}"

    def draw(self, ui: Ui, *, may_close: bool, take_drop: Callable[[Ui, ViewportPanel], None]) -> None:
        """Draws the panel, with a cross on its tab where it may be closed; `take_drop` takes what is let go over the picture."""
        self.stream.upload(self.picture)
        imgui.push_style_var(imgui.StyleVar_.window_padding, (0.0, 0.0))
        flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse | imgui.WindowFlags_.no_nav
        flags |= imgui.WindowFlags_.no_background
        is_visible, is_open = imgui.begin(self.title, True if may_close else None, flags.value)
        imgui.pop_style_var()
        self.wants_close = is_open is False
        if may_close and ui.landmarks.is_wanted:
            tab = imgui.internal.get_current_window().dc.dock_tab_item_rect
            edge = tab.max.y - tab.min.y  # of the square that holds the cross
            ui.landmarks.rectangles[self.landmark("close")] = (tab.max.x - edge, tab.min.y, tab.max.x, tab.max.y)
        had_focus, self._has_focus = self._has_focus, imgui.is_window_focused()
        self.was_focused = self._has_focus and not had_focus
        self.is_hovered, self.is_seen = False, is_visible
        if is_visible:
            self._draw_picture(ui)
            take_drop(ui, self)
            self._draw_over(ui)
        else:
            self.stream.rest()
        imgui.end()

    def _draw_picture(self, ui: Ui) -> None:
        low, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        self.rectangle = (low.x, low.y, max(size.x, 1.0), max(size.y, 1.0))
        scale = imgui.get_io().display_framebuffer_scale
        width, height = int(self.rectangle[2] * scale.x), int(self.rectangle[3] * scale.y)
        selection = ui.model.selection.entities
        hidden = ui.model.scene.marks.own("hidden")
        kinds, whose = self.look.lines(selection, self.held)
        self.stream.want(
            View(
                self.camera.view,
                width,
                height,
                selection,
                hidden,
                self.look.shows_grid,
                self.look.shows,
                debug=kinds,
                debug_entities=whose,
            )
        )
        draw_list = imgui.get_window_draw_list()
        high = (low.x + self.rectangle[2], low.y + self.rectangle[3])
        if self.stream.shown is None or not self.picture.name:
            draw_list.add_rect_filled(low, high, color_code(PANEL_LOW))
        else:
            # Rows run upwards in GL.
            draw_list.add_image(imgui.ImTextureRef(self.picture.name), low, high, (0.0, 1.0), (1.0, 0.0))
        # No widget that could be hovered: ImGuizmo takes hold of its handles only where there is none.
        imgui.dummy((self.rectangle[2], self.rectangle[3]))
        self.is_hovered = imgui.is_window_hovered() and imgui.is_item_hovered()
        ui.landmarks.note(self.landmark("picture"))

    def _draw_over(self, ui: Ui) -> None:
        shown = self.stream.shown
        if shown is not None:
            imgui.push_clip_rect(
                self.rectangle[:2],
                (self.rectangle[0] + self.rectangle[2], self.rectangle[1] + self.rectangle[3]),
                True,
            )
            if not self.is_played:  # what belongs to the editor would only stand in the way
                self.gizmo.draw(ui, shown.camera, self.rectangle)
                self.cube.draw(ui, shown.camera, self.rectangle, self.landmark("cube"))
            if self.hand_line is not None:
                _draw_hand_line(self.hand_line)
            if self.selection_box is not None:
                _draw_selection_box(self.selection_box)
            imgui.pop_clip_rect()
        if self.is_marked or self.is_played:
            x, y, width, height = self.rectangle
            edge_color, thickness = (color_code(GOOD), 3.0) if self.is_played else (color_code((*FILL[:3], 0.8)), 1.0)
            edge = (x + 1.0, y + 1.0), (x + width - 1.0, y + height - 1.0)
            imgui.get_window_draw_list().add_rect(*edge, edge_color, thickness=thickness)
        text, color = self._notice(ui)
        if text:
            self._draw_notice(text, color, in_middle=shown is None)

    def _notice(self, ui: Ui) -> tuple[str, Rgba]:
        if not ui.model.connected:
            return "", TEXT  # a banner says it: see `link.py`
        if self.stream.renderer is None:
            lost = self.stream.lost_renderer
            text = tr("renderer lost - waiting for another") if lost else tr("waiting for a render node")
            return f"{icons.ICON_FA_HOURGLASS_HALF}  {text}", WARNING
        if self.stream.shown is None:
            return f"{icons.ICON_FA_HOURGLASS_HALF}  {tr('waiting for the first picture')}", TEXT_DIM
        if self.is_played:
            text = tr(
                "keys, mouse and gamepads play the game; {keys} gives them back", keys=ui.keys.label_of("game.leave")
            )
            return f"{icons.ICON_FA_GAMEPAD}  {text}", GOOD
        if ui.model.is_replay:
            return f"{icons.ICON_FA_FILM}  {tr('this is a recording: it cannot be edited')}", TEXT_DIM
        return "", TEXT

    def _draw_notice(self, text: str, color: Rgba, *, in_middle: bool) -> None:
        x, y, width, height = self.rectangle
        size = imgui.calc_text_size(text)
        left = x + (width - size.x) / 2.0
        top = y + (height - size.y) / 2.0 if in_middle else y + 16.0
        draw_list = imgui.get_window_draw_list()
        low, high = (left - 16.0, top - 8.0), (left + size.x + 16.0, top + size.y + 8.0)
        draw_list.add_rect_filled(low, high, color_code(NOTICE), 6.0)
        draw_list.add_rect(low, high, color_code((*color[:3], 0.6)), 6.0)
        draw_list.add_text((left, top), color_code(color), text)


def _draw_hand_line(line: tuple[float, float, float, float]) -> None:
    """A line from a ring around the held point to a dot where it is pulled."""
    draw_list, color = imgui.get_window_draw_list(), color_code(WARNING)
    draw_list.add_line(line[:2], line[2:], color, 2.0)
    draw_list.add_circle(line[:2], 6.0, color, thickness=2.0)
    draw_list.add_circle_filled(line[2:], 4.0, color)


def _draw_selection_box(box: tuple[float, float, float, float]) -> None:
    low, high = (min(box[0], box[2]), min(box[1], box[3])), (max(box[0], box[2]), max(box[1], box[3]))
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(low, high, color_code((*FILL[:3], 0.18)))
    draw_list.add_rect(low, high, color_code(FILL))
