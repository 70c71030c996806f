"""Debug drawing on the card: lines among the scene's things, and letters over the finished picture."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.camera import Region, View
from elys.render_node.gpu import TEXTURE_UNITS, Framebuffer, Texture
from elys.render_node.lettering import (
    EDGE_OPACITY,
    LABEL_GAP,
    Quads,
    Sheet,
    free_places,
    note_texts,
    sheet_for,
)
from elys.render_node.marks import LETTERS, Label, Lines
from elys.render_node.passes.strips import Strips
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.quality import Quality
from elys.render_node.resources import Resources

MOST_LABELS: Final = 400  # in one picture, the nearest
LIFT: Final = (-1.0, -6.0)  # lifts lines off the surfaces on which they lie


class LinePass:
    """Segments some pixels wide; where something stands before them they are seen through it, as faint as they want."""

    def __init__(self, resources: Resources, quality: Quality) -> None:
        self._resources = resources
        self._quality = quality
        self._strips = Strips(resources)

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether there are lines."""
        return len(plan.marks.lines) > 0

    def draw(self, plan: PicturePlan, target: Framebuffer) -> None:
        """Draws all of them faintly, and those that nothing hides in full."""
        context, lines = self._resources.context, plan.marks.lines
        self._strips.write(_line_texels(lines, plan.view.eye))
        target.use(depth_write=False)
        to_screen = ("TO_SCREEN",) if self._quality.writes_screen(plan.picture) else ()
        context.set_state(blend="over")
        self._strips.draw(("mark_lines.vert", "mark_lines.frag", (*to_screen, "HIDDEN")), len(lines))
        context.set_state(depth_test="less_equal", blend="over", polygon_offset=LIFT)
        self._strips.draw(("mark_lines.vert", "mark_lines.frag", to_screen), len(lines))


class LetterPass:
    """Labels and notes, after everything else, each letter on whole pixels. Nearer labels push out those that they overlap."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._strips = Strips(resources)
        self._sheets: dict[int, tuple[Texture, int]] = {}  # by font size: on the card, as of a version

    @staticmethod
    def is_needed(plan: PicturePlan) -> bool:
        """Whether there is anything to read."""
        return bool(plan.marks.labels or plan.marks.notes)

    def draw(self, plan: PicturePlan, whole: View, region: Region | None, target: Framebuffer) -> None:
        """Writes on `target`, which is the picture of the view `whole` or a region of it."""
        sheet = sheet_for(whole.height)
        texts = placed_labels(plan.marks.labels, whole, sheet)
        texts += note_texts(sheet, plan.marks.notes, LETTERS)
        quads = sheet.quads(texts)
        if not len(quads.place):
            return
        offset = np.zeros(2, np.float32) if region is None else np.array(region[:2], np.float32)
        self._strips.write(_letter_texels(quads, offset))
        self._show(sheet)
        target.use(depth_write=False)
        self._resources.context.set_state(blend="over")
        program = self._strips.program(("letters.vert", "letters.frag", ()))
        program.set("picture_size", (float(target.width), float(target.height)))
        program.set("cell", tuple(map(float, sheet.cell)))
        for opacity in ((0.0, EDGE_OPACITY), (1.0, 0.0)):  # all edges first: none lies over a letter beside it
            program.set("opacity", opacity)
            self._strips.draw(("letters.vert", "letters.frag", ()), len(quads.place))

    def _show(self, sheet: Sheet) -> None:
        texture, version = self._sheets.get(sheet.size, (None, -1))
        if texture is None:
            size = (sheet.texels.shape[1], sheet.texels.shape[0])
            texture = Texture(self._resources.context, size, "rgba8", data=sheet.texels, smooth=False)
        elif version != sheet.version:
            texture.write(sheet.texels)
        self._sheets[sheet.size] = (texture, sheet.version)
        texture.use(TEXTURE_UNITS["letter_sheet"])


def placed_labels(
    labels: tuple[Label, ...], view: View, sheet: Sheet
) -> list[tuple[str, float, float, tuple[int, int, int]]]:
    """Where labels stand in the picture of a view [pixels]: those before the eye, none over another, nearer ones first."""
    if not labels:
        return []
    relative = np.array([label.position for label in labels]) - view.eye
    clip = relative @ view.clip_from_relative[:, :3].T + view.clip_from_relative[:, 3]
    seen = np.flatnonzero((clip[:, 3] > 0.0) & (np.abs(clip[:, 2]) <= clip[:, 3]))
    depth = clip[seen, 2] / clip[seen, 3]
    seen = seen[np.argsort(depth, kind="stable")][:MOST_LABELS]
    middle = (clip[seen, :2] / clip[seen, 3:] * (0.5, -0.5) + 0.5) * (view.width, view.height)
    widths = np.array([sheet.width(labels[row].text) for row in seen.tolist()]).reshape(-1)
    corner = middle - np.stack([widths / 2, np.full(len(seen), sheet.line_height + LABEL_GAP)], axis=1)
    is_inside = (corner < (view.width, view.height)).all(axis=1) & (
        corner > -2 * sheet.line_height - widths[:, None]
    ).all(axis=1)
    gaps = np.full((len(seen), 2), 2.0 * LABEL_GAP)
    sizes = np.stack([widths, np.full(len(seen), sheet.line_height)], axis=1) + gaps
    inside = np.flatnonzero(is_inside)
    free = inside[free_places(np.concatenate([corner, sizes], axis=1)[inside])]
    chosen = [(labels[int(seen[place])], corner[place]) for place in free.tolist()]
    return [(label.text, float(x), float(y), label.color) for label, (x, y) in chosen]


def _line_texels(lines: Lines, eye: NDArray[np.float64]) -> NDArray[np.float32]:
    texels = np.empty((len(lines), 3, 4), np.float32)
    texels[:, :2, :3] = lines.ends - eye
    texels[:, 0, 3], texels[:, 1, 3] = lines.width, lines.hidden
    texels[:, 2, :3], texels[:, 2, 3] = lines.color / np.float32(255.0), 1.0
    return texels.reshape(-1, 4)


def _letter_texels(quads: Quads, offset: NDArray[np.float32]) -> NDArray[np.float32]:
    texels = np.ones((len(quads.place), 2, 4), np.float32)
    texels[:, 0, :2], texels[:, 0, 2:] = quads.place - offset, quads.texel
    texels[:, 1, :3] = quads.color
    return texels.reshape(-1, 4)
