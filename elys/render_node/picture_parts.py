"""Large pictures in parts: which pixels each part draws, so that effects that look at neighbouring pixels show no seam.

|<-- kept -->|<-- kept -->|<-- kept -->|      every pixel once
|<---- drawn ---->|                           all of one size, as memory of the card is kept by size
       |<---- drawn ---->|                    and `reach` pixels beyond what is kept, but for the picture's own edges
                  |<---- drawn ---->|
"""

from __future__ import annotations

from typing import Final, NamedTuple

from elys.common.scene import PictureSettings
from elys.render_node.camera import Region
from elys.render_node.passes.bloom import BLOOM_REACH
from elys.render_node.passes.finishing import FXAA_REACH
from elys.render_node.passes.occlusion import OCCLUSION_REACH

# Parts begin at multiples of so many pixels, from the lower left: pixels are shaded in blocks of two by two, and ambient
# occlusion has patterns of four by four.
STEP: Final = 4


class Part(NamedTuple):
    """A part of a picture; regions count from the upper left [pixels]."""

    drawn: Region
    kept: Region

    @property
    def kept_rows(self) -> slice:
        """Where what is kept stands in what is drawn."""
        start = self.kept[1] - self.drawn[1]
        return slice(start, start + self.kept[3])

    @property
    def kept_columns(self) -> slice:
        """The same of columns."""
        start = self.kept[0] - self.drawn[0]
        return slice(start, start + self.kept[2])


def reach_of(picture: PictureSettings) -> int:
    """How far from a pixel its picture looks at most, at others of the picture [pixels]."""
    reaches = (
        OCCLUSION_REACH if picture.ambient_occlusion > 0.0 else 0,
        BLOOM_REACH if picture.bloom > 0.0 else 0,
        FXAA_REACH if picture.fxaa else 0,
    )
    return sum(reaches)  # one sees what the one before it has seen


def parts_of(width: int, height: int, *, edge: int, reach: int) -> tuple[Part, ...]:
    """Parts of a picture with edges of at most `edge` pixels, which have `reach` pixels more around what is kept of them."""
    columns = _spans(width, edge, reach)
    rows = _spans(height, edge, reach)
    return tuple(
        Part(
            (x, height - y - drawn_height, drawn_width, drawn_height),
            (kept_x, height - kept_y - kept_height, kept_width, kept_height),
        )
        for (y, drawn_height, kept_y, kept_height) in reversed(rows)
        for (x, drawn_width, kept_x, kept_width) in columns
    )


def _spans(length: int, edge: int, reach: int) -> list[tuple[int, int, int, int]]:
    """Along one axis from the left or from below: first pixel and length of what is drawn, and of what is kept."""
    if length <= edge:
        return [(0, length, 0, length)]
    # So that the last part, which ends with the picture, begins at a multiple of STEP as well.
    drawn = edge - (edge - length) % STEP
    step = drawn - 2 * reach - STEP
    if step < STEP:
        raise ValueError(f"parts of {edge} pixels have no room for {reach} more on each side")
    spans = []
    for first in range(0, length, step):
        start = min(max(first - reach, 0) // STEP * STEP, length - drawn)
        spans.append((start, drawn, first, min(step, length - first)))
    return spans
