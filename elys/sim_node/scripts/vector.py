"""Vectors and rotations for scripts: tuples with arithmetic, so that they compare, print and are kept as what they are."""

from __future__ import annotations

import math
from collections.abc import Iterable

from elys.common.math import poses


class Vector(tuple[float, float, float]):
    """Three numbers, x y z. Anything of three numbers may stand on the other side."""

    __slots__ = ()

    def __new__(cls, x: float | Iterable[float] = 0.0, y: float = 0.0, z: float = 0.0) -> Vector:
        """From three numbers or from one thing that holds three."""
        values = (x, y, z) if isinstance(x, int | float) else tuple(x)
        if len(values) != 3:
            raise ValueError(f"a Vector takes 3 numbers, not {len(values)}")
        return super().__new__(cls, map(float, values))

    x = property(lambda self: self[0], doc="To the right.")
    y = property(lambda self: self[1], doc="Up.")
    z = property(lambda self: self[2], doc="To the viewer.")

    def __add__(self, other: Iterable[float]) -> Vector:  # type: ignore[override]
        a, b, c = other
        return Vector(self[0] + a, self[1] + b, self[2] + c)

    __radd__ = __add__

    def __sub__(self, other: Iterable[float]) -> Vector:
        a, b, c = other
        return Vector(self[0] - a, self[1] - b, self[2] - c)

    def __rsub__(self, other: Iterable[float]) -> Vector:
        a, b, c = other
        return Vector(a - self[0], b - self[1], c - self[2])

    def __mul__(self, factor: float) -> Vector:  # type: ignore[override]
        return Vector(self[0] * factor, self[1] * factor, self[2] * factor)

    __rmul__ = __mul__  # type: ignore[assignment]

    def __truediv__(self, divisor: float) -> Vector:
        return Vector(self[0] / divisor, self[1] / divisor, self[2] / divisor)

    def __neg__(self) -> Vector:
        return Vector(-self[0], -self[1], -self[2])

    def __repr__(self) -> str:
        return f"Vector({self[0]:g}, {self[1]:g}, {self[2]:g})"

    @property
    def length(self) -> float:
        """How long it is."""
        return math.sqrt(self[0] * self[0] + self[1] * self[1] + self[2] * self[2])

    def dot(self, other: Iterable[float]) -> float:
        """The sum of the products."""
        a, b, c = other
        return self[0] * a + self[1] * b + self[2] * c

    def cross(self, other: Iterable[float]) -> Vector:
        """The one at right angles to both."""
        a, b, c = other
        return Vector(self[1] * c - self[2] * b, self[2] * a - self[0] * c, self[0] * b - self[1] * a)

    def normalized(self) -> Vector:
        """Of length 1, the same way; zero stays zero."""
        length = self.length
        return self / length if length else self

    def lerp(self, other: Iterable[float], share: float) -> Vector:
        """Part of the way to another: 0 is here, 1 is there."""
        return self + (Vector(other) - self) * share

    def distance(self, other: Iterable[float]) -> float:
        """How far away another is."""
        return (self - other).length


class Rotation(tuple[float, float, float, float]):
    """A turn, as a unit quaternion x y z w. `a * b` is b followed by a; `a * (x, y, z)` turns a vector."""

    __slots__ = ()

    def __new__(cls, x: float | Iterable[float] = 0.0, y: float = 0.0, z: float = 0.0, w: float = 1.0) -> Rotation:
        """From four numbers or from one thing that holds four; brought to length 1."""
        values = tuple(map(float, (x, y, z, w) if isinstance(x, int | float) else x))
        if len(values) != 4:
            raise ValueError(f"a Rotation takes 4 numbers, not {len(values)}")
        length = math.sqrt(sum(value * value for value in values))
        if length < 1e-9:
            raise ValueError("a Rotation cannot be all zeros")
        return super().__new__(cls, (value / length for value in values))

    @classmethod
    def about(cls, axis: Iterable[float], angle: float) -> Rotation:
        """A turn about an axis by an angle [rad], counterclockwise for who looks against the axis."""
        x, y, z = Vector(axis).normalized() * math.sin(angle / 2)
        return cls(x, y, z, math.cos(angle / 2))

    def __mul__(self, other: Iterable[float]) -> Rotation | Vector:  # type: ignore[override]
        values = tuple(other)
        if len(values) == 4:
            return Rotation(poses.multiply(self, values))
        return Vector(poses.rotate(self, values))  # type: ignore[arg-type]

    @property
    def inverse(self) -> Rotation:
        """The turn back."""
        return Rotation(-self[0], -self[1], -self[2], self[3])

    def __repr__(self) -> str:
        return f"Rotation({self[0]:g}, {self[1]:g}, {self[2]:g}, {self[3]:g})"
