"""What Foxglove and Rerun are given, as others read it: entities, geometry and frames, against their closed forms."""

from __future__ import annotations

import importlib
import json
import math
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Schema

from elys.bus.exports.foxglove_file import export_foxglove
from elys.bus.exports.selection import Selection
from elys.bus.recording import Recording
from elys.common.assets.mesh import Mesh, encode_mesh
from elys.common.components import Material
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import (
    DESPAWNED,
    EDITED,
    IMAGE,
    PERIOD,
    RATE,
    SPAWNED,
    STARTED,
    TICKS,
    poses,
    write_told,
)

fox = pytest.importorskip("foxglove.messages")
NAMES = {2: "Falling", 5: "Wheel", 6: "Guest"}
DRAWN = {"Ground", "Falling", "Lamp", "Wheel", "Picture", "Hand"}


@pytest.fixture
def told(tmp_path: Path) -> Path:
    return write_told(tmp_path / "told.mcap")


def decoded(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Time and message of everything that is protobuf, as the official decoder reads it."""
    decoder = pytest.importorskip("mcap_protobuf.decoder")
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages(topics=["/scene", "/tf", "/log"]):
            found[channel.topic].append((message.log_time, content))
    return found


def vector(message: Any, axes: str = "xyz") -> list[float]:
    return [getattr(message, axis) for axis in axes]


def test_frames_are_where_bodies_were_at_every_tick(told: Path, tmp_path: Path) -> None:
    report = export_foxglove(told, tmp_path / "t.foxglove.mcap")
    frames = decoded(tmp_path / "t.foxglove.mcap")["/tf"]
    assert report.frames == len(frames) == TICKS + 1
    for tick, (now, message) in enumerate(frames):
        assert abs(now - (STARTED + tick * PERIOD)) < 1000
        by_child = {transform.child_frame_id: transform for transform in message.transforms}
        is_there = SPAWNED <= tick < DESPAWNED
        assert set(by_child) == DRAWN | {"scene"} | ({"Guest"} if is_there else set())
        for transform in message.transforms:
            assert transform.timestamp.seconds * 10**9 + transform.timestamp.nanos == now
            assert transform.parent_frame_id == ("world" if transform.child_frame_id == "scene" else "scene")
        for body, (position, rotation) in poses(tick).items():
            if body in NAMES:
                assert vector(by_child[NAMES[body]].translation) == list(position)
                np.testing.assert_array_equal(
                    np.array(vector(by_child[NAMES[body]].rotation, "xyzw"), np.float32), np.array(rotation, np.float32)
                )
        t = tick / RATE
        lamp = [t - 0.5 * math.sin(0.3), 1.0 + 0.5 * math.cos(0.3), 0.0]
        np.testing.assert_allclose(vector(by_child["Lamp"].translation), lamp, atol=1e-6)
        np.testing.assert_allclose(vector(by_child["Hand"].translation), [0.0, t / 2 + 1 + t, 0.0], atol=1e-6)
        ground = [1.0, 0.0, 0.0] if tick >= EDITED else [0.0, 0.0, 0.0]
        assert vector(by_child["Ground"].translation) == ground
    # The world of viewers has z up: what is up here is up there.
    turn = vector(by_child["scene"].rotation, "xyzw")
    assert turn == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])


def test_entities_have_the_right_geometry(told: Path, tmp_path: Path) -> None:
    export_foxglove(told, tmp_path / "t.foxglove.mcap", Selection(start=0.6, end=0.9))
    updates = decoded(tmp_path / "t.foxglove.mcap")["/scene"]
    first, last = updates[0][1], updates[-1][1]
    entities = {entity.frame_id: entity for entity in first.entities}
    assert set(entities) == DRAWN | {"Guest"}
    assert [deletion.type for deletion in first.deletions] == [1]  # ALL
    assert all(entity.frame_locked for entity in first.entities)
    (cube,) = entities["Falling"].cubes
    assert vector(cube.size) == [1.0, 1.0, 1.0]
    # Colours are linear here and as screens take them there: sRGB of 1, 0.5 and 0.25.
    np.testing.assert_allclose(vector(cube.color, "rgba"), [1.0, 0.735357, 0.537099, 1.0], atol=1e-5)
    assert vector(entities["Lamp"].spheres[0].size) == [0.5, 0.5, 0.5]
    for name, size, top in (("Wheel", [1.0, 1.0, 1.0], 1.0), ("Guest", [2.0, 2.0, 2.0], 0.0)):
        (cylinder,) = entities[name].cylinders
        assert (vector(cylinder.size), cylinder.bottom_scale, cylinder.top_scale) == (size, 1.0, top)
        x, y, z, w = vector(cylinder.pose.orientation, "xyzw")
        up = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]  # where its z, the tip's way, points
        np.testing.assert_allclose(up, [0.0, 1.0, 0.0], atol=1e-12)
    (ground,) = entities["Ground"].triangles
    corners = np.array([vector(point) for point in ground.points])
    assert (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()) == ([-2.0, 0.0, -2.0], [2.0, 0.0, 2.0])
    assert len(ground.indices) == 6
    capsule = np.array([vector(point) for point in entities["Hand"].triangles[0].points])
    scale = 1.0 + 36 / RATE  # its arm's, which is animated
    np.testing.assert_allclose(capsule.max(axis=0) - capsule.min(axis=0), np.array([0.5, 1.0, 0.5]) * scale, rtol=1e-6)
    (model,) = entities["Picture"].models
    assert model.media_type == "model/gltf-binary" and model.data[:4] == b"glTF" and IMAGE in model.data
    assert {e.frame_id for e in last.entities} == set(entities)


def test_what_looks_the_same_is_not_told_again(tmp_path: Path) -> None:
    told = write_told(tmp_path / "told.mcap")
    export_foxglove(told, tmp_path / "t.foxglove.mcap", Selection(entities=("Falling", "Guest", "Ground")))
    updates = decoded(tmp_path / "t.foxglove.mcap")["/scene"]
    ticks = [round((now - STARTED) / PERIOD) for now, _ in updates]
    assert ticks == [0, SPAWNED, DESPAWNED]
    assert [sorted(e.frame_id for e in update.entities) for _, update in updates] == [
        ["Falling", "Ground"],
        ["Falling", "Ground", "Guest"],
        ["Falling", "Ground"],
    ]


def test_lines_of_the_log_and_messages_to_plot(told: Path, tmp_path: Path) -> None:
    export_foxglove(told, tmp_path / "t.foxglove.mcap")
    lines = decoded(tmp_path / "t.foxglove.mcap")["/log"]
    assert [(m.message, m.level, m.name) for _, m in lines] == [
        (f"tick {t}", 3, "sim") for t in range(0, TICKS + 1, 10)
    ]
    with (tmp_path / "t.foxglove.mcap").open("rb") as file:
        events = list(make_reader(file, validate_crcs=True).iter_messages(topics=["/events"]))
    assert [json.loads(message.data)["tick"] for _, _, message in events] == list(range(0, TICKS + 1, 10))
    assert events[0][0].encoding == "jsonschema" and json.loads(events[0][0].data)["type"] == "object"


def test_the_sdk_encodes_the_same_as_the_template() -> None:
    from elys.bus.exports.foxglove_scene import FrameTransforms

    protobuf = pytest.importorskip("google.protobuf")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    assert protobuf
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(fox.FrameTransforms.get_schema().data).file:
        pool.Add(file)
    cls = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.FrameTransforms"))
    random, transforms = np.random.default_rng(2), FrameTransforms()
    names = [f"body #{number} é" for number in range(50)]
    for now in (0, 1, 999_999_999, 1_700_000_000_000_000_000, 4_000_000_000_123_456_789, 127 * 10**9 + 128):
        numbers = random.normal(size=(50, 7)) * 10.0 ** random.integers(-300, 300, (50, 7))
        numbers[0] = 0.0
        read = cls.FromString(transforms.encode(names, numbers, now))
        made = [
            fox.FrameTransform(
                timestamp=fox.Timestamp(sec=now // 10**9, nsec=now % 10**9),
                parent_frame_id="scene",
                child_frame_id=name,
                translation=fox.Vector3(x=row[0], y=row[1], z=row[2]),
                rotation=fox.Quaternion(x=row[3], y=row[4], z=row[5], w=row[6]),
            )
            for name, row in zip(names, numbers.tolist(), strict=True)
        ]
        expected = cls.FromString(fox.FrameTransforms(transforms=made).encode())
        for mine, theirs in zip(read.transforms[1:], expected.transforms, strict=True):
            assert vector(mine.translation) == vector(theirs.translation)
            assert vector(mine.rotation, "xyzw") == vector(theirs.rotation, "xyzw")
            assert (mine.timestamp, mine.child_frame_id) == (theirs.timestamp, theirs.child_frame_id)


def test_the_urdf_has_a_link_for_every_frame(told: Path, tmp_path: Path) -> None:
    export_foxglove(told, tmp_path / "t.foxglove.mcap", Selection(end=0.1))
    with (tmp_path / "t.foxglove.mcap").open("rb") as file:
        ((schema, channel, message),) = make_reader(file).iter_messages(topics=["/robot_description"])
    assert (schema.name, schema.encoding, channel.message_encoding) == ("std_msgs/msg/String", "ros2msg", "cdr")
    size = int.from_bytes(message.data[4:8], "little")
    assert message.data[:4] == b"\0\1\0\0" and len(message.data) == 8 + size and message.data[-1] == 0
    robot = ElementTree.fromstring(message.data[8:-1])
    assert {link.get("name") for link in robot.iter("link")} == DRAWN | {"world", "scene"}
    box = robot.find("link[@name='Falling']/visual/geometry/box")
    assert box is not None and box.get("size") == "1.0 1.0 1.0"
    # A tree: each link but the root is somebody's child once.
    children = [joint.find("child").get("link") for joint in robot.iter("joint")]  # type: ignore[union-attr]
    assert sorted(children) == sorted(DRAWN | {"scene"})


def test_a_urdf_of_odd_names_can_be_read() -> None:
    from elys.bus.exports.urdf import Link, urdf_of

    names = ['a "b" <c> & d', "tab\t nul\0 bell\7", "é 東京"]
    links = [
        Link(name, "mesh", (1.0, 2.0, -3.0), (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) for name in names
    ]
    robot = ElementTree.fromstring(urdf_of("x\1", "world", "scene", links))
    found = [link.get("name") for link in robot.iter("link")][2:]
    assert found[0] == names[0] and found[2] == names[2]
    box = robot.find("link/visual/geometry/box")
    assert box is not None and box.get("size") == "1.0 2.0 3.0"
    origin = robot.find("link/visual/origin")
    assert origin is not None and origin.get("xyz") == "0.5 1.0 -1.5"


def test_rerun_draws_boxes_on_the_frames(told: Path, tmp_path: Path) -> None:
    chunks = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed here")
    program = shutil.which("rerun", path=str(Path(sys.executable).parent)) or shutil.which("rerun")
    if program is None:
        pytest.skip("there is no rerun command here")
    export_foxglove(told, tmp_path / "t.foxglove.mcap")
    done = subprocess.run(
        [program, "mcap", "convert", tmp_path / "t.foxglove.mcap", "-o", tmp_path / "t.rrd"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    boxes: dict[str, list[float]] = {}
    where: dict[str, dict[int, list[float]]] = defaultdict(dict)
    for chunk in chunks.RrdReader(str(tmp_path / "t.rrd")).stream():
        batch = chunk.to_record_batch()
        table = {name: batch.column(name) for name in batch.schema.names}
        if "Boxes3D:half_sizes" in table:
            boxes[str(chunk.entity_path).split("/")[-2]] = table["Boxes3D:half_sizes"][0].as_py()[0]
        if "Transform3D:child_frame" in table and "message_log_time" in table:
            times = table["message_log_time"].cast("int64").to_pylist()
            places = table["Transform3D:translation"].to_pylist()
            for now, child, place in zip(times, table["Transform3D:child_frame"].to_pylist(), places, strict=True):
                where[child[0]][round((now - STARTED) / PERIOD)] = place[0]
    assert boxes["Falling"] == [0.5, 0.5, 0.5]
    for tick in (0, 17, TICKS):
        assert where["Falling"][tick] == pytest.approx([0.0, 5.0 - tick / RATE, 0.0], abs=1e-6)
        assert where["Wheel"][tick] == pytest.approx([tick / RATE, 0.0, 1.0], abs=1e-6)


def test_the_official_reader_for_javascript_reads_every_message(told: Path, tmp_path: Path, node_js: Any) -> None:
    export_foxglove(told, tmp_path / "t.foxglove.mcap")
    for path in (told, tmp_path / "t.foxglove.mcap"):
        found = node_js("mcap_core.mjs", path, needs=("@mcap/core", "fzstd"))
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None and summary.statistics is not None
        assert sum(told["count"] for told in found.values()) == summary.statistics.message_count
        assert all(told["schema"] and told["json"] in (0, told["count"]) for told in found.values())
    plain = node_js("mcap_core.mjs", told, needs=("@mcap/core", "fzstd"))
    assert plain["state"]["count"] == TICKS + 1 and plain["state"]["schema"] == "elys.StateFrame"
    with Recording(told) as recording:
        sizes = [len(message.body) for message in recording.reader.stored_messages(("state",))]
    assert plain["state"]["bytes"] == sum(sizes)


def test_without_the_sdk_there_is_a_sentence(told: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("elys.bus.exports.foxglove_scene", "elys.bus.exports.foxglove_shapes"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(RecordingError, match=r"pip install 'elys\[foxglove\]'"):
        export_foxglove(told, tmp_path / "t.foxglove.mcap")
    assert not (tmp_path / "t.foxglove.mcap").exists()


@pytest.mark.parametrize("log_time", [0, 1, (1 << 63) - 1])
def test_times_that_cannot_be_are_the_nearest_that_can(tmp_path: Path, log_time: int) -> None:
    from elys.bus.transports.mcap import McapWriter
    from tests.unit.bus.told_recordings import messages

    writer = McapWriter(tmp_path / "odd.mcap", session="told", scene="Told")
    for channel, body, _ in messages(first=20, last=25):
        writer.write(channel, body, log_time=log_time)
    writer.close()
    export_foxglove(tmp_path / "odd.mcap", tmp_path / "t.foxglove.mcap")
    assert len(decoded(tmp_path / "t.foxglove.mcap")["/tf"]) == 6


@pytest.mark.parametrize("topology", ["triangles", "lines", "points"])
def test_a_mesh_with_colours_is_told_by_what_it_consists_of(topology: str) -> None:
    """Points are in a model, for want of a primitive; colours are multiplied as light, and told as screens take them."""
    decoders = pytest.importorskip("mcap_protobuf.decoder").DecoderFactory()
    shapes = importlib.import_module("elys.bus.exports.foxglove_shapes")  # needs foxglove
    positions = np.array(((0, 0, 0), (1, 0, 0), (0, 1, 0)), np.float32)
    mesh = Mesh(
        positions=positions,
        normals=np.tile(np.float32((0, 1, 0)), (3, 1)),
        uvs=np.zeros((3, 2), np.float32),
        indices=np.array((0, 1, 1, 2, 2, 0), np.uint32),
        colors=np.tile(np.float32((1.0, 0.5, 0.25, 0.5)), (3, 1)),
        topology=topology,
    )
    told = shapes.Shapes(lambda _: encode_mesh(mesh)).primitives(
        "blake2b:" + "0" * 32, Material(base_color=(0.5, 0.5, 1.0)), (1.0, 2.0, 3.0)
    )
    found = fox.SceneUpdate.get_schema()
    schema = Schema(id=1, name=found.name, encoding=found.encoding, data=found.data)
    decode = decoders.decoder_for("protobuf", schema)
    (entity,) = decode(fox.SceneUpdate(entities=[fox.SceneEntity(**told)]).encode()).entities
    if topology == "points":
        assert entity.models[0].data[:4] == b"glTF"
        return
    (shape,) = getattr(entity, topology)
    assert [vector(point) for point in shape.points] == [[0, 0, 0], [1, 0, 0], [0, 2, 0]]
    assert list(shape.indices) == [0, 1, 1, 2, 2, 0]
    # sRGB of 0.5, 0.25 and 0.25.
    np.testing.assert_allclose(
        [vector(c, "rgba") for c in shape.colors], [[0.735357, 0.537099, 0.537099, 0.5]] * 3, atol=1e-5
    )
