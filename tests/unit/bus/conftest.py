"""What the bus's tests share: coroutine tests, and a host whose scene changes at random."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.messages.scene import ComponentSet, Despawned, SceneChange, SceneDelta, Snapshot, SnapshotRequest, Spawned
from elys.bus.messages.session import Event, EventBatch, SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.common.assets.store import AssetStore


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Runs `async def` tests on a loop of their own; anything a task of theirs failed with fails the test."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    arguments = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    asyncio.run(_run(pyfuncitem.obj(**arguments)))
    return True


async def _run(test: object) -> None:
    failures: list[dict[str, object]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: failures.append(context))
    await test  # type: ignore[misc]
    assert not failures, failures


class RandomHost:
    """Hosts a scene of bodies that move and are edited at random; remembers every frame and scene it published."""

    def __init__(self, session: Session, *, seed: int = 1, body_count: int = 5) -> None:
        self.session = session
        self.random = np.random.default_rng(seed)
        self.truth = SceneMirror()
        self.truth.epoch, self.truth.sequence, self.truth.scene = session.epoch, 0, "Yard"
        self.assets = AssetStore()
        self.tick = 0
        self.frames: dict[int, StateFrame] = {}
        self.scenes: dict[int, Snapshot] = {}
        self.next_id = 1
        self._change([self._spawn() for _ in range(body_count)])
        session.serve(topics.SNAPSHOT, self.give_snapshot)

    async def give_snapshot(self, request: SnapshotRequest, key: str) -> Snapshot:
        return self.truth.to_snapshot()

    def publish_tick(self, *, edits: bool = True, resync: bool = False) -> StateFrame:
        """One tick: perhaps an edit, then the frame, events and status."""
        self.tick += 1
        self.truth.tick, self.truth.simulation_time = self.tick, self.tick / 60
        if resync:
            self._change([self._spawn()], resync=True)
        elif edits and self.tick % 7 == 0:
            self._change([self._edit()])
        frame = self._frame()
        self.session.publish(topics.STATE, frame)
        if self.tick % 10 == 0:
            events = (Event(kind="hit", entity=1, values={"tick": self.tick}),)
            self.session.publish(topics.EVENTS, EventBatch(epoch=self.session.epoch, tick=self.tick, events=events))
            self.session.publish(topics.STATUS, self.status())
        self.frames[self.tick] = frame
        self.scenes[self.tick] = self.truth.to_snapshot()
        return frame

    def status(self) -> SessionStatus:
        return SessionStatus(
            epoch=self.session.epoch,
            kind="simulation",
            scene="Yard",
            tick=self.tick,
            simulation_time=self.tick / 60,
            playing=True,
            tick_rate=60.0,
        )

    def _change(self, changes: list[SceneChange], *, resync: bool = False) -> None:
        delta = SceneDelta(
            epoch=self.session.epoch, sequence=self.truth.sequence + 1, tick=self.tick, changes=tuple(changes)
        )
        self.truth.apply_delta(delta)
        if resync:
            delta = SceneDelta(epoch=delta.epoch, sequence=delta.sequence, tick=self.tick, resync=True)
        self.session.publish(topics.DELTA, delta)

    def _spawn(self) -> SceneChange:
        entity, self.next_id = self.next_id, self.next_id + 1
        reference = self.assets.put(f"mesh {entity % 3}".encode(), kind="mesh")
        components: dict[str, dict[str, Any]] = {
            "Transform": {"position": (float(entity), 0.5, 0.25)},
            "RigidBody": {},
            "MeshRenderer": {"mesh": reference},
        }
        return Spawned(entity=entity, name=f"body {entity}", parent=0, enabled=True, components=components)

    def _edit(self) -> SceneChange:
        bodies = sorted(self.truth.entities)
        chosen = int(self.random.choice(bodies))
        match int(self.random.integers(3)):
            case 0:
                return self._spawn()
            case 1 if len(bodies) > 3:
                return Despawned(entity=chosen)
            case _:
                return ComponentSet(entity=chosen, component="RigidBody", values={"mass": float(self.tick)})

    def _frame(self) -> StateFrame:
        bodies = sorted(self.truth.entities)
        count = len(bodies)
        rotation = self.random.normal(size=(count, 4)).astype(np.float32)
        return StateFrame(
            epoch=self.session.epoch,
            tick=self.tick,
            simulation_time=self.tick / 60,
            published_at=self.tick * 1000,
            delta_sequence=self.truth.sequence,
            state_hash=self.tick * 31,
            playing=True,
            position=self.random.normal(size=(count, 3)),
            rotation=rotation / np.linalg.norm(rotation, axis=1, keepdims=True),
            linear_velocity=self.random.normal(size=(count, 3)).astype(np.float32),
            angular_velocity=self.random.normal(size=(count, 3)).astype(np.float32),
            entity=np.array(bodies, np.uint32),
        )


@pytest.fixture
def random_host() -> Callable[..., RandomHost]:
    """Makes a RandomHost of a hosted session."""
    return RandomHost


def assert_same_columns(seen: StateFrame, recorded: StateFrame) -> None:
    """Bit for bit."""
    for column in ("position", "rotation", "linear_velocity", "angular_velocity", "entity"):
        assert getattr(seen, column).tobytes() == getattr(recorded, column).tobytes(), column
    assert (seen.tick, seen.simulation_time, seen.state_hash) == (
        recorded.tick,
        recorded.simulation_time,
        recorded.state_hash,
    )


@pytest.fixture
def same_columns() -> Callable[[StateFrame, StateFrame], None]:
    """The check that two frames are the same, bit for bit."""
    return assert_same_columns
