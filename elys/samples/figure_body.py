"""The body of the sample figure: its joints, and a skin over them that bends with two at a time."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh

Floats = NDArray[np.float64]
Color = tuple[float, float, float]
_AROUND: Final = 14  # vertices of a ring
_SKIN: Final[Color] = (0.62, 0.36, 0.24)
_SHIRT: Final[Color] = (0.75, 0.16, 0.10)
_TROUSERS: Final[Color] = (0.07, 0.10, 0.20)
_SHOE: Final[Color] = (0.05, 0.05, 0.05)
_HAIR: Final[Color] = (0.09, 0.05, 0.03)


def _joints() -> dict[str, tuple[str | None, Floats]]:
    found: dict[str, tuple[str | None, Floats]] = {
        "Hips": (None, np.array((0.0, 0.96, 0.0))),
        "Spine": ("Hips", np.array((0.0, 1.08, 0.0))),
        "Chest": ("Spine", np.array((0.0, 1.26, 0.0))),
        "Neck": ("Chest", np.array((0.0, 1.47, 0.0))),
        "Head": ("Neck", np.array((0.0, 1.55, 0.0))),
    }
    for side, sign in (("L", -1.0), ("R", 1.0)):
        for name, parent, place in (
            ("Arm", "Chest", (0.19, 1.41, 0.0)),
            ("Forearm", f"{side} Arm", (0.20, 1.13, 0.0)),
            ("Hand", f"{side} Forearm", (0.21, 0.88, 0.0)),
            ("Thigh", "Hips", (0.095, 0.93, 0.0)),
            ("Shin", f"{side} Thigh", (0.095, 0.50, 0.0)),
            ("Foot", f"{side} Shin", (0.095, 0.07, 0.0)),
        ):
            found[f"{side} {name}"] = (parent, np.array(place) * (sign, 1.0, 1.0))
    return found


JOINTS: Final = _joints()  # by name: the parent, and where it is at rest [m]
_NUMBER: Final = {name: number for number, name in enumerate(JOINTS)}


class Ring(NamedTuple):
    """Around a limb: its middle, half widths along x and z [m], who bends it by which share, and its colour."""

    middle: tuple[float, float, float]
    width: float
    depth: float
    joints: tuple[tuple[str, float], ...]
    color: Color


def body() -> Mesh:
    """The whole figure."""
    limbs = [_torso(), _head(), _hair(), _nose()]
    for side, sign in (("L", -1.0), ("R", 1.0)):
        limbs += [_arm(side, sign), _leg(side, sign), _shoe(side, sign)]
    parts = [_tube(rings) for rings in limbs]
    first = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]).astype(np.float32)
        for name in ("positions", "normals", "uvs", "colors", "joints", "weights")
    }
    indices = np.concatenate([part.indices + start for part, start in zip(parts, first, strict=True)])
    return Mesh(indices=indices.astype(np.uint32), **joined)


def _torso() -> list[Ring]:
    shirt, hips = _SHIRT, _TROUSERS
    return [
        Ring((0.0, 0.86, 0.0), 0.10, 0.08, (("Hips", 1.0),), hips),
        Ring((0.0, 0.90, 0.0), 0.165, 0.115, (("Hips", 1.0),), hips),
        Ring((0.0, 0.98, 0.0), 0.165, 0.115, (("Hips", 1.0),), hips),
        Ring((0.0, 1.01, 0.0), 0.158, 0.112, (("Hips", 0.8), ("Spine", 0.2)), shirt),
        Ring((0.0, 1.10, 0.0), 0.145, 0.105, (("Hips", 0.3), ("Spine", 0.7)), shirt),
        Ring((0.0, 1.20, 0.0), 0.155, 0.11, (("Spine", 0.6), ("Chest", 0.4)), shirt),
        Ring((0.0, 1.32, 0.0), 0.175, 0.12, (("Chest", 1.0),), shirt),
        Ring((0.0, 1.40, 0.0), 0.17, 0.11, (("Chest", 1.0),), shirt),
        Ring((0.0, 1.455, 0.0), 0.09, 0.075, (("Chest", 0.8), ("Neck", 0.2)), shirt),
        Ring((0.0, 1.465, 0.0), 0.055, 0.055, (("Chest", 0.4), ("Neck", 0.6)), _SKIN),
        Ring((0.0, 1.55, 0.0), 0.05, 0.055, (("Neck", 0.6), ("Head", 0.4)), _SKIN),
    ]


def _ball(
    middle: tuple[float, float, float], sizes: tuple[float, float, float], joint: str, color: Color
) -> list[Ring]:
    angles = np.linspace(0.0, np.pi, 9)
    x, y, z = middle
    heights, widths = np.cos(angles).tolist(), np.sin(angles).tolist()
    return [
        Ring((x, y - sizes[1] * height, z), sizes[0] * width, sizes[2] * width, ((joint, 1.0),), color)
        for height, width in zip(heights, widths, strict=True)
    ]


def _head() -> list[Ring]:
    return _ball((0.0, 1.635, -0.01), (0.082, 0.115, 0.095), "Head", _SKIN)


def _hair() -> list[Ring]:
    return _ball((0.0, 1.665, 0.015), (0.088, 0.095, 0.092), "Head", _HAIR)


def _nose() -> list[Ring]:
    return _ball((0.0, 1.625, -0.105), (0.014, 0.02, 0.018), "Head", _SKIN)


def _arm(side: str, sign: float) -> list[Ring]:
    arm, fore, hand = f"{side} Arm", f"{side} Forearm", f"{side} Hand"

    def ring(x: float, y: float, size: float, joints: tuple[tuple[str, float], ...], color: Color = _SHIRT) -> Ring:
        return Ring((sign * x, y, 0.0), size, size, joints, color)

    return [
        ring(0.175, 1.455, 0.03, (("Chest", 0.6), (arm, 0.4))),
        ring(0.185, 1.435, 0.058, (("Chest", 0.4), (arm, 0.6))),
        ring(0.19, 1.37, 0.058, (("Chest", 0.1), (arm, 0.9))),
        ring(0.195, 1.25, 0.050, ((arm, 1.0),)),
        ring(0.197, 1.245, 0.044, ((arm, 1.0),), _SKIN),
        ring(0.20, 1.17, 0.042, ((arm, 0.8), (fore, 0.2)), _SKIN),
        ring(0.20, 1.13, 0.041, ((arm, 0.5), (fore, 0.5)), _SKIN),
        ring(0.202, 1.09, 0.041, ((arm, 0.2), (fore, 0.8)), _SKIN),
        ring(0.206, 0.98, 0.035, ((fore, 1.0),), _SKIN),
        ring(0.21, 0.89, 0.027, ((fore, 0.6), (hand, 0.4)), _SKIN),
        ring(0.21, 0.84, 0.036, ((hand, 1.0),), _SKIN),
        ring(0.21, 0.78, 0.034, ((hand, 1.0),), _SKIN),
        ring(0.21, 0.74, 0.012, ((hand, 1.0),), _SKIN),
    ]


def _leg(side: str, sign: float) -> list[Ring]:
    thigh, shin, foot = f"{side} Thigh", f"{side} Shin", f"{side} Foot"

    def ring(y: float, size: float, joints: tuple[tuple[str, float], ...]) -> Ring:
        return Ring((sign * 0.095, y, 0.0), size, size, joints, _TROUSERS)

    return [
        ring(0.97, 0.05, (("Hips", 0.7), (thigh, 0.3))),
        ring(0.93, 0.085, (("Hips", 0.5), (thigh, 0.5))),
        ring(0.86, 0.088, (("Hips", 0.15), (thigh, 0.85))),
        ring(0.70, 0.076, ((thigh, 1.0),)),
        ring(0.55, 0.062, ((thigh, 0.8), (shin, 0.2))),
        ring(0.50, 0.059, ((thigh, 0.5), (shin, 0.5))),
        ring(0.45, 0.057, ((thigh, 0.2), (shin, 0.8))),
        ring(0.35, 0.056, ((shin, 1.0),)),
        ring(0.15, 0.045, ((shin, 1.0),)),
        ring(0.08, 0.044, ((shin, 0.5), (foot, 0.5))),
    ]


def _shoe(side: str, sign: float) -> list[Ring]:
    joint = ((f"{side} Foot", 1.0),)
    return [
        Ring((sign * 0.095, y, z), width, depth, joint, _SHOE)
        for y, z, width, depth in (
            (0.0, -0.05, 0.035, 0.10),
            (0.012, -0.05, 0.05, 0.135),
            (0.04, -0.05, 0.052, 0.135),
            (0.07, -0.025, 0.05, 0.10),
            (0.10, 0.0, 0.046, 0.052),
            (0.11, 0.0, 0.03, 0.035),
        )
    ]


def _tube(rings: list[Ring]) -> Mesh:
    """A closed tube through rings; normals as its quads have them, mean by corner."""
    angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    circle = np.stack((np.cos(angles), np.zeros(_AROUND), np.sin(angles)), axis=1)
    loops = [np.array(r.middle) + circle * (r.width, 0.0, r.depth) for r in rings]
    ends = [np.array(rings[0].middle)[None], np.array(rings[-1].middle)[None]]
    positions = np.concatenate((*loops, *ends))
    triangles = _triangles(len(rings), is_upward=rings[-1].middle[1] > rings[0].middle[1])
    owner = [*np.repeat(np.arange(len(rings)), _AROUND).tolist(), 0, len(rings) - 1]
    joints, weights = np.zeros((len(positions), 4)), np.zeros((len(positions), 4))
    for vertex, row in enumerate(owner):
        for place, (name, share) in enumerate(rings[row].joints):
            joints[vertex, place], weights[vertex, place] = _NUMBER[name], share
    colors = np.array([(*rings[row].color, 1.0) for row in owner])
    zeros = np.zeros((len(positions), 2))
    return Mesh(
        positions=positions.astype(np.float32),
        normals=_normals(positions, triangles).astype(np.float32),
        uvs=zeros.astype(np.float32),
        indices=triangles.ravel().astype(np.uint32),
        colors=colors.astype(np.float32),
        joints=joints.astype(np.float32),
        weights=weights.astype(np.float32),
    )


def _triangles(ring_count: int, *, is_upward: bool) -> NDArray[np.int64]:
    here = np.arange(_AROUND)
    after = (here + 1) % _AROUND
    found = []
    for ring in range(ring_count - 1):
        low, high = ring * _AROUND, (ring + 1) * _AROUND
        found += [
            np.stack((low + here, high + here, high + after), 1),
            np.stack((low + here, high + after, low + after), 1),
        ]
    first, last = ring_count * _AROUND, ring_count * _AROUND + 1
    high = (ring_count - 1) * _AROUND
    found.append(np.stack((np.full(_AROUND, first), here, after), 1))
    found.append(np.stack((np.full(_AROUND, last), high + after, high + here), 1))
    triangles = np.concatenate(found)
    return triangles if is_upward else triangles[:, ::-1]


def _normals(positions: Floats, triangles: NDArray[np.int64]) -> Floats:
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    faces = np.cross(b - a, c - a)
    normals = np.zeros_like(positions)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], faces)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 1e-12, normals / np.where(length > 1e-12, length, 1.0), (0.0, 1.0, 0.0))
