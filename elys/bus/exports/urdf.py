"""A scene as a URDF: a link for each frame, with what can be said of its shape. http://wiki.ros.org/urdf/XML

Rerun draws it where the frames are (docs/recordings-elsewhere.md). It knows boxes, spheres and cylinders alone: of meshes, cones
and planes a box around them is said.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence
from typing import Final, NamedTuple
from xml.sax.saxutils import quoteattr as _quoteattr

from elys.common.components import Vec3

URDF_TOPIC: Final = "/robot_description"
URDF_SCHEMA: Final = ("std_msgs/msg/String", "ros2msg", b"string data\n")
URDF_ENCODING: Final = "cdr"
_ALONG_Y: Final = f"{-math.pi / 2!r} 0 0"  # its cylinders stand along z
_NO_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_CAPSULE: Final = 0.25  # radius of the capsule among the primitives, which is 1 m high


class Link(NamedTuple):
    """What is drawn in a frame: a mesh by name, its scale, its colour r g b a, and a box around it for other meshes."""

    frame: str
    mesh: str
    scale: Vec3
    color: tuple[float, float, float, float]
    lower: Vec3 = (-0.5, -0.5, -0.5)
    upper: Vec3 = (0.5, 0.5, 0.5)


def urdf_of(name: str, world: str, scene: str, links: Sequence[Link]) -> str:
    """The description: `scene` in `world`, y up as z up, and every link free in `scene`."""
    parts = [f'<?xml version="1.0"?>\n<robot name={quoteattr(name)}>', f"<link name={quoteattr(world)}/>"]
    parts.append(f"<link name={quoteattr(scene)}/>")
    parts.append(_joint(world, scene, "fixed", f"{math.pi / 2!r} 0 0"))
    for link in links:
        parts.append(f"<link name={quoteattr(link.frame)}>{_visuals(link)}</link>")
        parts.append(_joint(scene, link.frame, "floating", "0 0 0"))
    return "\n".join([*parts, "</robot>\n"])


def urdf_message(text: str) -> bytes:
    """The same as a `std_msgs/msg/String` in CDR, little-endian. OMG DDSI-RTPS 2.5, 10.2."""
    data = text.encode()
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data) + 1) + data + b"\0"


def quoteattr(text: str) -> str:
    """A text as an attribute of XML, without the characters that XML has no way to say."""
    return _quoteattr(_NO_XML.sub("?", text))


def _joint(parent: str, child: str, kind: str, turn: str) -> str:
    return (
        f'<joint name={quoteattr(f"{child} joint")} type="{kind}"><origin xyz="0 0 0" rpy="{turn}"/>'
        f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/></joint>"
    )


def _visuals(link: Link) -> str:
    x, y, z = (abs(axis) for axis in link.scale)
    color = f'<material name={quoteattr(f"{link.frame} color")}><color rgba="{_numbers(link.color)}"/></material>'

    def visual(geometry: str, place: Vec3 = (0.0, 0.0, 0.0), turn: str = "0 0 0") -> str:
        origin = f'<origin xyz="{_numbers(place)}" rpy="{turn}"/>'
        return f"<visual>{origin}<geometry>{geometry}</geometry>{color}</visual>"

    match link.mesh:
        case "box":
            return visual(f'<box size="{_numbers((x, y, z))}"/>')
        case "sphere":
            return visual(f'<sphere radius="{max(x, y, z) / 2!r}"/>')
        case "cylinder":
            return visual(f'<cylinder radius="{max(x, z) / 2!r}" length="{y!r}"/>', turn=_ALONG_Y)
        case "capsule":
            radius, half = _CAPSULE * max(x, z), (0.5 - _CAPSULE) * y
            ends = [visual(f'<sphere radius="{radius!r}"/>', (0.0, side * half, 0.0)) for side in (1.0, -1.0)]
            return visual(f'<cylinder radius="{radius!r}" length="{2 * half!r}"/>', turn=_ALONG_Y) + "".join(ends)
    lower = [corner * axis for corner, axis in zip(link.lower, link.scale, strict=True)]
    upper = [corner * axis for corner, axis in zip(link.upper, link.scale, strict=True)]
    size = [max(abs(high - low), 1e-3) for low, high in zip(lower, upper, strict=True)]
    middle = ((lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, (lower[2] + upper[2]) / 2)
    return visual(f'<box size="{_numbers(size)}"/>', middle)


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
