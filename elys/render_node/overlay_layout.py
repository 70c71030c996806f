"""Where overlays stand: rectangles in rectangles, by plain arithmetic in pixels, y down from the picture's upper left corner."""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np

from elys.common.components.overlay import Anchor, Overlay
from elys.render_node.camera import View

SHAPE: Final = 16 / 9  # of the pictures for which lengths are meant
_ACROSS: Final = {"left": 0.0, "right": 1.0}
_DOWN: Final = {"top": 0.0, "bottom": 1.0}
_BEHIND: Final = 1e-6  # [m] before the eye, nearer than which nothing has a place in the picture


class Rectangle(NamedTuple):
    """x, y of the upper left corner, width and height [pixels]."""

    x: float
    y: float
    width: float
    height: float


def unit_of(width: int, height: int) -> float:
    """What a length of 1 is in a picture [pixels]: the height of the largest 16:9 picture in it."""
    return min(float(height), width / SHAPE)


@cache
def share_of(anchor: Anchor) -> tuple[float, float]:
    """Where an anchor is in a rectangle: 0, 0.5 or 1 to the right and down."""
    words = anchor.split("_")
    across = next((_ACROSS[word] for word in words if word in _ACROSS), 0.5)
    down = next((_DOWN[word] for word in words if word in _DOWN), 0.5)
    return across, down


def placed(overlay: Overlay, frame: Rectangle, unit: float, needed: tuple[float, float]) -> Rectangle:
    """Where an overlay is in `frame`; `needed` is the size [pixels] that its content takes, where it says none itself."""
    width = overlay.width * unit if overlay.width > 0.0 else needed[0]
    height = overlay.height * unit if overlay.height > 0.0 else needed[1]
    across, down = share_of(overlay.anchor)
    return Rectangle(
        frame.x + across * (frame.width - width) + overlay.x * unit,
        frame.y + down * (frame.height - height) + overlay.y * unit,
        width,
        height,
    )


def followed(overlay: Overlay, point: tuple[float, float, float], view: View) -> Rectangle | None:
    """The place of the picture, a rectangle without size, at which a point of the world is seen; None where it is not, or, with
    `clamp`, the nearest one on the picture's edge.
    """
    relative = np.array(point) - view.eye
    clip = view.clip_from_relative[:, :3] @ relative + view.clip_from_relative[:, 3]
    depth = float(clip[3])
    is_before = depth > _BEHIND
    x, y = float(clip[0]), -float(clip[1])
    if is_before:
        x, y = x / depth, y / depth
    is_seen = is_before and abs(x) <= 1.0 and abs(y) <= 1.0 and abs(float(clip[2])) <= depth
    if not is_seen:
        if not overlay.clamp:
            return None
        if not is_before and abs(x) < _BEHIND and abs(y) < _BEHIND:
            y = 1.0  # right behind: below
        reach = max(abs(x), abs(y))
        if reach > 1.0 or not is_before:
            x, y = x / reach, y / reach
    return Rectangle((x + 1.0) / 2 * view.width, (y + 1.0) / 2 * view.height, 0.0, 0.0)


def kept_inside(rectangle: Rectangle, width: float, height: float) -> Rectangle:
    """The same, moved into the picture as far as it fits."""
    x = max(min(rectangle.x, width - rectangle.width), 0.0)
    y = max(min(rectangle.y, height - rectangle.height), 0.0)
    return rectangle._replace(x=x, y=y)


def bar_filled(rectangle: Rectangle, value: float, grows: str) -> Rectangle:
    """The part of a bar that is filled."""
    x, y, width, height = rectangle
    share = min(max(value, 0.0), 1.0)
    match grows:
        case "left":
            return Rectangle(x + (1.0 - share) * width, y, share * width, height)
        case "down":
            return Rectangle(x, y, width, share * height)
        case "up":
            return Rectangle(x, y + (1.0 - share) * height, width, share * height)
        case _:
            return Rectangle(x, y, share * width, height)


def contained(rectangle: Rectangle, width: float, height: float) -> Rectangle:
    """The largest rectangle of the proportions `width` to `height` in the middle of another."""
    scale = min(rectangle.width / width, rectangle.height / height)
    size = (width * scale, height * scale)
    return Rectangle(
        rectangle.x + (rectangle.width - size[0]) / 2, rectangle.y + (rectangle.height - size[1]) / 2, *size
    )
