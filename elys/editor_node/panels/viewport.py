"""The viewport: the newest picture a render node sent, and over it what belongs to the editor alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.camera import OrbitCamera
from elys.editor_node.gpu import ViewportPicture
from elys.editor_node.language import tr, tr_title
from elys.editor_node.panels.gizmo import Gizmo
from elys.editor_node.panels.view_cube import ViewCube
from elys.editor_node.theme import FILL, NOTICE, PANEL_LOW, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, color_code
from elys.editor_node.view_stream import View, ViewStream

TITLE: Final = f"{icons.ICON_FA_EXPAND}  Viewport###Viewport"


class ViewportPanel:
    """Asks for pictures of its own size and shows them with the camera they were stamped with."""

    def __init__(self, stream: ViewStream, picture: ViewportPicture, camera: OrbitCamera) -> None:
        self.stream = stream
        self.camera = camera
        self.gizmo = Gizmo()
        self.cube = ViewCube()
        self.look_from: Callable[[tuple[float, float, float]], None] = lambda direction: None  # what the cube was asked
        self.rectangle = (0.0, 0.0, 1.0, 1.0)  # x, y, width, height of the picture in the window
        self.is_hovered = False
        self.selection_box: tuple[float, float, float, float] | None = None  # being dragged: two corners in the window
        self.take_drop: Callable[[Ui], None] = lambda ui: None  # takes what is let go over the picture
        self._picture = picture

    @property
    def takes_mouse(self) -> bool:
        """Whether what the pointer does belongs to the scene and not to a widget."""
        return self.is_hovered and not self.gizmo.is_over and not self.gizmo.is_used

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.rectangle[2] / max(self.rectangle[3], 1.0)

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        self.stream.upload(self._picture)
        x, y, z = self.camera.target.tolist()
        ui.focus = (x, y, z)
        imgui.push_style_var(imgui.StyleVar_.window_padding, (0.0, 0.0))
        flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse | imgui.WindowFlags_.no_nav
        flags |= imgui.WindowFlags_.no_background
        is_visible = imgui.begin(tr_title(TITLE), None, flags.value)[0]
        imgui.pop_style_var()
        self.is_hovered = False
        if is_visible:
            self._draw_picture(ui)
            self._draw_over(ui)
        imgui.end()

    def _draw_picture(self, ui: Ui) -> None:
        low, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        self.rectangle = (low.x, low.y, max(size.x, 1.0), max(size.y, 1.0))
        scale = imgui.get_io().display_framebuffer_scale
        width, height = int(self.rectangle[2] * scale.x), int(self.rectangle[3] * scale.y)
        selection = ui.model.selection.entities
        hidden = ui.model.scene.marks.own("hidden")
        self.stream.want(
            View(
                self.camera.view,
                width,
                height,
                selection,
                hidden,
                ui.tools.shows_grid,
                ui.tools.shows,
                # Of a selection of nothing nothing is drawn, and not everything.
                debug=ui.tools.debug if selection or not ui.tools.debugs_selection else (),
                debug_entities=selection if ui.tools.debugs_selection else (),
            )
        )
        draw_list = imgui.get_window_draw_list()
        high = (low.x + self.rectangle[2], low.y + self.rectangle[3])
        if self.stream.shown is None or not self._picture.name:
            draw_list.add_rect_filled(low, high, color_code(PANEL_LOW))
        else:
            # Rows run upwards in GL.
            draw_list.add_image(imgui.ImTextureRef(self._picture.name), low, high, (0.0, 1.0), (1.0, 0.0))
        # No widget that could be hovered: ImGuizmo takes hold of its handles only where there is none.
        imgui.dummy((self.rectangle[2], self.rectangle[3]))
        self.is_hovered = imgui.is_window_hovered() and imgui.is_item_hovered()
        ui.landmarks.note("viewport/picture")
        self.take_drop(ui)

    def _draw_over(self, ui: Ui) -> None:
        shown = self.stream.shown
        if shown is not None:
            imgui.push_clip_rect(
                self.rectangle[:2],
                (self.rectangle[0] + self.rectangle[2], self.rectangle[1] + self.rectangle[3]),
                True,
            )
            self.gizmo.draw(ui, shown.camera, self.rectangle)
            self.cube.draw(ui, shown.camera, self.rectangle)
            if self.selection_box is not None:
                _draw_selection_box(self.selection_box)
            imgui.pop_clip_rect()
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


def _draw_selection_box(box: tuple[float, float, float, float]) -> None:
    low, high = (min(box[0], box[2]), min(box[1], box[3])), (max(box[0], box[2]), max(box[1], box[3]))
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(low, high, color_code((*FILL[:3], 0.18)))
    draw_list.add_rect(low, high, color_code(FILL))
