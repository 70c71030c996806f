"""A guarded session over real zenoh, and raw clients of it that know the keys of every topic and care for no rule."""

from __future__ import annotations

import json
import queue
import socket
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.handlers import Callback

from elys.bus import topics
from elys.bus.access.host import HostAccess, client_settings
from elys.bus.access.keyring import Keyring, new_key
from elys.bus.access.roles import GIVEN, Role
from elys.bus.transports.zenoh import ZenohTransport

PATIENCE = 20.0  # [s] far beyond what anything here takes; a failure, not a measure
NAME = "yard"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Raw:
    """A client without any manners."""

    def __init__(self, endpoint: str, user: str, secret: str, *, timeout: float = PATIENCE) -> None:
        self.user = user
        self.node = f"rogue-1.{user}"
        config = zenoh.Config()
        for key, value in {
            "mode": "client",
            "connect/endpoints": [endpoint],
            "connect/timeout_ms": int(timeout * 1000),
            "connect/exit_on_failure": True,
            "scouting/multicast/enabled": False,
            "transport/auth/usrpwd": {"user": user, "password": secret},
        }.items():
            config.insert_json5(key, json.dumps(value))
        self.zenoh = zenoh.open(config)
        self.heard: queue.Queue[tuple[str, bytes]] = queue.Queue()

    def listen(self, expression: str) -> None:
        """Puts what comes into `heard`, of others alone: zenoh delivers what a session says itself to it at once."""
        self.zenoh.declare_subscriber(
            expression,
            Callback(lambda s: self.heard.put((str(s.key_expr), s.payload.to_bytes())), indirect=False),
            allowed_origin=zenoh.Locality.REMOTE,
        )

    def say(self, key: str, payload: bytes) -> None:
        """Waits for room: by zenoh's default what finds a full queue is dropped, and nothing would come."""
        self.zenoh.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

    def take_back(self, key: str) -> None:
        """Says that nothing is under a key any more, and waits for room as `say` does."""
        self.zenoh.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)

    def ask(self, key: str, payload: bytes = b"", *, timeout: float = PATIENCE) -> list[bytes | str]:
        """All answers; refusals as text."""
        replies = self.zenoh.get(
            key,
            payload=payload,
            timeout=timeout,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        return [
            reply.ok.payload.to_bytes() if reply.ok is not None else reply.err.payload.to_bytes().decode()
            for reply in replies
        ]


class Guarded:
    """A host that lets in one user of each role, and what it heard."""

    def __init__(self) -> None:
        self.keyring = Keyring(keys=[new_key(role) for role in GIVEN])
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.transport = ZenohTransport.listen(self.endpoint, access=HostAccess.of(self.keyring))
        self.heard: queue.Queue[tuple[str, bytes]] = queue.Queue()
        self.clients: list[Raw] = []
        self._markers = 0

    def client(self, role: Role) -> Raw:
        """A raw client of that role."""
        key = self.keyring.named(role.title)
        self.clients.append(Raw(self.endpoint, key.user, key.secret))
        return self.clients[-1]

    def listen(self, expression: str = f"{topics.ROOT}/**") -> None:
        self.transport.subscribe(expression, lambda key, payload: self.heard.put((key, payload)))

    def heard_of(self, client: Raw, heard: queue.Queue[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
        """All that came before something that the client may say for sure, and says now: messages overtake none of their kind."""
        self._markers += 1
        marker = f"marker {self._markers}".encode()
        client.say(topics.key_of(NAME, topics.VIEW_REQUEST, "anybody"), marker)
        came: list[tuple[str, bytes]] = []
        while True:
            key, payload = heard.get(timeout=PATIENCE)
            if payload == marker:
                return came
            if not payload.startswith(b"marker"):
                came.append((key, payload))

    def close(self) -> None:
        for client in self.clients:
            client.zenoh.close()
        self.transport.close()


def wait_until(ask: Callable[[], Any]) -> Any:
    """The first answer that is not empty: a declaration takes its way through the router."""
    for _ in range(2000):
        if found := ask():
            return found
    raise AssertionError("it never came")


def own_settings(keyring: Keyring, role: Role) -> dict[str, Any]:
    """How a client of that role is configured."""
    return client_settings(keyring.credentials(keyring.named(role.title)), by_certificate=False)
