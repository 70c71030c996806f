"""Which of several endpoints can be reached now, and how far away it is.

TCP waits a second before it knocks again, and ever longer after that: after an outage that would be most of the time until the
session is back. Here a new connection is begun every quarter of a second, at all endpoints, and the first that is accepted wins.
"""

from __future__ import annotations

import contextlib
import re
import selectors
import socket
import struct
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

KNOCK_INTERVAL: Final = 0.25  # [s] between two knocks at the same door
HEAD_START: Final = 0.02  # [s] that an endpoint has before the next one of the list
_PATIENCE: Final = 3.0  # [s] that one knock is waited for
_RESOLVED_FOR: Final = 10.0  # [s] after which a name is looked up anew
_MEASURED: Final = struct.Struct("=68xI")  # [us] tcpi_rtt in struct tcp_info
_DOOR: Final = re.compile(r"(?:tcp|tls)/(?:\[(?P<six>[^\]]+)\]|(?P<host>[^:\[\]]+)):(?P<port>\d+)(?:[?#].*)?")


_LOCAL: Final = ("tcp/127.", "tcp/localhost", "tcp/[::1]", "tls/127.", "tls/localhost", "tls/[::1]", "unixsock-stream/")


def is_near(endpoint: str) -> bool:
    """Whether an endpoint is of this machine, or of this process."""
    return not endpoint or endpoint.startswith(_LOCAL)


@dataclass(frozen=True, slots=True)
class Reached:
    """An endpoint that answers."""

    endpoint: str
    round_trip: float  # [s] that the connection took; 0 where that cannot be known


def reach(endpoints: Sequence[str], *, timeout: float, stop: threading.Event | None = None) -> Reached | None:
    """The first of `endpoints` that accepts a connection; None when none does within `timeout` [s], or when `stop` is set.

    Endpoints of other protocols than TCP and TLS count as reached: whether they are is seen by opening them.
    """
    if other := next((endpoint for endpoint in endpoints if _DOOR.fullmatch(endpoint) is None), None):
        return Reached(other, 0.0)
    with _Knocks(endpoints) as knocks:
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0.0 and not (stop is not None and stop.is_set()):
            if (found := knocks.answered(min(left, HEAD_START))) is not None:
                return found
    return None


class _Knocks:
    """Connections that are being made, each begun at its time."""

    def __init__(self, endpoints: Sequence[str]) -> None:
        now = time.monotonic()
        self._due = {endpoint: now + place * HEAD_START for place, endpoint in enumerate(endpoints)}
        self._selector = selectors.DefaultSelector()
        self._addresses: dict[str, tuple[float, list[tuple[int, tuple[object, ...]]]]] = {}

    def __enter__(self) -> _Knocks:
        return self

    def __exit__(self, *_: object) -> None:
        for key in list(self._selector.get_map().values()):
            self._give_up(key)
        self._selector.close()

    def answered(self, wait: float) -> Reached | None:
        """Knocks where it is time, and looks for `wait` seconds whether a door has opened."""
        now = time.monotonic()
        for endpoint, due in self._due.items():
            if due <= now:
                self._due[endpoint] = now + KNOCK_INTERVAL
                self._knock(endpoint, now)
        if not self._selector.get_map():
            time.sleep(wait)
            return None
        for key, _ in self._selector.select(wait):
            endpoint, begun = key.data
            connection = key.fileobj
            assert isinstance(connection, socket.socket)
            if not connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
                return Reached(endpoint, _round_trip(connection, time.monotonic() - begun))
            self._give_up(key)
        for key in list(self._selector.get_map().values()):
            if now - key.data[1] > _PATIENCE:
                self._give_up(key)
        return None

    def _knock(self, endpoint: str, now: float) -> None:
        for family, address in self._resolved(endpoint, now):
            with contextlib.suppress(OSError):  # no way there now
                connection = socket.socket(family, socket.SOCK_STREAM)
                connection.setblocking(False)
                try:
                    connection.connect(address)
                except BlockingIOError:
                    pass
                except OSError:
                    connection.close()
                    raise
                self._selector.register(connection, selectors.EVENT_WRITE, (endpoint, now))

    def _resolved(self, endpoint: str, now: float) -> list[tuple[int, tuple[object, ...]]]:
        found_at, addresses = self._addresses.get(endpoint, (-_RESOLVED_FOR, []))
        if not addresses or now - found_at > _RESOLVED_FOR:
            door = _DOOR.fullmatch(endpoint)
            assert door is not None
            with contextlib.suppress(OSError):  # the name is unknown now: as if nobody opened
                found = socket.getaddrinfo(door["six"] or door["host"], int(door["port"]), type=socket.SOCK_STREAM)
                addresses = [(family, address) for family, _, _, _, address in found]
            self._addresses[endpoint] = (now, addresses)
        return addresses

    def _give_up(self, key: selectors.SelectorKey) -> None:
        connection = key.fileobj
        assert isinstance(connection, socket.socket)
        self._selector.unregister(connection)
        connection.close()


def _round_trip(connection: socket.socket, elapsed: float) -> float:
    """[s] as TCP has measured it, for the first packet may have been lost; else what has `elapsed`."""
    if not hasattr(socket, "TCP_INFO"):
        return elapsed
    info = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
    measured = _MEASURED.unpack_from(info)[0] * 1e-6 if len(info) >= _MEASURED.size else 0.0
    return min(measured, elapsed) if measured else elapsed
