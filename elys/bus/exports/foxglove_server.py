"""A running session for the Foxglove app: one more participant of the session, that says on a WebSocket what it hears.

    session ── deltas, snapshot ──▶ mirror ──▶ /scene, /robot_description   when something looks another way
            ── state frames ──────▶ mirror ──▶ /tf                          each frame that comes
            ── log, events, ... ────────────▶ /log, /events, ...

It has a process of its own, hears the newest frame only, and every client has a queue of its own from which the oldest goes: who
does not read slows nobody. Needs foxglove-sdk (extra `foxglove`).
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any, Final

import foxglove
import msgspec

from elys.bus import codec, topics
from elys.bus.asset_service import AssetClient
from elys.bus.exports.foxglove_scene import (
    LOG_TOPIC,
    SCENE_TOPIC,
    TRANSFORM_TOPIC,
    FoxgloveScene,
    FrameTransforms,
    log_message,
    schemas,
)
from elys.bus.exports.urdf import URDF_ENCODING, URDF_SCHEMA, URDF_TOPIC, urdf_message
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.session import LogLine
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.session import Session
from elys.bus.topics import Topic
from elys.bus.transports.mcap import json_schema
from elys.common.assets.store import AssetStore, references_in
from elys.common.errors import BusError, ElysError, MessageError

DEFAULT_PORT: Final = 8765  # at which the app looks by itself
_QUEUE: Final = 64  # messages that wait for a client, of which the oldest go
# Made anyway, and of use as plots and tables; diagnostics cost the simulation something, and are left to who asks for them.
_PASSED_ON: Final[tuple[Topic[Any], ...]] = (
    topics.STATUS,
    topics.EVENTS,
    topics.CONTACTS,
    topics.COMMANDS,
    topics.PROFILE,
)
_log = logging.getLogger(__name__)


class FoxgloveServer:
    """Serves a joined session to clients of the WebSocket protocol `foxglove.sdk.v1`. Use `open`, and `close` at the end.

    Attributes:
        port: where it listens.
    """

    def __init__(self, session: Session, assets: AssetStore) -> None:
        self._session = session
        self._store = assets
        self._client = AssetClient(session, assets)
        self._mirror = SceneMirror()
        self._scene = FoxgloveScene(assets.get)
        self._transforms = FrameTransforms()
        self._epoch = 0
        self._changed = asyncio.Event()
        self._last: dict[str, bytes] = {}  # what who joins has to be told, by topic
        self._context = foxglove.Context()
        self._channels: dict[str, Any] = {}
        self._closers: list[Callable[[], None]] = []
        self._work: asyncio.Task[None] | None = None
        self.port = 0

    async def open(self, *, host: str = "127.0.0.1", port: int = DEFAULT_PORT) -> None:
        """Listens at `port` (0: any that is free) and follows the session.

        Raises:
            BusError: it cannot be listened there.
        """
        for topic, schema in schemas().items():
            self._add(topic, "protobuf", (schema.name, schema.encoding, schema.data))
        self._add(URDF_TOPIC, URDF_ENCODING, URDF_SCHEMA)
        for told in _PASSED_ON:
            schema = (f"elys.{told.message.__name__}", "jsonschema", json_schema(told.message))
            self._add("/" + told.name, "json", schema)
        try:
            self._server = foxglove.start_server(
                name=f"ELYS: {self._session.name}",
                host=host,
                port=port,
                context=self._context,
                server_listener=_Listener(self._joined),
                message_backlog_size=_QUEUE,
            )
        except RuntimeError as error:
            raise BusError(f"Foxglove cannot be served at {host}:{port} ({error}): choose another port") from error
        self.port = int(self._server.port)
        self._closers.append(await follow_scene(self._session, self._mirror, self._scene_changed))
        self._closers.append(follow_state(self._session, self._mirror, self._frame_came))
        self._closers.append(self._session.subscribe(topics.LOG, self._line_came))
        for told in _PASSED_ON:
            self._closers.append(self._session.subscribe_payloads(told, self._passer(told)))
        self._changed.set()
        self._work = asyncio.create_task(self._tell_looks())

    async def close(self) -> None:
        """Ends the server, and leaves the session as it is."""
        if self._work is not None:
            self._work.cancel()
            await asyncio.gather(self._work, return_exceptions=True)
        for close in self._closers:
            close()
        if self.port:
            await asyncio.to_thread(self._server.stop)

    # --- what is heard ---------------------------------------------------------------------------------------------

    def _scene_changed(self, update: MirrorUpdate) -> None:
        self._changed.set()

    def _frame_came(self, frame: StateFrame) -> None:
        if self._scene.may_differ(self._mirror):
            self._changed.set()
        if self._channels[TRANSFORM_TOPIC].has_sinks():
            self._tell_frames()

    def _tell_frames(self) -> None:
        now = time.time_ns()
        self._say(TRANSFORM_TOPIC, self._transforms.encode(*self._scene.frames(self._mirror), now), now)

    def _line_came(self, line: LogLine, _: str) -> None:
        now = time.time_ns()
        self._say(LOG_TOPIC, log_message(now, line.level, line.text, line.node), now)

    def _passer(self, topic: Topic[Any]) -> Callable[[str, bytes], None]:
        def came(_: str, payload: bytes) -> None:
            try:
                codec.check_prefix(payload, topic.encoding)
            except MessageError as error:
                _log.debug("not passed on, of %s: %s", topic.name, error)
                return
            self._say("/" + topic.name, payload[codec.PREFIX.size :], time.time_ns())

        return came

    # --- what is said ----------------------------------------------------------------------------------------------

    async def _tell_looks(self) -> None:
        """Tells what the scene looks like whenever it may look another way, with the assets that it needs for it."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            await self._fetch_lacking()
            if self._mirror.epoch != self._epoch:  # another run: numbers of entities mean others
                self._epoch = self._mirror.epoch
                self._scene = FoxgloveScene(self._store.get)
            now = time.time_ns()
            update = self._scene.follow(self._mirror, now)
            if update is not None:
                self._keep(SCENE_TOPIC, update, now)
                self._keep(URDF_TOPIC, urdf_message(self._scene.urdf(self._mirror)), now)
                self._tell_frames()

    async def _fetch_lacking(self) -> None:
        drawn = [
            entity.components[name]
            for entity in self._mirror.entities.values()
            for name in ("MeshRenderer", "Material")
            if name in entity.components
        ]
        for reference in references_in(msgspec.json.encode(drawn)):
            if not self._store.has(reference):
                try:
                    await self._client.fetch(reference)
                except ElysError as error:
                    _log.warning("not drawn: %s", error)

    def _joined(self, topic: str) -> None:
        """Tells a client that has subscribed what was said before it came; called on a thread of the server's."""
        self._session.call_soon(self._tell_again, topic)

    def _tell_again(self, topic: str) -> None:
        if topic in self._last:
            self._say(topic, self._last[topic], time.time_ns())
        elif topic == TRANSFORM_TOPIC:
            self._tell_frames()  # a session that is paused says nothing by itself

    def _keep(self, topic: str, body: bytes, now: int) -> None:
        self._last[topic] = body
        self._say(topic, body, now)

    def _say(self, topic: str, body: bytes, now: int) -> None:
        self._channels[topic].log(body, log_time=now)

    def _add(self, topic: str, encoding: str, schema: tuple[str, str, bytes]) -> None:
        name, kind, data = schema
        self._channels[topic] = foxglove.Channel(
            topic,
            schema=foxglove.Schema(name=name, encoding=kind, data=data),
            message_encoding=encoding,
            context=self._context,
        )


class _Listener(foxglove.ServerListener):  # type: ignore[misc]
    """Hears from the server's threads who subscribes to what."""

    def __init__(self, subscribed: Callable[[str], None]) -> None:
        self._subscribed = subscribed

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """A client wants a topic."""
        self._subscribed(channel.topic)
