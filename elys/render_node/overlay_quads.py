"""Overlays as rectangles to be drawn one over the other: laid out for one view, without OpenGL.

QUAD is what the shader reads of one: where it is, its colour, and by its kind what is in it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.components import OverlayBar, OverlayImage, OverlayPanel, OverlayText, Vec3
from elys.render_node.camera import View
from elys.render_node.glyph_sheet import GlyphSheet
from elys.render_node.overlay_layout import (
    Rectangle,
    bar_filled,
    contained,
    followed,
    kept_inside,
    placed,
    unit_of,
)
from elys.render_node.overlay_text import TextLayout, TextSetter, said, stroke_of
from elys.render_node.overlays import OverlayNode, Overlays

PANEL, GLYPH, IMAGE, RING = 0.0, 1.0, 2.0, 3.0  # kinds, as overlay.frag has them
QUAD_WIDTH: Final = 16  # numbers: x y w h, r g b a (sRGB), 3 of the kind and the kind, clip x0 y0 x1 y1
SHADOW_OPACITY: Final = 0.6
IMAGE_LINES: Final = 1080.0  # of a picture in which an image without a size has its own pixels
MOST_QUADS: Final = 65536
EVERYWHERE: Final = (-1e9, -1e9, 1e9, 1e9)
ImageSize = Callable[[str], tuple[int, int] | None]  # [pixels] of an image that is here; None while it is on its way


class Run(NamedTuple):
    """Quads that are drawn together: they show the same image, or none."""

    first: int
    length: int
    image: str


class Quads(NamedTuple):
    """What is drawn, from the back to the front."""

    rows: NDArray[np.float32]  # (Q, QUAD_WIDTH)
    runs: tuple[Run, ...]


class _Placed(NamedTuple):
    node: OverlayNode
    rectangle: Rectangle
    opacity: float
    layout: TextLayout | None


class _Written(NamedTuple):
    """Letters of a text in one colour, from a row of the quads on."""

    first: int
    cells: list[int]  # rows of the sheet's table
    pen: NDArray[np.float64]  # (L, 2) [pixels]
    numbers: tuple[float, ...]  # x, y of the text [pixels], its magnification, r, g, b, a


class QuadMaker:
    """Lays overlays out. Letters come from its `sheet`."""

    def __init__(self) -> None:
        self.sheet = GlyphSheet()
        self._setter = TextSetter()
        self._rows = np.zeros((1024, QUAD_WIDTH), np.float32)
        self._count = 0
        self._writing: list[_Written] = []

    def quads(self, overlays: Overlays, view: View, image_size: ImageSize) -> Quads:
        """What a picture of this view shows of them."""
        for _ in range(2):  # a sheet that was full is begun anew: then all letters have to be put into it
            generation = self.sheet.generation
            made = self._quads(overlays, view, image_size)
            if self.sheet.generation == generation:
                break
        return made

    def _quads(self, overlays: Overlays, view: View, image_size: ImageSize) -> Quads:
        self._count, self._writing = 0, []
        starts: list[tuple[int, str]] = [(0, "")]  # of runs
        unit = unit_of(view.width, view.height)
        found = self._placed(overlays, view, unit, image_size)
        for one in sorted(found, key=lambda one: one.node.overlay.order):  # of equals the tree's order holds
            if starts[-1][1]:
                starts.append((self._count, ""))
            if one.node.panel is not None:
                self._add_panel(one, one.node.panel, unit)
                one = _inner(one, one.node.panel.padding * unit)
            if one.node.bar is not None:
                self._add_bar(one, one.node.bar, unit)
            if one.node.image is not None and (size := image_size(one.node.image.image)) is not None:
                starts.append((self._count, one.node.image.image))
                self._add_image(one, one.node.image, size)
            if one.node.text is not None and one.layout is not None:
                if starts[-1][1]:
                    starts.append((self._count, ""))
                self._add_text(one, one.node.text, one.layout, unit)
        self._write_letters()
        return Quads(self._rows[: self._count], _runs(starts, self._count))

    def _placed(self, overlays: Overlays, view: View, unit: float, image_size: ImageSize) -> list[_Placed]:
        """All that are visible, with where they are."""
        whole = Rectangle(0.0, 0.0, float(view.width), float(view.height))
        frames: list[tuple[Rectangle, float] | None] = []  # of each, with its opacity; None for what is not shown
        found: list[_Placed] = []
        for node in overlays.nodes:
            overlay = node.overlay
            above = frames[node.parent] if node.parent >= 0 else (whole, 1.0)
            frames.append(None)
            if above is None or not overlay.visible or overlay.player not in (0, overlays.player):
                continue
            frame: Rectangle | None = above[0]
            if overlay.follow:
                x, y, z = overlays.points.get(overlay.follow, (np.nan,) * 3)
                frame = followed(overlay, (x, y + overlay.rise, z), view) if x == x else None
            if frame is None:
                continue
            layout = self._setter.set(said(node.text), node.text.size * unit, node.text.align) if node.text else None
            rectangle = placed(overlay, frame, unit, _needed(node, layout, unit, image_size))
            if overlay.follow and overlay.clamp:
                rectangle = kept_inside(rectangle, view.width, view.height)
            opacity = above[1] * overlay.opacity
            frames[-1] = (rectangle, opacity)
            if opacity > 0.0:
                found.append(_Placed(node, rectangle, opacity, layout))
        return found

    def _room(self, count: int) -> NDArray[np.float32]:
        """The next `count` rows; fewer where there are too many."""
        count = min(count, MOST_QUADS - self._count)
        while self._count + count > len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        rows = self._rows[self._count : self._count + count]
        self._count += count
        return rows

    def _add(
        self,
        rectangle: Rectangle,
        color: Vec3,
        opacity: float,
        kind: float,
        numbers: tuple[float, float, float],
        clip: tuple[float, float, float, float] = EVERYWHERE,
    ) -> None:
        if opacity > 0.0 and rectangle.width > 0.0 and rectangle.height > 0.0:
            for row in self._room(1):
                row[:] = (*rectangle, *to_screen(color), opacity, *numbers, kind, *clip)

    def _add_panel(self, one: _Placed, panel: OverlayPanel, unit: float) -> None:
        radius = _radius(panel.radius * unit, one.rectangle)
        self._add(one.rectangle, panel.color, one.opacity * panel.opacity, PANEL, (radius, 0.0, 0.0))
        if panel.border > 0.0:
            width = max(panel.border * unit, 1.0)
            self._add(one.rectangle, panel.border_color, one.opacity, RING, (radius, width, 0.0))

    def _add_bar(self, one: _Placed, bar: OverlayBar, unit: float) -> None:
        rectangle = one.rectangle
        numbers = (_radius(bar.radius * unit, rectangle), 0.0, 0.0)
        filled = bar_filled(rectangle, bar.value, bar.grows)
        self._add(rectangle, bar.back_color, one.opacity * bar.back_opacity, PANEL, numbers)
        clip = (filled.x, filled.y, filled.x + filled.width, filled.y + filled.height)
        if bar.value > 0.0:
            self._add(rectangle, bar.color, one.opacity, PANEL, numbers, clip)

    def _add_image(self, one: _Placed, image: OverlayImage, size: tuple[int, int]) -> None:
        rectangle = one.rectangle
        if image.fit == "contain" and rectangle.width > 0.0 and rectangle.height > 0.0:
            rectangle = contained(rectangle, *size)
        self._add(rectangle, image.color, one.opacity * image.opacity, IMAGE, (0.0, 0.0, 0.0))

    def _add_text(self, one: _Placed, text: OverlayText, layout: TextLayout, unit: float) -> None:
        rectangle, size = one.rectangle, text.size * unit
        across = {"center": 0.5, "right": 1.0}.get(text.align, 0.0)
        # On whole pixels, or letters would be blurred.
        x = round(rectangle.x + across * (rectangle.width - layout.width))
        y = round(rectangle.y + (rectangle.height - layout.height) / 2)
        stroke = stroke_of(text, layout.size)
        if text.shadow > 0.0:
            away = max(round(text.shadow * size), 1)
            dark = (0.0, 0.0, 0.0)
            self._add_letters(layout, (x + away, y + away), dark, SHADOW_OPACITY * one.opacity, stroke)
        if stroke:
            self._add_letters(layout, (x, y), text.outline_color, one.opacity, stroke)
        self._add_letters(layout, (x, y), text.color, one.opacity, 0)

    def _add_letters(
        self, layout: TextLayout, corner: tuple[int, int], color: Vec3, opacity: float, stroke: int
    ) -> None:
        first = self._count
        count = len(self._room(len(layout.letters)))
        if count:
            letters = layout.letters[:count]
            self._writing.append(
                _Written(
                    first,
                    self.sheet.rows(letters, layout.size, stroke),
                    layout.pen[:count],
                    (*corner, layout.scale, *to_screen(color), opacity),
                )
            )

    def _write_letters(self) -> None:
        """All letters of the picture at once: one by one they would cost ten times as much."""
        writing, self._writing = self._writing, []
        if not writing:
            return
        counts = np.array([len(one.cells) for one in writing])
        starts = np.array([one.first for one in writing]) - np.concatenate([[0], np.cumsum(counts)[:-1]])
        into = np.repeat(starts, counts) + np.arange(counts.sum())
        of = np.repeat(np.array([one.numbers for one in writing], np.float32), counts, axis=0)
        table = self.sheet.table[np.fromiter((cell for one in writing for cell in one.cells), np.intp, len(into))]
        pens = np.floor(np.concatenate([one.pen for one in writing]) + 0.5)
        scale = of[:, 2:3]
        made = np.empty((len(into), QUAD_WIDTH), np.float32)
        made[:, 0:2] = pens + of[:, 0:2] + table[:, 4:6] * scale
        made[:, 2:4] = table[:, 2:4] * scale
        made[:, 4:8] = of[:, 3:7]
        made[:, 8:10], made[:, 10:11], made[:, 11] = table[:, 0:2], 1.0 / scale, GLYPH
        made[:, 12:] = EVERYWHERE
        made[table[:, 2] == 0.0, 7] = 0.0  # nothing is shown of it
        self._rows[into] = made


def _inner(one: _Placed, free: float) -> _Placed:
    """The same without what its panel keeps free [pixels], as far as anything is left."""
    x, y, width, height = one.rectangle
    free = min(free, width / 2, height / 2)
    return one._replace(rectangle=Rectangle(x + free, y + free, width - 2 * free, height - 2 * free))


def _runs(starts: list[tuple[int, str]], end: int) -> tuple[Run, ...]:
    """Those of the runs in which there is anything; neighbours that show the same are one."""
    ends = [*(first for first, _ in starts[1:]), end]
    runs: list[Run] = []
    for (first, image), last in zip(starts, ends, strict=True):
        if last == first:
            continue
        if runs and runs[-1].image == image:
            runs[-1] = Run(runs[-1].first, last - runs[-1].first, image)
        else:
            runs.append(Run(first, last - first, image))
    return tuple(runs)


def _needed(node: OverlayNode, layout: TextLayout | None, unit: float, image_size: ImageSize) -> tuple[float, float]:
    """The size [pixels] that an overlay takes: of a text its lines, of an image its proportions, and what a panel keeps free."""
    width, height = _content_size(node, layout, unit, image_size)
    free = 2.0 * _padding(node, unit) if width or height else 0.0
    return width + free, height + free


def _padding(node: OverlayNode, unit: float) -> float:
    return node.panel.padding * unit if node.panel is not None else 0.0


def _content_size(
    node: OverlayNode, layout: TextLayout | None, unit: float, image_size: ImageSize
) -> tuple[float, float]:
    overlay = node.overlay
    if layout is not None:
        return layout.width, layout.height
    if node.image is not None and (size := image_size(node.image.image)) is not None:
        free = 2.0 * _padding(node, unit)
        if overlay.height > 0.0:
            return max(overlay.height * unit - free, 0.0) * size[0] / size[1], 0.0
        if overlay.width > 0.0:
            return 0.0, max(overlay.width * unit - free, 0.0) * size[1] / size[0]
        return size[0] * unit / IMAGE_LINES, size[1] * unit / IMAGE_LINES
    return 0.0, 0.0


def _radius(radius: float, rectangle: Rectangle) -> float:
    """No rounder than a circle."""
    return min(radius, rectangle.width / 2, rectangle.height / 2)


@lru_cache(maxsize=256)
def to_screen(color: Vec3) -> tuple[float, float, float]:
    """Linear colour as the screen has it. IEC 61966-2-1."""
    red, green, blue = (12.92 * c if c <= 0.0031308 else 1.055 * min(c, 1.0) ** (1 / 2.4) - 0.055 for c in color)
    return red, green, blue
