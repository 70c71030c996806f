"""A way through the air that a ball rolls along: straights, turns and gaps one after the other, and the meshes they become.

    course = Course(width=6.0)
    course.straight(20.0)
    course.turn(90.0, radius=14.0, bank=12.0).gate()
    course.gap(5.0, drop=1.0)
    course.straight(10.0, climb=2.0)
    meshes = [stretch.mesh() for stretch in course.stretches]

It is a chain of stations half a metre apart; between two gaps they are one stretch, a deck between curbs, swept along them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh
from elys.common.math import quaternion

STEP: Final = 0.5  # [m] between stations
CURB_WIDTH: Final = 0.35  # [m]
THICKNESS: Final = 0.5  # [m] of the deck
STRIP: Final = 0.5  # [m] about as wide is a strip of the deck
LINE: Final = 0.12  # [m] half the width of the line in the middle
LEANING: Final = 10.0  # [m] in which a bend leans over
SUNK: Final = 0.1  # [m] below the road: deep enough that a fast ball does not feel an edge there
LEAD: Final = 2.0  # [m] in which a stretch comes up below the one before
RISE: Final = 0.08  # [m] of a plank over the road's edge, which it must not meet either
RAMP: Final = 3.0  # [m] in which a plank comes out of the road
DASH: Final = 2.0  # [m] of one colour along a curb
WAYSIDE: Final = 0.35  # [m] that a gate's posts stand away from where the deck ends
Color = tuple[float, float, float]
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Place:
    """Somewhere on a course: `forward`, `right` and `up` are unit vectors at right angles."""

    position: Array  # [m], on the deck, in its middle
    forward: Array
    right: Array
    up: Array

    def at(self, *, right: float = 0.0, up: float = 0.0, forward: float = 0.0) -> list[float]:
        """A point [m] beside it, rounded as files have it."""
        point = self.position + right * self.right + up * self.up + forward * self.forward
        return [round(float(value), 4) for value in point]

    @property
    def rotation(self) -> list[float]:
        """Of a thing whose -z looks along the course and whose y stands on the deck, as a quaternion x y z w."""
        turned = quaternion.from_matrix(np.stack([self.right, self.up, -self.forward], axis=1))
        return [round(float(value), 7) for value in turned]


@dataclass(slots=True)
class Look:
    """Linear colours of a stretch."""

    deck: Color = (0.30, 0.33, 0.36)
    line: Color = (0.75, 0.75, 0.70)
    curb: Color = (0.65, 0.06, 0.04)
    dash: Color = (0.75, 0.74, 0.70)
    side: Color = (0.22, 0.24, 0.28)


# Boards look like boards from afar: who comes must see that there are two ways.
WOOD: Final = Look(deck=(0.46, 0.25, 0.09), line=(0.62, 0.38, 0.15), dash=(0.62, 0.38, 0.15), side=(0.20, 0.10, 0.04))


@dataclass(frozen=True, slots=True)
class GatePlace:
    """Where a gate stands, and how wide [m] its opening is."""

    place: Place
    width: float


@dataclass(slots=True)
class Stretch:
    """What lies between two gaps."""

    width: float  # [m] of the deck
    curb: float  # [m] its height; 0: none
    look: Look
    places: list[Place] = field(default_factory=list)

    def mesh(self) -> tuple[Mesh, Array]:
        """Its mesh, and where the mesh's origin stands [m]: at its first station."""
        origin = self.places[0].position
        return _swept(self, origin), origin


