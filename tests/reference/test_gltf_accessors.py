"""ELYS' accessors against a plain reader: random layouts, and every accessor of the real models."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.assets.gltf_accessors import Buffers
from elys.common.assets.gltf_schema import parse_gltf
from tests.reference.plain_gltf import COUNTS, FORMATS, read_accessor


@st.composite
def layouts(draw: st.DrawFn) -> dict[str, Any]:
    """A document of one accessor over random bytes: any type, stride, offsets, sparse or not."""
    component, kind = draw(st.sampled_from([5120, 5121, 5122, 5123, 5125])), draw(st.sampled_from(list(COUNTS)))
    size = struct.calcsize(FORMATS[component])
    element, count = size * COUNTS[kind], draw(st.integers(1, 9))
    stride = draw(st.none() | st.integers(-(-element // 4), 12).map(lambda words: 4 * words))
    inside, before = size * draw(st.integers(0, 3)), 4 * draw(st.integers(0, 3))
    length = inside + (stride or element) * count
    views: list[dict[str, Any]] = [{"buffer": 0, "byteOffset": before, "byteLength": length}]
    if stride is not None:
        views[0]["byteStride"] = stride
    accessor = {"componentType": component, "count": count, "type": kind, "normalized": draw(st.booleans())}
    if draw(st.booleans()):
        accessor |= {"bufferView": 0, "byteOffset": inside}
    data = bytearray(draw(st.binary(min_size=before + length, max_size=before + length)))
    if draw(st.booleans()):
        rows = sorted(draw(st.sets(st.integers(0, count - 1), min_size=1)))
        views += [
            {"buffer": 0, "byteOffset": len(data), "byteLength": 2 * len(rows)},
            {"buffer": 0, "byteOffset": len(data) + 2 * len(rows), "byteLength": element * len(rows)},
        ]
        data += struct.pack(f"<{len(rows)}H", *rows)
        data += draw(st.binary(min_size=element * len(rows), max_size=element * len(rows)))
        accessor["sparse"] = {
            "count": len(rows),
            "indices": {"bufferView": 1, "componentType": 5123},
            "values": {"bufferView": 2},
        }
    uri = "data:;base64," + base64.b64encode(bytes(data)).decode()
    buffers = [{"byteLength": len(data), "uri": uri}]
    return {"asset": {"version": "2.0"}, "accessors": [accessor], "bufferViews": views, "buffers": buffers}


@given(layouts())
def test_random_layouts(tmp_path_factory: pytest.TempPathFactory, document: dict[str, Any]) -> None:
    data = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    parsed, _ = parse_gltf(json.dumps(document).encode())
    read = Buffers(parsed, directory=tmp_path_factory.getbasetemp(), binary=None).floats(0, "here")
    expected = np.array(read_accessor(document, [data], 0), np.float64)
    np.testing.assert_allclose(read.reshape(len(expected), -1), expected, rtol=1e-6)


def test_all_accessors_of_real_models(shared_assets: Path) -> None:
    seen = 0
    for path in sorted(p for p in shared_assets.rglob("*") if p.suffix in (".gltf", ".glb")):
        data, binary = path.read_bytes(), b""
        if path.suffix == ".glb":
            (length,) = struct.unpack_from("<I", data, 12)
            data, binary = data[20 : 20 + length], data[28 + length :]
        document = json.loads(data)
        if sum(accessor["count"] for accessor in document["accessors"]) > 50_000:
            continue  # the plain reader would take a minute
        contents = [content_of(buffer, path, binary) for buffer in document["buffers"]]
        parsed, chunk = parse_gltf(path.read_bytes())
        buffers = Buffers(parsed, directory=path.parent, binary=chunk)
        for index, accessor in enumerate(document["accessors"]):
            if accessor["type"] in COUNTS:
                expected = np.array(read_accessor(document, contents, index), np.float64)
                read = buffers.floats(index, str(path))
                np.testing.assert_allclose(read.reshape(len(expected), -1), expected, rtol=1e-6, err_msg=str(path))
                seen += 1
    assert seen > 100


def content_of(buffer: dict[str, Any], path: Path, binary: bytes) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        return binary
    return base64.b64decode(uri.partition(",")[2]) if uri.startswith("data:") else (path.parent / uri).read_bytes()
