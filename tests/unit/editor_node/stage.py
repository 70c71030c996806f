"""A host with a yard and an editor's model in one session, without a network."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.scene import EntityRecord
from elys.editor_node.model import EditorModel
from tests.unit.editor_node.picture_source import PictureSource
from tests.unit.editor_node.scene_host import SceneHost


def yard_records(count: int = 6) -> list[EntityRecord]:
    """A ground, a crate with a lid and a handle, a sun, and boxes."""
    records = [
        EntityRecord(name="Ground", components={"Transform": {"scale": [20, 0.1, 20]}, "Collider": {}}),
        EntityRecord(
            name="Crate",
            components={
                "Transform": {"position": [1, 2, 3]},
                "RigidBody": {"mass": 5.0},
                "Collider": {},
                "Material": {},
            },
        ),
        EntityRecord(name="Lid", parent=1, components={"Transform": {"position": [0, 0.5, 0]}}),
        EntityRecord(name="Handle", parent=2, components={"Transform": {"position": [0, 0.1, 0]}}),
        EntityRecord(name="Sun", components={"Transform": {}, "Light": {}}),
    ]
    records += [
        EntityRecord(
            name=f"Box {number}",
            components={"Transform": {"position": [number, 1, 0]}, "MeshRenderer": {}, "Material": {}, "RigidBody": {}},
        )
        for number in range(1, count + 1)
    ]
    return records


class Stage:
    """A host with a yard and an editor's model in the same session."""

    def __init__(self, broker: LoopbackBroker, host: SceneHost, model: EditorModel) -> None:
        self.broker = broker
        self.host = host
        self.model = model

    def named(self, name: str) -> int:
        return next(entity.id for entity in self.model.scene.mirror.entities.values() if entity.name == name)

    async def until(self, condition: Callable[[], bool]) -> None:
        """Lets the loop run until something is so."""
        async with asyncio.timeout(5.0):
            while not condition():
                await asyncio.sleep(0.001)

    async def picture_source(self, *, entity: int, is_sharing: bool = True) -> PictureSource:
        session = await Session.join(self.broker.connect(), kind="render")
        return PictureSource(session, entity=entity, is_sharing=is_sharing)

    async def settle(self) -> None:
        """Until all edits are answered and echoed."""
        await self.model.history.settle()


@contextlib.asynccontextmanager
async def open_stage(records: list[EntityRecord] | None = None) -> AsyncIterator[Stage]:
    broker = LoopbackBroker()
    host_session = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    host = SceneHost(host_session)
    host.load(yard_records() if records is None else records)
    session = await Session.join(broker.connect(), kind="editor")
    model = EditorModel(session)
    running = asyncio.create_task(model.run())
    stage = Stage(broker, host, model)
    try:
        await stage.until(lambda: model.scene.is_known)
        host.publish_status()
        await stage.until(lambda: model.status is not None)
        yield stage
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await session.close()
        await host_session.close()
