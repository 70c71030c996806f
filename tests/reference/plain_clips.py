"""What a glTF file's animations say at a time, after the text of the standard: one node, one property, plain Python and sines.

glTF 2.0, appendix C (interpolation), section 3.11 (animations); accessors by `plain_gltf`.
"""

from __future__ import annotations

import base64
import bisect
import json
import math
import struct
from pathlib import Path
from typing import Any, NamedTuple

from tests.reference.plain_gltf import read_accessor

Numbers = list[float]


class PlainModel(NamedTuple):
    """A document and its buffers."""

    document: dict[str, Any]
    buffers: list[bytes]

    def accessor(self, index: int) -> list[tuple[float, ...]]:
        return read_accessor(self.document, self.buffers, index)


def _bytes_at(model: Path, uri: str) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (model.parent / uri).read_bytes()


def read_model(path: Path) -> PlainModel:
    """A .glb, or a .gltf with its buffers in files beside it."""
    data = path.read_bytes()
    if data[:4] != b"glTF":
        document = json.loads(data)
        return PlainModel(document, [_bytes_at(path, buffer["uri"]) for buffer in document["buffers"]])
    length = struct.unpack_from("<I", data, 12)[0]
    start = 20 + length
    size = struct.unpack_from("<I", data, start)[0]
    return PlainModel(json.loads(data[20:start]), [data[start + 8 : start + 8 + size]])


def sampled(model: PlainModel, animation: dict[str, Any], channel: dict[str, Any], time: float) -> Numbers:
    """The value of a channel at a time [s]."""
    sampler = animation["samplers"][channel["sampler"]]
    times = [row[0] for row in model.accessor(sampler["input"])]
    rows: Any = model.accessor(sampler["output"])
    path = channel["target"]["path"]
    mode = sampler.get("interpolation", "LINEAR")
    width = len(rows) // (len(times) * (3 if mode == "CUBICSPLINE" else 1)) if path == "weights" else 1
    if path == "weights":
        flat = [row[0] for row in rows]
        rows = [flat[first : first + width] for first in range(0, len(flat), width)]
    keys = [rows[3 * k + 1] for k in range(len(times))] if mode == "CUBICSPLINE" else rows
    if time <= times[0] or time >= times[-1]:
        value = keys[0] if time <= times[0] else keys[-1]
        return _unit(value) if path == "rotation" else value
    k = bisect.bisect_right(times, time) - 1
    span = times[k + 1] - times[k]
    t = (time - times[k]) / span
    if mode == "STEP":
        return keys[k]
    if mode == "CUBICSPLINE":
        before, after = rows[3 * k : 3 * k + 3], rows[3 * k + 3 : 3 * k + 6]
        value = [
            (2 * t**3 - 3 * t**2 + 1) * before[1][i]
            + span * (t**3 - 2 * t**2 + t) * before[2][i]
            + (-2 * t**3 + 3 * t**2) * after[1][i]
            + span * (t**3 - t**2) * after[0][i]
            for i in range(len(before[1]))
        ]
        return _unit(value) if path == "rotation" else value
    if path == "rotation":
        return _slerp(_unit(keys[k]), _unit(keys[k + 1]), t)
    return [(1 - t) * a + t * b for a, b in zip(keys[k], keys[k + 1], strict=True)]


def _slerp(start: Numbers, end: Numbers, t: float) -> Numbers:
    dot = sum(a * b for a, b in zip(start, end, strict=True))
    angle, sign = math.acos(min(abs(dot), 1.0)), math.copysign(1.0, dot)
    if math.sin(angle) < 1e-9:
        return start
    return [
        math.sin(angle * (1 - t)) / math.sin(angle) * a + sign * math.sin(angle * t) / math.sin(angle) * b
        for a, b in zip(start, end, strict=True)
    ]


def _unit(value: Numbers) -> Numbers:
    length = math.sqrt(sum(x * x for x in value))
    return [x / length for x in value]
