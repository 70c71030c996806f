"""A recording of a scene whose motion is known in closed form, written without a simulation.

Ground            a plane of 4 m, still, edited once: moved by 1 m along x at EDITED
Falling           a box: (0, 5 - t, 0), turning about y by t rad
Carrier           a body without a mesh: (t, 1, 0), turned about z by 0.3 rad
  Lamp            a sphere of 0.5 m, half a metre above its carrier, in its space
  Wheel           a body below it, a cylinder: (t, 0, 1), turning about x by 2 t
Guest             a cone of 2 m, there from SPAWNED to DESPAWNED: (3, t, 0)
Picture           an asset of two triangles with a texture, and a morph target whose weight is t / 10
Arm               animated: (0, t / 2, 0) below the scene, scale 1 + t, without a mesh
  Hand            a capsule at its end
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from elys.bus import codec, topics
from elys.bus.messages.scene import ComponentSet, Despawned, SceneChange, SceneDelta, Spawned
from elys.bus.messages.session import Event, EventBatch, LogLine
from elys.bus.messages.state_frame import StateFrame, pack_frame
from elys.bus.mirror import SceneMirror
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import McapWriter
from elys.common.assets.images import placeholder_image
from elys.common.assets.mesh import Mesh, encode_mesh
from elys.common.assets.store import reference_of

RATE = 60
TICKS = 120
SPAWNED, EDITED, DESPAWNED = 30, 45, 90
GROUND, FALLING, CARRIER, LAMP, WHEEL, GUEST, PICTURE, ARM, HAND = range(1, 10)
STARTED = 1_700_000_000_000_000_000  # [ns] log time of tick 0
PERIOD = 1_000_000_000 // RATE
IMAGE = placeholder_image()
PICTURE_MESH = encode_mesh(
    Mesh(
        positions=np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
        uvs=np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32),
        indices=np.array([0, 1, 2, 0, 2, 3], np.uint32),
        target_positions=np.tile(np.array([0, 0, 1], np.float32), (1, 4, 1)),
        target_normals=np.zeros((1, 4, 3), np.float32),
    )
)


def about(axis: int, angle: float) -> tuple[float, float, float, float]:
    """A turn about x, y or z [rad]."""
    turn = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    turn[axis] = math.sin(angle / 2)
    return turn[0], turn[1], turn[2], turn[3]


def spawned(entity: int, name: str, parent: int = 0, **components: dict[str, object]) -> Spawned:
    return Spawned(entity=entity, name=name, parent=parent, enabled=True, components=components)


SCENE = (
    spawned(GROUND, "Ground", MeshRenderer={"mesh": "plane"}, Transform={"scale": (4.0, 1.0, 4.0)}),
    spawned(FALLING, "Falling", MeshRenderer={"mesh": "box"}, RigidBody={}, Material={"base_color": (1.0, 0.5, 0.25)}),
    spawned(CARRIER, "Carrier", RigidBody={}),
    spawned(
        LAMP,
        "Lamp",
        CARRIER,
        MeshRenderer={"mesh": "sphere"},
        Transform={"position": (0.0, 0.5, 0.0), "scale": (0.5, 0.5, 0.5)},
        Light={"kind": "point", "intensity": 10.0},
    ),
    spawned(WHEEL, "Wheel", CARRIER, MeshRenderer={"mesh": "cylinder"}, RigidBody={}),
    spawned(
        PICTURE,
        "Picture",
        MeshRenderer={"mesh": reference_of(PICTURE_MESH)},
        Material={"base_color_texture": reference_of(IMAGE) + "?scale=2,2", "roughness": 0.25},
        Transform={"position": (-2.0, 0.0, 0.0)},
    ),
    spawned(ARM, "Arm"),
    spawned(HAND, "Hand", ARM, MeshRenderer={"mesh": "capsule"}, Transform={"position": (0.0, 1.0, 0.0)}),
)
GUEST_SPAWNED = spawned(
    GUEST, "Guest", MeshRenderer={"mesh": "cone"}, RigidBody={}, Transform={"scale": (2.0, 2.0, 2.0)}
)
GROUND_MOVED = ComponentSet(
    entity=GROUND, component="Transform", values={"position": (1.0, 0.0, 0.0), "scale": (4.0, 1.0, 4.0)}
)
Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


def poses(tick: int) -> dict[int, Pose]:
    """Where each body is in the world at a tick."""
    t = tick / RATE
    found: dict[int, Pose] = {
        FALLING: ((0.0, 5.0 - t, 0.0), about(1, t)),
        CARRIER: ((t, 1.0, 0.0), about(2, 0.3)),
        WHEEL: ((t, 0.0, 1.0), about(0, 2 * t)),
    }
    if SPAWNED <= tick < DESPAWNED:
        found[GUEST] = ((3.0, t, 0.0), about(0, 0.0))
    return found


def frame_at(tick: int, sequence: int, *, epoch: int = 7) -> StateFrame:
    """The state frame of a tick."""
    t, bodies = tick / RATE, poses(tick)
    return StateFrame(
        epoch=epoch,
        tick=tick,
        simulation_time=t,
        published_at=STARTED + tick * PERIOD,
        delta_sequence=sequence,
        state_hash=tick * 31 + 1,
        playing=True,
        position=np.array([position for position, _ in bodies.values()], np.float64),
        rotation=np.array([rotation for _, rotation in bodies.values()], np.float32),
        linear_velocity=np.tile(np.array([t, -1.0, 0.5], np.float32), (len(bodies), 1)),
        angular_velocity=np.zeros((len(bodies), 3), np.float32),
        entity=np.array(list(bodies), np.uint32),
        local_position=np.array([[0.0, t / 2, 0.0]], np.float32),
        local_rotation=np.array([[0.0, 0.0, 0.0, 1.0]], np.float32),
        local_scale=np.full((1, 3), 1.0 + t, np.float32),
        local_entity=np.array([ARM], np.uint32),
        weight=np.array([t / 10], np.float32),
        weight_entity=np.array([PICTURE], np.uint32),
        weight_target=np.array([0], np.uint32),
    )


def messages(*, epoch: int = 7, first: int = 0, last: int = TICKS) -> Iterator[tuple[str, bytes, int]]:
    """Channel, body and log time of all that is recorded from `first` to `last`, with the scene as it is at first."""
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence, mirror.scene = epoch, 0, "Told"

    def delta(tick: int, *changes: SceneChange) -> SceneDelta:
        made = SceneDelta(epoch=epoch, sequence=mirror.sequence + 1, tick=tick, changes=changes)
        mirror.apply_delta(made)
        return made

    delta(0, *SCENE)
    edits = {SPAWNED: GUEST_SPAWNED, EDITED: GROUND_MOVED, DESPAWNED: Despawned(entity=GUEST)}
    for tick in range(last + 1):
        now = STARTED + tick * PERIOD
        made = delta(tick, edits[tick]) if tick in edits else None
        if tick == first:
            yield topics.SNAPSHOT.name, codec.encode_body(mirror.to_snapshot(), Encoding.JSON), now
        elif made is not None and tick > first:
            yield topics.DELTA.name, codec.encode_body(made, Encoding.JSON), now
        if tick < first:
            continue
        yield topics.STATE.name, pack_frame(frame_at(tick, mirror.sequence, epoch=epoch)), now
        if tick % 10 == 0:
            events = EventBatch(epoch=epoch, tick=tick, events=(Event(kind="hit", entity=1, values={"tick": tick}),))
            yield topics.EVENTS.name, codec.encode_body(events, Encoding.JSON), now + 1
            line = LogLine(node="sim", level="warning", text=f"tick {tick}", time=now / 1e9, tick=tick)
            yield topics.LOG.name, codec.encode_body(line, Encoding.JSON), now + 2


def write_told(
    path: Path, *, finished: bool = True, epoch: int = 7, first: int = 0, last: int = TICKS, chunk: int = 1 << 20
) -> Path:
    """Writes the recording, or a part of it, in chunks of so many bytes."""
    writer = McapWriter(path, session="told", scene="Told")
    for data in (PICTURE_MESH, IMAGE):
        writer.attach(reference_of(data), data, media_type="application/octet-stream")
    for channel, body, now in messages(epoch=epoch, first=first, last=last):
        writer.write(channel, body, log_time=now)
        if writer._chunk_bytes > chunk:
            writer._flush()
    if finished:
        writer.close()
    else:  # as a kill leaves it
        writer._flush()
        writer._file.close()
    return path
