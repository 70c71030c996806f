"""The cube in the viewport's corner: shows how the world lies, and takes the camera to the side that is clicked."""

from __future__ import annotations

from typing import Final

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.editor_node import cube_faces
from elys.editor_node.cube_faces import Direction
from elys.editor_node.language import tr
from elys.editor_node.theme import AXES, BUTTON, FILL, LINE, TEXT
from elys.editor_node.ui import Ui, color_code

_SIZE: Final = 104.0  # [pixels] of its square
_MARGIN: Final = 18.0  # [pixels] to the picture's edge
_AXIS_LENGTH: Final = 2.35  # half edges of the cube
_AXIS_NAMES: Final = ("X", "Y", "Z")


class ViewCube:
    """Drawn over the picture; the layer of the viewport hears of the clicks."""

    def __init__(self) -> None:
        self.is_hovered = False
        self.pointed_at: Direction | None = None  # the side, edge or corner under the pointer
        self._middle = (0.0, 0.0)

    def draw(self, ui: Ui, camera: ViewCamera, rectangle: tuple[float, float, float, float], name: str) -> None:
        """Draws it, as the landmark `name`, into the upper right corner of the picture at `rectangle` (x, y, width, height)."""
        x, y, width, _ = rectangle
        half = _SIZE / 2.0
        self._middle = (x + width - _MARGIN - half, y + _MARGIN + half)
        pointer = imgui.get_mouse_pos()
        at = ((pointer.x - self._middle[0]) / half, (self._middle[1] - pointer.y) / half)
        self.pointed_at = cube_faces.part_at(camera.rotation, at) if imgui.is_window_hovered() else None
        self.is_hovered = self.pointed_at is not None
        is_near = cube_faces.axes_along(camera.rotation, _AXIS_LENGTH)[0, 0, 2] > 0.0
        if not is_near:
            self._draw_axes(camera)
        draw_list = imgui.get_window_draw_list()
        for normal, corners in cube_faces.seen_faces(camera.rotation):
            points = self._points(corners)
            draw_list.add_convex_poly_filled(points, color_code((*BUTTON[:3], 0.85)))
            if self.pointed_at is not None:
                part = cube_faces.part_corners(camera.rotation, self.pointed_at, normal)
                if part is not None:
                    draw_list.add_convex_poly_filled(self._points(part), color_code((*FILL[:3], 0.8)))
            draw_list.add_polyline(points, color_code(LINE), 1.5, imgui.ImDrawFlags_.closed.value)
            self._draw_name(ui, tr(cube_faces.NAMES[normal]), normal, corners)
        if is_near:
            self._draw_axes(camera)
        if ui.landmarks.is_wanted:
            left, top = self._middle[0] - half, self._middle[1] - half
            ui.landmarks.rectangles[name] = (left, top, left + _SIZE, top + _SIZE)

    def _points(self, corners: NDArray[np.float64]) -> list[imgui.ImVec2Like]:
        """On the screen, clockwise as ImGui smooths edges."""
        half = _SIZE / 2.0
        points: list[imgui.ImVec2Like] = [
            (self._middle[0] + half * u, self._middle[1] - half * v) for u, v in corners.tolist()
        ]
        (a, b), (c, d) = corners[1] - corners[0], corners[2] - corners[1]
        return points if a * d < b * c else points[::-1]

    def _draw_name(self, ui: Ui, name: str, normal: Direction, corners: NDArray[np.float64]) -> None:
        """Where the face is turned to the eye enough for a word."""
        first, second = corners[1] - corners[0], corners[3] - corners[0]
        shown = abs(float(first[0] * second[1] - first[1] * second[0])) / (2.0 * cube_faces.HALF) ** 2
        if shown < 0.35:
            return
        u, v = corners.mean(axis=0) * (_SIZE / 2.0)
        size = imgui.get_font_size() * 0.8
        imgui.push_font(ui.fonts.regular, size)
        extent = imgui.calc_text_size(name)
        imgui.pop_font()
        place = (self._middle[0] + u - extent.x / 2.0, self._middle[1] - v - extent.y / 2.0)
        color = color_code((*TEXT[:3], min(1.0, 2.0 * shown)))
        imgui.get_window_draw_list().add_text(ui.fonts.regular, size, place, color, name)

    def _draw_axes(self, camera: ViewCamera) -> None:
        """Along the cube's edges, from its corner of lowest x, y and z."""
        draw_list = imgui.get_window_draw_list()
        for axis, ends in enumerate(cube_faces.axes_along(camera.rotation, _AXIS_LENGTH)):
            (u, v), (s, t) = (ends[:, :2] * (_SIZE / 2.0)).tolist()
            color = color_code(AXES[axis])
            start = (self._middle[0] + u, self._middle[1] - v)
            end = (self._middle[0] + s, self._middle[1] - t)
            draw_list.add_line(start, end, color, 2.0)
            size = imgui.calc_text_size(_AXIS_NAMES[axis])
            draw_list.add_text((end[0] - size.x / 2.0, end[1] - size.y / 2.0), color, _AXIS_NAMES[axis])
