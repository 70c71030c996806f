"""A session served to Foxglove, as a client of its WebSocket protocol sees it: the scene, and frames where the bodies are."""

from __future__ import annotations

import asyncio
import json
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, Seek
from elys.bus.player import Player
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import BusError
from tests.unit.bus.told_recordings import SPAWNED, poses, write_told

pytest.importorskip("foxglove")
websockets = pytest.importorskip("websockets")
PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
DRAWN = {"Ground", "Falling", "Lamp", "Wheel", "Picture", "Hand"}


class AppClient:
    """What the app does: connects, hears what channels there are, and subscribes to some."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self.channels: dict[str, dict[str, Any]] = {}
        self._topic_of: dict[int, str] = {}

    async def subscribe(self, *wanted: str) -> None:
        while not set(wanted) <= set(self.channels):
            message = await asyncio.wait_for(self._socket.recv(), 10)
            if isinstance(message, str) and (told := json.loads(message))["op"] == "advertise":
                self.channels.update({channel["topic"]: channel for channel in told["channels"]})
        self._topic_of = dict(enumerate(wanted, 1))
        asked = [{"id": number, "channelId": self.channels[topic]["id"]} for number, topic in self._topic_of.items()]
        await self._socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))

    async def next(self, topic: str) -> Any:
        """The next message of a topic, decoded by the schema that was advertised."""
        while True:
            message = await asyncio.wait_for(self._socket.recv(), 10)
            if isinstance(message, bytes) and message[0] == 1:
                number, _ = struct.unpack_from("<IQ", message, 1)
                if self._topic_of.get(number) == topic:
                    return self._decoded(self.channels[topic], message[13:])

    def _decoded(self, channel: dict[str, Any], body: bytes) -> Any:
        import base64

        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

        if channel["encoding"] != "protobuf":
            return json.loads(body)
        pool = descriptor_pool.DescriptorPool()
        for file in descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
            pool.Add(file)
        return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"])).FromString(body)


@asynccontextmanager
async def served(path: Path) -> AsyncIterator[tuple[Any, Session]]:
    """A paused replay of a recording, and a server of it for Foxglove."""
    from elys.bus.exports.foxglove_server import FoxgloveServer

    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="told", kind="replay", epoch=3)
    with Recording(path) as recording:
        playing = asyncio.create_task(Player(recording, host, playing=False).run())
        joined = await Session.join(broker.connect(), kind="tool")
        server = FoxgloveServer(joined, AssetStore())
        try:
            await server.open(port=0)
            yield server, joined
        finally:
            await server.close()
            await joined.close()
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)
            await host.close()


async def seek(session: Session, tick: int) -> None:
    reply = await session.request(topics.COMMAND, CommandRequest(origin="test", command=Seek(time=tick / 60)))
    assert reply.accepted


@asynccontextmanager
async def app(port: int) -> AsyncIterator[AppClient]:
    async with websockets.connect(f"ws://127.0.0.1:{port}", subprotocols=PROTOCOLS, max_size=None) as connection:
        yield AppClient(connection)


async def frames_at(client: AppClient, tick: int) -> dict[str, Any]:
    """The frames as soon as they are those of a tick."""
    while True:
        told = {one.child_frame_id: one for one in (await client.next("/tf")).transforms}
        if "Falling" in told and abs(told["Falling"].translation.y - (5.0 - tick / 60)) < 1e-9:
            return told


async def test_the_app_gets_the_scene_and_frames_of_a_paused_session(tmp_path: Path) -> None:
    async with served(write_told(tmp_path / "told.mcap")) as (server, session), app(server.port) as client:
        await client.subscribe("/scene", "/tf")
        update = await client.next("/scene")
        while {entity.frame_id for entity in update.entities} != DRAWN:
            update = await client.next("/scene")
        entities = {entity.frame_id: entity for entity in update.entities}
        assert entities["Falling"].cubes[0].size.x == 1.0
        assert entities["Picture"].models[0].data[:4] == b"glTF"  # an asset that came over the bus
        for tick in (0, 25, 7):
            await seek(session, tick)
            told = await frames_at(client, tick)
            for name, body in (("Falling", 2), ("Wheel", 5)):
                where, turned = told[name].translation, told[name].rotation
                position, rotation = poses(tick)[body]
                assert (where.x, where.y, where.z) == pytest.approx(position, abs=1e-7)
                assert (turned.x, turned.y, turned.z, turned.w) == pytest.approx(rotation, abs=1e-6)


async def test_what_comes_into_the_scene_is_told(tmp_path: Path) -> None:
    async with served(write_told(tmp_path / "told.mcap")) as (server, session), app(server.port) as client:
        await client.subscribe("/scene", "/status")
        await seek(session, SPAWNED + 5)
        update = await client.next("/scene")
        while "Guest" not in {entity.frame_id for entity in update.entities}:
            update = await client.next("/scene")
        (guest,) = [entity for entity in update.entities if entity.frame_id == "Guest"]
        assert guest.cylinders[0].top_scale == 0.0
        assert (await client.next("/status"))["kind"] == "replay"


async def test_who_joins_late_is_told_everything(tmp_path: Path) -> None:
    async with served(write_told(tmp_path / "told.mcap")) as (server, _):
        async with app(server.port) as first:
            await first.subscribe("/scene")
            await first.next("/scene")
        async with app(server.port) as second:
            await second.subscribe("/scene", "/robot_description")
            assert {entity.frame_id for entity in (await second.next("/scene")).entities} >= {"Falling", "Ground"}


async def test_a_client_that_never_reads_slows_nobody(tmp_path: Path) -> None:
    async with served(write_told(tmp_path / "told.mcap")) as (server, session), app(server.port) as client:
        stalled = await websockets.connect(f"ws://127.0.0.1:{server.port}", subprotocols=PROTOCOLS, max_queue=1)
        stalled.transport.pause_reading()
        everything = [{"id": n, "channelId": n} for n in range(1, 12)]
        await stalled.send(json.dumps({"op": "subscribe", "subscriptions": everything}))
        await client.subscribe("/scene", "/tf")
        for tick in [*range(0, 120, 3)] * 5:
            await seek(session, tick)  # 200 times, each a frame; the host answers every one
        await seek(session, 61)
        await frames_at(client, 61)
        stalled.transport.abort()


async def test_a_port_that_is_taken_is_said(tmp_path: Path) -> None:
    from elys.bus.exports.foxglove_server import FoxgloveServer

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="told", kind="replay", epoch=3)
        server = FoxgloveServer(host, AssetStore())
        with pytest.raises(BusError, match="choose another port"):
            await server.open(port=taken.getsockname()[1])
        await server.close()
        await host.close()
