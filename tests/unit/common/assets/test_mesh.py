"""Meshes as bytes, sound and hostile; and the built-in ones against their closed forms."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.assets import PRIMITIVES, Mesh, decode_mesh, encode_mesh, primitive
from elys.common.assets.store import reference_of
from elys.common.errors import AssetError


def triangle(**fields: np.ndarray) -> Mesh:
    arrays = {
        "positions": np.array(((0, 0, 0), (1, 0, 0), (0, 1, 0)), dtype=np.float32),
        "normals": np.tile(np.float32((0, 0, 1)), (3, 1)),
        "uvs": np.zeros((3, 2), dtype=np.float32),
        "indices": np.array((0, 1, 2), dtype=np.uint32),
    }
    return Mesh(**(arrays | fields))


def same(a: Mesh, b: Mesh) -> bool:
    for name in ("positions", "normals", "uvs", "indices", "tangents", "colors"):
        x, y = getattr(a, name), getattr(b, name)
        if (x is None) != (y is None) or (x is not None and not (np.array_equal(x, y) and x.dtype == y.dtype)):
            return False
    return True


@given(st.integers(0, 40), st.integers(0, 30), st.booleans(), st.booleans(), st.integers(0, 2**32 - 1))
def test_decoding_undoes_encoding(vertices: int, triangles: int, tangents: bool, colors: bool, seed: int) -> None:
    chance = np.random.default_rng(seed)

    def floats(width: int) -> np.ndarray:
        return chance.normal(size=(vertices, width)).astype(np.float32)

    mesh = Mesh(
        positions=floats(3),
        normals=floats(3),
        uvs=floats(2),
        indices=chance.integers(0, max(vertices, 1), 3 * triangles if vertices else 0).astype(np.uint32),
        tangents=floats(4) if tangents else None,
        colors=floats(4) if colors else None,
    )
    data = encode_mesh(mesh)
    assert same(decode_mesh(data), mesh)
    assert encode_mesh(decode_mesh(data)) == data


def test_a_decoded_mesh_is_a_read_only_view() -> None:
    mesh = decode_mesh(encode_mesh(triangle()))
    with pytest.raises(ValueError, match="read-only"):
        mesh.positions[0] = 1.0
    assert (mesh.vertex_count, mesh.triangle_count) == (3, 1)
    assert np.array_equal(mesh.bounds, ((0, 0, 0), (1, 1, 0)))


@pytest.mark.parametrize(("topology", "indices"), [("lines", (0, 1, 1, 2)), ("points", (2, 0)), ("points", ())])
def test_lines_and_points_keep_what_they_are(topology: str, indices: tuple[int, ...]) -> None:
    mesh = replace(triangle(indices=np.array(indices, np.uint32)), topology=topology)
    data = encode_mesh(mesh)
    found = decode_mesh(data)
    assert (found.topology, found.indices.tolist()) == (topology, list(indices))
    assert (found.triangle_count, found.is_surface) == (0, False)
    assert encode_mesh(found) == data != encode_mesh(triangle())


def test_hashes_of_triangles_are_those_of_before_there_were_lines() -> None:
    """Of the code of then: scenes, recordings and caches name meshes by them."""
    morphed = triangle(
        colors=np.tile(np.float32((1, 0.5, 0.25, 1)), (3, 1)),
        target_positions=np.ones((2, 3, 3), np.float32),
        target_normals=np.zeros((2, 3, 3), np.float32),
    )
    assert reference_of(encode_mesh(triangle())) == "blake2b:c8643bc3bf3826984fa940bf800aae0b"
    assert reference_of(encode_mesh(morphed)) == "blake2b:daffb680124d85c4df0ab491c1042c44"
    assert reference_of(encode_mesh(primitive("box"))) == "blake2b:94b41ca64b6bb1d6ea4978fa23138360"


def with_header(data: bytes, **changes: object) -> bytes:
    (size,) = struct.unpack_from("<I", data, 8)
    header = json.loads(data[12 : 12 + size]) | changes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    return data[:8] + struct.pack("<I", len(text)) + text + data[12 + size :]


GOOD = encode_mesh(triangle())
LINES = encode_mesh(replace(triangle(indices=np.array((0, 1), dtype=np.uint32)), topology="lines"))
NOT_FINITE = encode_mesh(triangle(uvs=np.full((3, 2), np.nan, dtype=np.float32)))
HOSTILE = {
    "nothing": b"",
    "short": GOOD[:11],
    "another file": b"\x89PNG\r\n\x1a\n" + bytes(60),
    "another version": GOOD[:4] + b"\x02\0" + GOOD[6:],
    "huge header": GOOD[:8] + b"\xfc\xff\xff\xff" + GOOD[12:],
    "odd header": GOOD[:8] + b"\x03\0\0\0" + GOOD[12:],
    "header of garbage": GOOD[:12] + b"\xff" * (len(GOOD) - 12),
    "cut off": GOOD[:-1],
    "too long": GOOD + b"\0",
    "negative": with_header(GOOD, vertex_count=-3),
    "overflow": with_header(GOOD, vertex_count=2**62, index_count=3 * 2**61),
    "huge count": with_header(GOOD, vertex_count=10**30),
    "no triangles": with_header(GOOD, index_count=4),
    "triangles of a line": with_header(LINES, topology="triangles"),
    "lines of a triangle": with_header(GOOD, topology="lines"),
    "unknown topology": with_header(GOOD, topology="patches"),
    "topology of another type": with_header(GOOD, topology=1),
    "no normals": with_header(GOOD, attributes=["positions"]),
    "twice": with_header(GOOD, attributes=["positions", "positions", "normals"]),
    "unknown": with_header(GOOD, attributes=["positions", "normals", "smell"]),
    "more": with_header(GOOD, secret=1),
    "not finite": NOT_FINITE,
    "index out of range": encode_mesh(triangle(indices=np.array((0, 1, 3), dtype=np.uint32))),
    "bomb": GOOD[:8] + struct.pack("<I", 4096) + b"[" * 4096,
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(AssetError, match="mesh"):
        decode_mesh(data)


def test_what_is_wrong_with_lines_is_said_in_a_sentence() -> None:
    with pytest.raises(AssetError, match="a mesh of 'patches'; known are triangles, lines, points"):
        decode_mesh(with_header(GOOD, topology="patches"))
    with pytest.raises(AssetError, match="a mesh of 3 vertices and 3 indices of lines"):
        decode_mesh(with_header(GOOD, topology="lines"))


@given(st.integers(0, len(GOOD) - 1), st.integers(0, 255), st.integers(0, 30))
def test_a_changed_byte_gives_a_sound_mesh_or_an_asset_error(place: int, value: int, cut: int) -> None:
    data = bytearray(GOOD)
    data[place] = value
    try:
        mesh = decode_mesh(bytes(data[: len(data) - cut]))
    except AssetError:
        return
    assert np.isfinite(mesh.positions).all()
    assert (mesh.indices < mesh.vertex_count).all()


@given(st.binary(max_size=80))
def test_any_bytes_behind_the_magic(data: bytes) -> None:
    with pytest.raises(AssetError):
        decode_mesh(b"ELYM" + data)


# Volume and surface of the shapes; a lathe of 32 segments is a little smaller.
CLOSED_FORMS = {
    "box": (1.0, 6.0, 1e-6),
    "sphere": (math.pi / 6, math.pi, 0.02),
    "cylinder": (math.pi / 4, 1.5 * math.pi, 0.01),
    "cone": (math.pi / 12, math.pi / 4 * (1 + math.sqrt(5)), 0.01),
    "capsule": (math.pi * 0.25**2 * (0.5 + 4 / 3 * 0.25), 2 * math.pi * 0.25, 0.02),
    "plane": (0.0, 1.0, 1e-6),
}


@pytest.mark.parametrize("name", PRIMITIVES)
def test_built_in_meshes_are_closed_right_way_round_and_of_the_right_size(name: str) -> None:
    mesh = primitive(name)
    corners = mesh.positions.astype(np.float64)[mesh.indices.reshape(-1, 3)]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    surface = np.linalg.norm(faces, axis=1).sum() / 2
    expected_volume, expected_surface, tolerance = CLOSED_FORMS[name]
    assert volume == pytest.approx(expected_volume, rel=tolerance, abs=1e-9)
    assert surface == pytest.approx(expected_surface, rel=tolerance)
    assert (np.linalg.norm(faces, axis=1) > 1e-6).all()  # no triangle without an area
    outward = mesh.normals[mesh.indices.reshape(-1, 3)].mean(axis=1)
    assert (np.einsum("ij,ij->i", faces, outward) > 0).all()
    if name != "plane":
        assert not open_edges(mesh)


def open_edges(mesh: Mesh) -> set[tuple[bytes, bytes]]:
    """Edges that lack their twin in the other direction."""
    places = [np.round(p.astype(np.float64), 5) + 0.0 for p in mesh.positions]
    edges = set()
    for a, b, c in mesh.indices.reshape(-1, 3):
        for start, end in ((a, b), (b, c), (c, a)):
            edges.add((places[start].tobytes(), places[end].tobytes()))
    return {edge for edge in edges if edge[::-1] not in edges}


@pytest.mark.parametrize("name", PRIMITIVES)
def test_built_in_normals_and_tangents_are_frames_that_follow_the_image(name: str) -> None:
    mesh = primitive(name)
    assert mesh.tangents is not None
    normals, tangents = mesh.normals.astype(np.float64), mesh.tangents.astype(np.float64)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert np.allclose(np.linalg.norm(tangents[:, :3], axis=1), 1.0, atol=1e-6)
    assert np.allclose(np.einsum("ij,ij->i", normals, tangents[:, :3]), 0.0, atol=1e-6)
    rows = mesh.indices.reshape(-1, 3)
    corners, uvs = mesh.positions.astype(np.float64)[rows], mesh.uvs.astype(np.float64)[rows]
    edges, steps = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    sound = np.abs(np.linalg.det(steps)) > 1e-9
    along_u, along_v = np.moveaxis(np.linalg.solve(steps[sound], edges[sound]), 1, 0)
    tangent = tangents[rows[sound]].mean(axis=1)
    bitangent = tangent[:, 3:] * np.cross(normals[rows[sound]].mean(axis=1), tangent[:, :3])
    assert (np.einsum("ij,ij->i", along_u, tangent[:, :3]) > 0).all()
    assert (np.einsum("ij,ij->i", along_v, bitangent) < 0).all()  # v runs down the image


def test_built_in_meshes_fit_a_unit_cube_and_cannot_be_changed() -> None:
    for name in PRIMITIVES:
        lower, upper = primitive(name).bounds
        assert (lower >= -0.5).all()
        assert (upper <= 0.5).all()
        assert np.allclose(lower, -upper, atol=1e-7)
        assert primitive(name) is primitive(name)
        with pytest.raises(ValueError, match="read-only"):
            primitive(name).positions[0] = 0.0
    with pytest.raises(AssetError, match="no mesh 'teapot'; built in are box, sphere"):
        primitive("teapot")
