"""A scene as Foxglove's messages: entities that stand in frames of their own, and where the frames are.

    world           z up, as viewers of robots have it
    └── scene       y up: the world of ELYS
        └── NAME    a frame an entity that is drawn; its geometry never moves in it

So what something looks like is told when it changes, and where it is each tick: see https://docs.foxglove.dev/docs/sdk/schemas.
Needs foxglove-sdk (extra `foxglove`).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import numpy as np
from foxglove import messages as fox
from numpy.typing import NDArray

from elys.bus.exports.foxglove_shapes import Shapes, srgb
from elys.bus.exports.model_nodes import is_seen
from elys.bus.exports.urdf import Link, urdf_of
from elys.bus.mirror import SceneMirror
from elys.common.components import Material, MeshRenderer

WORLD: Final = "world"
SCENE: Final = "scene"
SCENE_TOPIC: Final = "/scene"
TRANSFORM_TOPIC: Final = "/tf"
LOG_TOPIC: Final = "/log"
_UPRIGHT: Final = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # y up as z up
_SECONDS: Final = 1_700_000_000  # of a template: as many bytes as any second from 1978 to 2106 takes
_LEVELS: Final = {
    "debug": fox.LogLevel.Debug,
    "info": fox.LogLevel.Info,
    "warning": fox.LogLevel.Warning,
    "error": fox.LogLevel.Error,
}  # Numbers whose bytes nothing else has.
_MARKS: Final = tuple(
    float(np.frombuffer(bytes((0xA0 + k, 0x5B, 0xC3 + k, 0x91, 0x7E, 0x33 + k, 0xF1, 0x3F)), "<f8")[0])
    for k in range(7)
)

Poses = NDArray[np.float64]


class FrameNames:
    """The frame of each entity: its name, with its number where another has that name already."""

    def __init__(self) -> None:
        self._frames: dict[int, str] = {}
        self._taken = {WORLD, SCENE, ""}

    def of(self, mirror: SceneMirror, entity: int) -> str:
        """The frame of an entity, the same as long as this lives."""
        if entity not in self._frames:
            name = mirror.entities[entity].name
            frame = name if name not in self._taken else f"{name}#{entity}"
            self._taken.add(frame)
            self._frames[entity] = frame
        return self._frames[entity]


class FoxgloveScene:
    """What is drawn of a scene, as messages that are made anew only for what has changed.

    Attributes:
        drawn: entities with a frame, in order.
    """

    def __init__(self, fetch: Callable[[str], bytes]) -> None:
        self.names = FrameNames()
        self.drawn: list[int] = []
        self._shapes = Shapes(fetch)
        self._scales = b""
        self._encoded: dict[int, tuple[Any, bytes]] = {}  # entity -> what it was made of, and the message

    def may_differ(self, mirror: SceneMirror) -> bool:
        """Whether the frame that the mirror has scales anything otherwise than the one before: sizes are told with looks."""
        frame = mirror.latest_frame
        scales = b"" if frame is None else frame.local_scale.tobytes()
        before, self._scales = self._scales, scales
        return scales != before

    def follow(self, mirror: SceneMirror, time: int, chosen: set[int] | None = None) -> bytes | None:
        """A `foxglove.SceneUpdate` with everything (that is chosen), if anything looks another way than before; else None.

        `time` [ns] is that of the message.
        """
        before = {entity: looks for entity, (looks, _) in self._encoded.items()}
        looks = {
            entity.id: self._looks(mirror, entity.id)
            for entity in mirror.in_order()
            if (chosen is None or entity.id in chosen) and _is_drawn(mirror, entity.id)
        }
        self.drawn = list(looks)
        if looks == before and before:
            return None
        self._encoded = {
            entity: self._encoded[entity]
            if before.get(entity) == look
            else (look, self._encode(mirror, entity, look, time))
            for entity, look in looks.items()
        }
        return self.whole(time)

    def whole(self, time: int) -> bytes:
        """A `foxglove.SceneUpdate` with everything that is drawn, after deleting what was: who joins late needs no other."""
        deletion = fox.SceneEntityDeletion(timestamp=stamp(time), type=fox.SceneEntityDeletionType.All)
        # Messages of protobuf one after the other are one message with all that both repeat.
        return bytes(fox.SceneUpdate(deletions=[deletion]).encode()) + b"".join(
            made for _, made in self._encoded.values()
        )

    def frames(self, mirror: SceneMirror) -> tuple[list[str], Poses]:
        """Names [N] of all frames but `scene` and their poses in it [N, 7]: position [m], then rotation x y z w."""
        there = [entity for entity in self.drawn if entity in mirror.entities]
        poses = np.empty((len(there), 7))
        frame, rows = mirror.latest_frame, np.full(len(there), -1)
        for place, entity in enumerate(there):
            row = mirror.frame_row(entity)
            if row >= 0:
                rows[place] = row
            else:
                pose = mirror.world_pose(entity)
                poses[place] = (*pose.position, *pose.rotation)
        moving = np.flatnonzero(rows >= 0)
        if frame is not None and len(moving):
            poses[moving, :3], poses[moving, 3:] = frame.position[rows[moving]], frame.rotation[rows[moving]]
        return [self.names.of(mirror, entity) for entity in there], poses

    def urdf(self, mirror: SceneMirror) -> str:
        """What is drawn as a URDF, see `elys.bus.exports.urdf`."""
        links = []
        for entity in self.drawn:
            mesh, material, scale = self._encoded[entity][0]
            red, green, blue = (srgb(channel) for channel in material.base_color)
            color = (red, green, blue, material.opacity if material.alpha_mode == "blend" else 1.0)
            links.append(Link(self.names.of(mirror, entity), mesh, scale, color, *self._shapes.bounds(mesh)))
        return urdf_of(mirror.scene or "elys", WORLD, SCENE, links)

    def _looks(self, mirror: SceneMirror, entity: int) -> Any:
        components = mirror.entities[entity].components
        drawing, material = components["MeshRenderer"], components.get("Material", Material())
        assert isinstance(drawing, MeshRenderer)
        return drawing.mesh, material, mirror.world_pose(entity).scale

    def _encode(self, mirror: SceneMirror, entity: int, looks: Any, time: int) -> bytes:
        mesh, material, scale = looks
        name = mirror.entities[entity].name
        made = fox.SceneEntity(
            timestamp=stamp(time),
            frame_id=self.names.of(mirror, entity),
            id=str(entity),
            frame_locked=True,
            metadata=[fox.KeyValuePair(key="name", value=name), fox.KeyValuePair(key="mesh", value=mesh)],
            **self._shapes.primitives(mesh, material, scale),
        )
        return bytes(fox.SceneUpdate(entities=[made]).encode())


class FrameTransforms:
    """`foxglove.FrameTransforms` of the same frames again and again: one that was encoded once, with other numbers put in.

    Encoding a thousand anew takes twenty times as long.
    """

    def __init__(self) -> None:
        self._names: list[str] = []
        self._template = np.zeros(0, np.uint8)
        self._times: NDArray[np.intp] = np.zeros(0, np.intp)
        self._numbers: NDArray[np.intp] = np.zeros(0, np.intp)

    def encode(self, names: Sequence[str], poses: Poses, time: int) -> bytes:
        """The message: `scene` in `world`, then frames `names` [N] at `poses` [N, 7] in `scene`, at `time` [ns]."""
        if list(names) != self._names or not len(self._template):
            self._make(list(names))
        data = self._template.copy()
        data[self._times] = np.frombuffer(
            _varint(time // 1_000_000_000, 5) + _varint(time % 1_000_000_000, 5), np.uint8
        )
        data[self._numbers] = np.ascontiguousarray(poses, "<f8").reshape(-1, 7).view(np.uint8).reshape(len(names), 7, 8)
        return data.tobytes()

    def _make(self, names: list[str]) -> None:
        """Encodes each frame with numbers that are found again in the bytes."""
        parts, times, numbers, place = [_upright()], [_time_place(_upright())], [], len(_upright())
        for name in names:
            made = _transform(SCENE, name, _MARKS[:3], _MARKS[3:])
            parts.append(made)
            times.append(place + _time_place(made))
            numbers.append([place + made.index(struct.pack("<d", mark)) for mark in _MARKS])
            place += len(made)
        self._names = names
        self._template = np.frombuffer(b"".join(parts), np.uint8)
        # A tag stands between the seconds and the nanoseconds.
        offsets = np.array([0, 1, 2, 3, 4, 6, 7, 8, 9, 10])
        self._times = np.array(times, np.intp)[:, None] + offsets
        self._numbers = np.array(numbers, np.intp).reshape(-1, 7, 1) + np.arange(8)


def stamp(time: int) -> Any:
    """A moment [ns] as the library has it."""
    return fox.Timestamp(sec=time // 1_000_000_000, nsec=time % 1_000_000_000)


def log_message(time: int, level: str, text: str, node: str) -> bytes:
    """A `foxglove.Log`."""
    return bytes(
        fox.Log(timestamp=stamp(time), level=_LEVELS.get(level, fox.LogLevel.Info), message=text, name=node).encode()
    )


def schemas() -> dict[str, Any]:
    """The schema of each topic."""
    return {
        SCENE_TOPIC: fox.SceneUpdate.get_schema(),
        TRANSFORM_TOPIC: fox.FrameTransforms.get_schema(),
        LOG_TOPIC: fox.Log.get_schema(),
    }


def _upright() -> bytes:
    return _transform(WORLD, SCENE, (0.0, 0.0, 0.0), _UPRIGHT)


def _transform(parent: str, child: str, position: Iterable[float], rotation: Iterable[float]) -> bytes:
    made = fox.FrameTransform(
        timestamp=fox.Timestamp(sec=_SECONDS, nsec=999_999_999),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=fox.Vector3(**dict(zip("xyz", position, strict=True))),
        rotation=fox.Quaternion(**dict(zip("xyzw", rotation, strict=True))),
    )
    return bytes(fox.FrameTransforms(transforms=[made]).encode())


def _time_place(made: bytes) -> int:
    """Where the seconds of a transform's moment begin."""
    return made.index(_varint(_SECONDS, 5))


def _varint(number: int, size: int) -> bytes:
    """A number of protobuf in exactly so many bytes: the last bit but one of each says that more follow, zeros included."""
    bits = [(number >> (7 * place)) & 0x7F for place in range(size)]
    return bytes([*(part | 0x80 for part in bits[:-1]), bits[-1]])


def _is_drawn(mirror: SceneMirror, entity: int) -> bool:
    return "MeshRenderer" in mirror.entities[entity].components and is_seen(mirror, entity)
