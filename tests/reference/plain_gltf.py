"""Accessors of glTF read element by element with struct, as the specification words it: slow, and shares nothing with ELYS."""

from __future__ import annotations

import struct
from typing import Any

FORMATS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
LARGEST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535, 5125: 4294967295}
COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def read_accessor(document: dict[str, Any], buffers: list[bytes], index: int) -> list[tuple[float, ...]]:
    """The elements, normalised where the accessor says so. glTF 2.0, 3.6.2."""
    accessor = document["accessors"][index]
    component, width = accessor["componentType"], COUNTS[accessor["type"]]
    size = struct.calcsize(FORMATS[component])
    elements: list[tuple[float, ...]] = [(0,) * width for _ in range(accessor["count"])]
    if "bufferView" in accessor:
        view = document["bufferViews"][accessor["bufferView"]]
        stride = view.get("byteStride", size * width)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        for row in range(accessor["count"]):
            elements[row] = unpack(buffers[view["buffer"]], start + row * stride, component, width)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        places, values = sparse["indices"], sparse["values"]
        for row in range(sparse["count"]):
            view = document["bufferViews"][places["bufferView"]]
            step = struct.calcsize(FORMATS[places["componentType"]])
            start = view.get("byteOffset", 0) + places.get("byteOffset", 0) + row * step
            (target,) = unpack(buffers[view["buffer"]], start, places["componentType"], 1)
            view = document["bufferViews"][values["bufferView"]]
            start = view.get("byteOffset", 0) + values.get("byteOffset", 0) + row * size * width
            elements[int(target)] = unpack(buffers[view["buffer"]], start, component, width)
    if accessor.get("normalized"):
        largest = LARGEST[component]
        elements = [tuple(max(value / largest, -1.0) for value in element) for element in elements]
    return elements


def unpack(data: bytes, offset: int, component: int, width: int) -> tuple[float, ...]:
    return struct.unpack_from("<" + FORMATS[component] * width, data, offset)
