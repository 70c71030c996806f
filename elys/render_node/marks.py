"""What is drawn over a scene to explain it: line segments in the world, and texts that stand at places of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Color = tuple[int, int, int]  # sRGB, 0 to 255

# Readable on light and on dark: of middling brightness, and lines and letters have a dark edge besides.
DYNAMIC: Final[Color] = (110, 200, 255)
KINEMATIC: Final[Color] = (255, 185, 80)
STATIC: Final[Color] = (165, 165, 165)
TURNED_BOX: Final[Color] = (255, 222, 60)
POINT: Final[Color] = (255, 70, 60)
NORMAL: Final[Color] = (255, 200, 40)
IMPULSE: Final[Color] = (255, 90, 210)
ARM: Final[Color] = (95, 225, 120)
HINGE: Final[Color] = (90, 165, 255)
LIMIT: Final[Color] = (230, 145, 255)
ARROW: Final[Color] = (60, 230, 225)
AXES: Final[tuple[Color, Color, Color]] = ((240, 80, 70), (115, 215, 70), (80, 140, 255))
LETTERS: Final[Color] = (245, 245, 245)

WIDTH: Final = 1.6  # [pixels] of a line
SEEN_THROUGH: Final = 0.25  # how much of a line is left where something is before it
# Corner k of a box takes its upper side along axis d where bit d of k is set; an edge changes one bit.
_EDGES: Final = np.array([(k, k | 1 << d) for d in range(3) for k in range(8) if not k & 1 << d])
_UPPER: Final = np.array([[k >> d & 1 for d in range(3)] for k in range(8)], bool)
_BARB: Final = 0.22  # of an arrow's length


class Label(NamedTuple):
    """A text at a place of the world: its lower edge's middle stands a little above it."""

    text: str
    position: tuple[float, float, float]  # [m]
    color: Color = LETTERS


@dataclass(frozen=True, slots=True)
class Lines:
    """L line segments."""

    ends: Floats  # (L, 2, 3) [m] world
    color: NDArray[np.uint8]  # (L, 3) sRGB
    width: NDArray[np.float32]  # (L,) [pixels]
    hidden: NDArray[np.float32]  # (L,) opacity where something stands before it, 0 to 1

    @classmethod
    def of(
        cls, ends: NDArray[np.floating[Any]], color: Any, *, width: Any = WIDTH, hidden: float = SEEN_THROUGH
    ) -> Lines:
        """Segments (L, 2, 3) in one colour, or one each (L, 3), as wide as `width`, which may be (L,) as well."""
        count = len(ends)
        return cls(
            np.asarray(ends, np.float64).reshape(count, 2, 3),
            np.broadcast_to(np.asarray(color, np.uint8), (count, 3)),
            np.broadcast_to(np.asarray(width, np.float32), (count,)),
            np.full(count, hidden, np.float32),
        )

    @classmethod
    def joined(cls, parts: Iterable[Lines]) -> Lines:
        """One behind the other."""
        found = [part for part in parts if len(part)]
        if not found:
            return NO_LINES
        columns = zip(*((part.ends, part.color, part.width, part.hidden) for part in found), strict=True)
        return cls(*(np.concatenate(column) for column in columns))

    def __len__(self) -> int:
        return len(self.ends)


NO_LINES: Final = Lines.of(np.zeros((0, 2, 3)), POINT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Marks:
    """All that is drawn over one picture."""

    lines: Lines = NO_LINES
    labels: tuple[Label, ...] = ()
    notes: tuple[str, ...] = ()  # lines of text in the picture's upper left corner
    grid: bool = False


NO_MARKS: Final = Marks()


def box_edges(corners: NDArray[np.floating[Any]]) -> Floats:
    """The edges (12 B, 2, 3) of boxes by their corners (B, 8, 3), as `box_corners` numbers them."""
    return np.asarray(corners[:, _EDGES].reshape(-1, 2, 3), np.float64)


def box_corners(lower: NDArray[np.floating[Any]], upper: NDArray[np.floating[Any]]) -> Floats:
    """Corners (B, 8, 3) of boxes from lower to upper corners (B, 3)."""
    return np.asarray(np.where(_UPPER, upper[:, None], lower[:, None]), np.float64)


def arrows(start: NDArray[np.floating[Any]], end: NDArray[np.floating[Any]]) -> Floats:
    """Shafts and two barbs each (3 N, 2, 3) of arrows from `start` to `end` (N, 3)."""
    along = end - start
    # Barbs lie in the plane of the shaft and the axis of the world that it is least along.
    aside = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=1)])
    length = np.linalg.norm(aside, axis=1, keepdims=True)
    aside = aside / np.where(length > 0, length, 1.0) * np.linalg.norm(along, axis=1, keepdims=True)
    barbs = [end - _BARB * (along + sign * 0.5 * aside) for sign in (1, -1)]
    shafts = [np.stack([start, end], axis=1), *(np.stack([barb, end], axis=1) for barb in barbs)]
    return np.asarray(np.concatenate(shafts), np.float64)


def crosses(points: NDArray[np.floating[Any]], size: float) -> Floats:
    """Three segments (3 N, 2, 3) through each of the points (N, 3), `size` [m] to each side."""
    arms = size * np.eye(3)
    middle = points[:, None, :]
    return np.asarray(np.stack([middle - arms, middle + arms], axis=2).reshape(-1, 2, 3), np.float64)


def age_text(age: float, round_trip: float | None) -> str:
    """How old what is seen is [s], and how long the way to the host and back [s], as they stand on pictures."""
    way = f"   round trip {round_trip * 1e3:.1f} ms" if round_trip is not None else ""
    return f"{age * 1e3:.0f} ms old{way}"


def stamp_text(tick: int, time: float) -> str:
    """Tick and simulation time [s], as they stand on pictures."""
    return f"tick {tick}   {time:.3f} s"
