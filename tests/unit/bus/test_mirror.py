"""The mirror against a plain tree of dictionaries, against 4x4 matrices, and over a session that loses messages."""

from __future__ import annotations

import asyncio
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elys.bus import codec, topics
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    SceneChange,
    SceneDelta,
    SettingsSet,
    Snapshot,
    SnapshotRequest,
    Spawned,
)
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.session import Session
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.components import Component, Transform, component_from
from elys.common.errors import MessageError, RequestError
from elys.common.scene import SceneSettings


class PlainScene:
    """The oracle: a tree kept in the plainest way, which also makes random changes that are possible in it."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.children: dict[int, list[int]] = {0: []}
        self.parent: dict[int, int] = {}
        self.names: dict[int, str] = {}
        self.enabled: dict[int, bool] = {}
        self.components: dict[int, dict[str, Component]] = {}
        self.next_id = 1
        self.settings = SceneSettings()

    def below(self, entity: int) -> list[int]:
        return [entity] + [deeper for child in self.children[entity] for deeper in self.below(child)]

    def change(self) -> SceneChange:
        if len(self.parent) < 3 or self.random.random() < 0.3:
            return self._spawn()
        entity = self.random.choice(sorted(self.parent))
        match self.random.randrange(7):
            case 0:
                for gone in self.below(entity):
                    for table in (self.names, self.enabled, self.components):
                        del table[gone]
                self.children[self.parent[entity]].remove(entity)
                for gone in self.below(entity):
                    del self.parent[gone]
                return Despawned(entity=entity)
            case 1:
                values: dict[str, Any] = {"position": [self.random.random() for _ in range(3)]}
                self.components[entity]["Transform"] = component_from("Transform", values)
                return ComponentSet(entity=entity, component="Transform", values=values)
            case 2:
                self.components[entity].pop("Collider", None)
                return ComponentRemoved(entity=entity, component="Collider")
            case 3:
                self.names[entity] = f"renamed {self.random.random()}"
                return Renamed(entity=entity, name=self.names[entity])
            case 4:
                return self._reparent(entity)
            case 5:
                self.enabled[entity] = not self.enabled[entity]
                return EnabledSet(entity=entity, enabled=self.enabled[entity])
            case _:
                self.settings = SceneSettings(gravity=(0.0, -self.random.random(), 0.0))
                return SettingsSet(settings=self.settings)

    def _spawn(self) -> SceneChange:
        entity, self.next_id = self.next_id, self.next_id + 1
        parent = self.random.choice([0, *sorted(self.parent)])
        radius = round(self.random.uniform(0.1, 1.0), 3)
        values = {"Collider": {"shape": "sphere", "radius": radius}, "MeshRenderer": {"mesh": "box"}}
        self.children[entity] = []
        self.children[parent].append(entity)
        self.parent[entity], self.names[entity], self.enabled[entity] = parent, f"entity {entity}", True
        self.components[entity] = {name: component_from(name, fields) for name, fields in values.items()}
        return Spawned(entity=entity, name=f"entity {entity}", parent=parent, enabled=True, components=values)

    def _reparent(self, entity: int) -> SceneChange:
        parent = self.random.choice([0, *sorted(set(self.parent) - set(self.below(entity)))])
        self.children[self.parent[entity]].remove(entity)
        index = self.random.randint(0, len(self.children[parent]))
        self.children[parent].insert(index, entity)
        self.parent[entity] = parent
        return Reparented(entity=entity, parent=parent, index=index)

    def delta(self, sequence: int, *, epoch: int = 1) -> SceneDelta:
        changes = tuple(self.change() for _ in range(self.random.randrange(1, 4)))
        return SceneDelta(epoch=epoch, sequence=sequence, tick=sequence * 10, changes=changes)

    def assert_same(self, mirror: SceneMirror) -> None:
        assert mirror.roots == self.children[0]
        assert mirror.settings == self.settings
        assert mirror.entities.keys() == self.parent.keys()
        for entity, seen in mirror.entities.items():
            assert (seen.id, seen.name, seen.parent) == (entity, self.names[entity], self.parent[entity])
            assert (seen.enabled, seen.children) == (self.enabled[entity], self.children[entity])
            assert seen.components == self.components[entity]
            ancestors = [entity]
            while self.parent.get(ancestors[-1]):
                ancestors.append(self.parent[ancestors[-1]])
            assert mirror.world_enabled(entity) == all(self.enabled[ancestor] for ancestor in ancestors)


def empty_mirror(*, epoch: int = 1) -> SceneMirror:
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence = epoch, 0
    return mirror


def over_the_wire(snapshot: Snapshot) -> Snapshot:
    return codec.decode(codec.encode(snapshot, Encoding.JSON), Snapshot, Encoding.JSON)


def frame_of(bodies: dict[int, tuple[Any, Any]], *, tick: int = 1, sequence: int = 0, epoch: int = 1) -> StateFrame:
    count = len(bodies)
    return StateFrame(
        epoch=epoch,
        tick=tick,
        simulation_time=tick / 60,
        published_at=tick,
        delta_sequence=sequence,
        state_hash=0,
        playing=True,
        position=np.array([position for position, _ in bodies.values()]).reshape(count, 3),
        rotation=np.array([rotation for _, rotation in bodies.values()], np.float32).reshape(count, 4),
        linear_velocity=np.full((count, 3), 2.0, np.float32),
        angular_velocity=np.full((count, 3), 3.0, np.float32),
        entity=np.array(list(bodies), np.uint32),
    )


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32))
def test_deltas_and_snapshots_keep_a_mirror_equal_to_a_plain_tree(seed: int) -> None:
    scene, mirror = PlainScene(seed), empty_mirror()
    for sequence in range(1, 30):
        mirror.apply_delta(scene.delta(sequence))
        scene.assert_same(mirror)
    joined = SceneMirror()
    joined.apply_snapshot(over_the_wire(mirror.to_snapshot()))
    scene.assert_same(joined)
    assert joined.to_snapshot() == mirror.to_snapshot()
    joined.apply_delta(scene.delta(30))
    scene.assert_same(joined)


def test_a_listener_hears_what_changed_and_what_is_gone() -> None:
    mirror = empty_mirror()
    heard: list[MirrorUpdate] = []
    close = mirror.listen(heard.append)
    spawned = tuple(
        Spawned(entity=entity, name="", parent=entity - 1, enabled=True, components={}) for entity in (1, 2, 3)
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=1, tick=0, changes=spawned))
    mirror.apply_delta(SceneDelta(epoch=1, sequence=2, tick=0, changes=(Despawned(entity=2),)))
    close()
    mirror.apply_snapshot(mirror.to_snapshot())
    assert [update.reset for update in heard] == [False, False]
    assert heard[0].changes == spawned
    assert heard[1].removed == (2, 3)


@pytest.mark.parametrize(
    "change",
    [
        Despawned(entity=9),
        Renamed(entity=9, name=""),
        Reparented(entity=1, parent=2, index=0),
        Reparented(entity=1, parent=9, index=0),
        Spawned(entity=1, name="", parent=0, enabled=True, components={}),
        Spawned(entity=0, name="", parent=0, enabled=True, components={}),
        Spawned(entity=5, name="", parent=9, enabled=True, components={}),
        ComponentSet(entity=1, component="Transform", values={"position": "up"}),
        ComponentSet(entity=1, component="Transform", values={"nonsense": 1}),
    ],
)
def test_changes_that_make_no_sense_are_refused(change: SceneChange) -> None:
    mirror = empty_mirror()
    tree = tuple(Spawned(entity=e, name="", parent=e - 1, enabled=True, components={}) for e in (1, 2))
    mirror.apply_delta(SceneDelta(epoch=1, sequence=1, tick=0, changes=tree))
    with pytest.raises(MessageError):
        mirror.apply_delta(SceneDelta(epoch=1, sequence=2, tick=0, changes=(change,)))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.data())
def test_a_damaged_snapshot_is_refused_or_harmless(seed: int, data: st.DataObject) -> None:
    scene, mirror = PlainScene(seed), empty_mirror()
    for sequence in range(1, 8):
        mirror.apply_delta(scene.delta(sequence))
    payload = bytearray(codec.encode(mirror.to_snapshot(), Encoding.JSON))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(8, len(payload) - 1))] = data.draw(st.sampled_from(b'09aAzZ"[]{},:/='))
    try:
        mirror.apply_snapshot(codec.decode(bytes(payload), Snapshot, Encoding.JSON))
    except MessageError:
        scene.assert_same(mirror)


def matrix(position: Any, rotation: Any, scale: Any) -> Any:
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat(rotation).as_matrix() * np.asarray(scale)
    result[:3, 3] = position
    return result


def random_transform(source: np.random.Generator) -> dict[str, Any]:
    rotation = Rotation.random(random_state=source).as_quat()
    return {
        "position": tuple(source.normal(size=3).tolist()),
        "rotation": tuple(rotation.tolist()),
        "scale": (float(source.uniform(0.5, 2.0)),) * 3,
    }


def test_world_poses_are_products_of_matrices_and_bodies_stand_where_the_frame_says() -> None:
    source = np.random.default_rng(3)
    mirror = empty_mirror()
    locals_of = {entity: random_transform(source) for entity in range(1, 7)}
    changes = tuple(
        Spawned(entity=e, name="", parent=e - 1, enabled=True, components={"Transform": t})
        for e, t in locals_of.items()
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=1, tick=0, changes=changes))
    world = np.eye(4)
    for entity, local in locals_of.items():
        world = world @ matrix(**local)
        pose = mirror.world_pose(entity)
        np.testing.assert_allclose(matrix(*pose), world, atol=1e-5)

    body = ((10.0, 20.0, 30.0), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))
    mirror.keep_frame(frame_of({3: body}, sequence=1))
    assert mirror.world_pose(3).position == body[0]
    expected = matrix(*body, mirror.world_pose(3).scale) @ matrix(**locals_of[4])
    np.testing.assert_allclose(matrix(*mirror.world_pose(4)), expected, atol=1e-5)

    moved = ComponentSet(entity=3, component="Transform", values=locals_of[3])
    mirror.apply_delta(SceneDelta(epoch=1, sequence=2, tick=0, changes=(moved,)))
    assert mirror.world_pose(3).position != body[0]  # the frame is older than the edit
    mirror.keep_frame(frame_of({3: body}, sequence=2))
    assert mirror.world_pose(3).position == body[0]
    mirror.keep_frame(frame_of({3: body}, sequence=2, epoch=2))
    assert mirror.world_pose(3).position != body[0]  # another run's frame


def test_a_snapshot_with_a_frame_puts_bodies_where_they_are() -> None:
    source = np.random.default_rng(4)
    mirror = empty_mirror()
    changes = tuple(
        Spawned(
            entity=e,
            name="",
            parent=e - 1,
            enabled=True,
            components={"Transform": random_transform(source), "RigidBody": {}},
        )
        for e in (1, 2, 3)
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=1, tick=0, changes=changes))
    bodies = {e: (source.normal(size=3), Rotation.random(random_state=source).as_quat()) for e in (1, 3)}
    frame = frame_of(bodies, sequence=1, tick=7)
    mirror.keep_frame(frame)
    joined = SceneMirror()
    joined.apply_snapshot(over_the_wire(mirror.to_snapshot(frame=frame)))
    assert joined.tick == 7
    for entity in (1, 2, 3):
        np.testing.assert_allclose(joined.world_pose(entity).position, mirror.world_pose(entity).position, atol=1e-5)
    assert joined.entities[3].components["RigidBody"].linear_velocity == (2.0, 2.0, 2.0)  # type: ignore[attr-defined]
    assert mirror.entities[3].components["RigidBody"].linear_velocity == (0.0, 0.0, 0.0)  # type: ignore[attr-defined]


class LossyHost:
    """A host whose scene changes and whose deltas get lost at random."""

    def __init__(self, session: Session, seed: int, *, epoch: int = 1) -> None:
        self.session = session
        self.scene = PlainScene(seed)
        self.truth = empty_mirror(epoch=epoch)
        self.random = random.Random(seed)
        self.refusals = 2
        session.serve(topics.SNAPSHOT, self.snapshot)

    async def snapshot(self, request: SnapshotRequest, key: str) -> Snapshot:
        if self.refusals:
            self.refusals -= 1
            raise RequestError("not now")
        return self.truth.to_snapshot()

    def tick(self, *, loss: float) -> None:
        delta = self.scene.delta(self.truth.sequence + 1, epoch=self.truth.epoch)
        self.truth.apply_delta(delta)
        if self.random.random() >= loss:
            self.session.publish(topics.DELTA, delta)

    def resync(self) -> None:
        self.truth.sequence += 1
        self.session.publish(
            topics.DELTA, SceneDelta(epoch=self.truth.epoch, sequence=self.truth.sequence, tick=0, resync=True)
        )


async def caught_up(mirror: SceneMirror, host: LossyHost) -> None:
    while (mirror.epoch, mirror.sequence) != (host.truth.epoch, host.truth.sequence):
        await asyncio.sleep(0.01)
    host.scene.assert_same(mirror)


async def test_a_follower_is_right_in_spite_of_losses_refusals_garbage_and_resyncs() -> None:
    broker = LoopbackBroker()
    hosting = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    host = LossyHost(hosting, 5)
    host.tick(loss=0.0)
    joined = await Session.join(broker.connect(), kind="tool")
    mirror = SceneMirror()
    close = await follow_scene(joined, mirror)
    follow_state(joined, mirror)
    for round_number in range(12):
        for _ in range(20):
            host.tick(loss=0.2)
            await asyncio.sleep(0)
        if round_number == 3:
            host.resync()
        if round_number == 5:
            hosting.publish_payload(topics.DELTA, b"garbage")
            hosting.publish(topics.DELTA, SceneDelta(epoch=1, sequence=10**9, tick=0))
            hosting.publish_payload(topics.STATE, codec.encode(SceneSettings(), Encoding.JSON))
        host.tick(loss=0.0)
        await caught_up(mirror, host)
    assert joined.refused == {"delta": 1, "state": 1}
    hosting.publish(topics.STATE, frame_of({1: ((0, 0, 0), (0, 0, 0, 1))}))
    while mirror.latest_frame is None:
        await asyncio.sleep(0)
    close()
    await joined.close()
    await hosting.close()


async def test_a_follower_takes_the_scene_of_a_host_that_comes_back() -> None:
    broker = LoopbackBroker()
    hosting = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    host = LossyHost(hosting, 5)
    host.tick(loss=0.0)
    joined = await Session.join(broker.connect(), kind="tool")
    links: list[bool] = []
    joined.on_link(links.append)
    mirror = SceneMirror()
    await follow_scene(joined, mirror)
    await caught_up(mirror, host)
    await hosting.close()
    while not links:
        await asyncio.sleep(0)
    again = await Session.host(broker.listen(), name="s", kind="simulation", epoch=2)
    newcomer = LossyHost(again, 6, epoch=2)
    for _ in range(5):
        newcomer.tick(loss=0.0)
    await caught_up(mirror, newcomer)
    assert links == [False, True]
    assert joined.epoch == 2
    await joined.close()
    await again.close()


def test_the_identity_is_where_nothing_is_said() -> None:
    mirror = empty_mirror()
    mirror.apply_delta(
        SceneDelta(
            epoch=1,
            sequence=1,
            tick=0,
            changes=(Spawned(entity=1, name="", parent=0, enabled=True, components={}),),
        )
    )
    pose = mirror.world_pose(1)
    assert Transform(position=pose.position, rotation=pose.rotation, scale=pose.scale) == Transform()