class Course:
    """A turtle that leaves a road behind."""

    def __init__(
        self,
        *,
        width: float = 6.0,
        curb: float = 0.4,
        height: float = 0.0,
        heading: float = 0.0,
        look: Look | None = None,
    ) -> None:
        """Begins above the origin at `height` [m]; a heading [degrees] of 0 looks along -z, 90 along -x."""
        self.width, self.curb = width, curb
        self.look = look or Look()
        self.stretches: list[Stretch] = []
        self.stations: list[Place] = []  # of all stretches, in order
        self.planks: list[list[Place]] = []  # beside them
        self.gates: list[GatePlace] = []  # in their order
        self._position = np.array([0.0, height, 0.0])
        self._heading = math.radians(heading)
        self._slope = 0.0
        self._bank = 0.0
        self._begin()

    @property
    def here(self) -> Place:
        """Where it is."""
        return self._place()

    @property
    def station(self) -> int:
        """The number of that place among the stations."""
        return len(self.stations) - 1

    def gate(self) -> Course:
        """A gate here, as wide as the road."""
        self.gates.append(GatePlace(self.here, self.width + 2.0 * WAYSIDE))
        return self

    def plank(self, start: Sequence[float], end: Sequence[float], *, width: float) -> Course:
        """A straight board from one point on the road to another: no station of the line.

        It comes out of the road where it begins and goes back into it where it ends, each within RAMP: what rolls over meets no
        edge.
        """
        a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        length = float(np.linalg.norm(b - a))
        forward = (b - a) / length
        right = np.cross(forward, (0.0, 1.0, 0.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        count = max(1, round(length / STEP))
        places = []
        for number in range(count + 1):
            share = number / count
            rise = -SUNK + (SUNK + RISE) * _eased(min(1.0, length * min(share, 1.0 - share) / RAMP))
            places.append(Place(a + (b - a) * share + rise * up, forward, right, up))
        self.planks.append(places)
        self.stretches.insert(len(self.stretches) - 1, Stretch(width, 0.0, WOOD, places))
        return self

    def way_over(self, plank: int, *, leaves: int, joins: int, lead: float = 10.0) -> tuple[Place, ...]:
        """The line over a plank: the stations up to one, the plank, and the stations from another; in `lead` [m] before and
        after it goes to the side on which the plank lies.
        """
        board = self.planks[plank]

        def aside(place: Place, at: Place, end: Place, distance: float) -> Place:
            shift = float((end.position - at.position) @ at.right) * _eased(max(0.0, 1.0 - distance / lead))
            return replace(place, position=place.position + shift * place.right)

        before, after = self.stations[: leaves + 1], self.stations[joins:]
        first, last = self.stations[leaves], self.stations[joins]
        return (
            *(aside(place, first, board[0], STEP * (leaves - number)) for number, place in enumerate(before)),
            *board,
            *(aside(place, last, board[-1], STEP * number) for number, place in enumerate(after)),
        )

    def straight(self, length: float, *, climb: float = 0.0) -> Course:
        """Goes on for a length [m] along the ground, and up by `climb` [m], level at both ends."""
        self._advance(length, 0.0, climb, 0.0)
        return self

    def ramp(self, length: float, *, climb: float) -> Course:
        """Goes up by `climb` [m], level where it begins and steepest where it ends: to jump from."""
        count = max(1, round(length / STEP))
        start, slope = self._position[1], 2.0 * climb / length
        for number in range(1, count + 1):
            share = number / count
            self._walk(length / count, 0.0, start + climb * share * share, slope * share, 0.0)
        self._slope = 0.0
        return self

    def turn(self, angle: float, *, radius: float, climb: float = 0.0, bank: float = 0.0) -> Course:
        """Turns by an angle [degrees], to the left if positive, about a radius [m]; leans inwards by `bank` [degrees] between."""
        turned = math.radians(angle)
        self._advance(abs(turned) * radius, turned, climb, math.copysign(math.radians(bank), angle))
        return self

    def gap(self, length: float, *, drop: float = 0.0) -> Course:
        """Nothing for a length [m]; the next stretch begins lower by `drop` [m]."""
        self._position = self._position + length * self._level_forward() - np.array([0.0, drop, 0.0])
        self._begin()
        return self

    def widen(self, width: float, *, curb: float | None = None) -> Course:
        """From here on another width [m], and curb [m]."""
        self.width = width
        self.curb = self.curb if curb is None else curb
        goes_on = len(self.stretches[-1].places) > 1
        self._begin()
        if goes_on:
            # Off an edge where two meshes meet a fast ball jumps: this one begins below the other.
            here = self.here
            self.stretches[-1].places[:0] = [
                replace(here, position=here.position - back * LEAD * here.forward - back**2 * SUNK * here.up)
                for back in (1.0, 0.75, 0.5, 0.25)
            ]
        return self

    def _advance(self, length: float, angle: float, climb: float, bank: float) -> None:
        count = max(1, round(length / STEP))
        start = self._position[1]
        for number in range(1, count + 1):
            share = number / count
            height = start + climb * _eased(share)
            slope = climb * 6.0 * share * (1.0 - share) / length
            lean = bank * _eased(min(1.0, length * min(share, 1.0 - share) / min(LEANING, length / 2.0)))
            self._walk(length / count, angle / count, height, slope, lean)
        self._slope = self._bank = 0.0

    def _walk(self, step: float, angle: float, height: float, slope: float, bank: float) -> None:
        self._heading += angle / 2.0
        self._position = self._position + step * self._level_forward()
        self._position[1] = height
        self._heading += angle / 2.0
        self._slope, self._bank = slope, bank
        self._add()

    def _begin(self) -> None:
        self.stretches.append(Stretch(self.width, self.curb, self.look))
        self._add()

    def _add(self) -> None:
        place = self._place()
        self.stretches[-1].places.append(place)
        self.stations.append(place)

    def _level_forward(self) -> Array:
        return np.array([-math.sin(self._heading), 0.0, -math.cos(self._heading)])

    def _place(self) -> Place:
        forward = self._level_forward() + np.array([0.0, self._slope, 0.0])
        forward /= np.linalg.norm(forward)
        level = np.cross(forward, (0.0, 1.0, 0.0))
        level /= np.linalg.norm(level)
        above = np.cross(level, forward)
        right = math.cos(self._bank) * level + math.sin(self._bank) * above
        return Place(self._position.copy(), forward, right, np.cross(right, forward))


def _eased(share: float) -> float:
    return share * share * (3.0 - 2.0 * share)


def _profile(stretch: Stretch) -> tuple[list[tuple[float, float]], list[str]]:
    """The outline against the course's direction, deck first from left to right; and what each of its edges is.

    The deck is in strips: where it twists into a bank, wide triangles would be steps.
    """
    half = stretch.width / 2.0
    count = max(1, round((half - LINE) / STRIP))
    strips = [LINE + (half - LINE) * number / count for number in range(count + 1)]
    deck = [(-x, 0.0) for x in reversed(strips)] + [(x, 0.0) for x in strips]
    kinds = ["deck"] * count + ["line"] + ["deck"] * count
    if not stretch.curb:
        kinds[0] = kinds[-1] = "edge"  # is seen, also in the shade: nothing holds a ball there
        return [*deck, (half, -THICKNESS), (-half, -THICKNESS)], [*kinds, "side", "side", "side"]
    out = half + CURB_WIDTH
    right = [(half, stretch.curb), (out, stretch.curb), (out, -THICKNESS)]
    left = [(-out, -THICKNESS), (-out, stretch.curb), (-half, stretch.curb)]
    return [*deck, *right, *left], [*kinds, "curb", "curb", "side", "side", "side", "curb", "curb"]


def _swept(stretch: Stretch, origin: Array) -> Mesh:
    """The outline along the stations, each edge with normals and colours of its own, closed at both ends."""
    corners, kinds = _profile(stretch)
    places = stretch.places
    middle = np.array([place.position - origin for place in places])
    right = np.array([place.right for place in places])
    up = np.array([place.up for place in places])
    rings = np.array([middle + x * right + y * up for x, y in corners])  # (corner, station, 3)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))]
    positions: list[Array] = []
    normals: list[Array] = []
    colors: list[Array] = []
    indices: list[NDArray[np.int64]] = []
    count = 0

    def add(points: Array, normal: Array, color: Array, triangles: NDArray[np.int64]) -> None:
        nonlocal count
        positions.append(points)
        normals.append(normal)
        colors.append(color)
        indices.append(triangles + count)
        count += len(points)

    for edge, kind in enumerate(kinds):
        a, b = rings[edge], rings[(edge + 1) % len(corners)]
        (ax, ay), (bx, by) = corners[edge], corners[(edge + 1) % len(corners)]
        outward = np.array([-(by - ay), bx - ax]) / math.hypot(bx - ax, by - ay)
        normal = outward[0] * right + outward[1] * up
        for first in range(len(places) - 1):  # a quad each, so that colours have sharp ends
            quad = np.array([a[first], b[first], a[first + 1], b[first + 1]])
            faces = np.array([0, 1, 3, 0, 3, 2], dtype=np.int64)
            color = np.tile(_color(stretch.look, kind, along[first]), (4, 1))
            add(quad, normal[[first, first, first + 1, first + 1]], color, faces)
    for station, sign in ((0, -1.0), (len(places) - 1, 1.0)):
        cap, faces = rings[:, station], _cap(len(corners), stretch.curb > 0.0, sign)
        side = np.tile(_color(stretch.look, "side", 0.0), (len(corners), 1))
        add(cap, np.tile(sign * places[station].forward, (len(corners), 1)), side, faces)
    flat = np.concatenate(positions)
    return Mesh(
        positions=flat.astype(np.float32),
        normals=np.concatenate(normals).astype(np.float32),
        uvs=np.zeros((len(flat), 2), np.float32),
        colors=np.concatenate(colors).astype(np.float32),
        indices=np.concatenate(indices).astype(np.uint32),
    )


def _cap(count: int, has_curb: bool, sign: float) -> NDArray[np.int64]:
    """Triangles over an outline: the deck's plate, a fan, and a curb on either side."""
    last = count - (7 if has_curb else 3)  # the deck's right corner
    right, left = (last + 3, last + 4) if has_curb else (last + 1, last + 2)  # the lower corners
    faces = [(left, number, number + 1) for number in range(last)] + [(left, last, right)]
    if has_curb:
        faces += [(last, last + 1, last + 2), (last, last + 2, right), (left, left + 1, left + 2), (left, left + 2, 0)]
    ordered = np.array(faces, dtype=np.int64)
    return (ordered[:, ::-1] if sign < 0.0 else ordered).reshape(-1)


def _color(look: Look, kind: str, along: float) -> Array:
    is_dash = int(along / DASH) % 2 == 1
    if kind == "curb":
        chosen = look.dash if is_dash else look.curb
    elif kind == "line":
        chosen = look.deck if is_dash else look.line
    else:
        chosen = {"deck": look.deck, "edge": look.dash, "side": look.side}[kind]
    return np.array([*chosen, 1.0])
