"""The face that every transport shows to a session: bytes by key, callbacks on ANY thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from elys.bus.topics import Delivery

Closer = Callable[[], None]


class IncomingQuery(Protocol):
    """A question that waits for exactly one `reply` or `refuse`; both may be called on any thread, later."""

    key: str
    payload: bytes

    def reply(self, payload: bytes) -> None:
        """Answers."""

    def refuse(self, reason: str) -> None:
        """Says why there is no answer."""

    def drop(self) -> None:
        """Leaves it without an answer."""


class Answer(Protocol):
    """Hears what became of a request, exactly once: `payload` is None when it failed and `reason` says why."""

    def __call__(self, payload: bytes | None, reason: str) -> None: ...


Answers = Callable[[list[bytes], list[str]], None]  # all replies to a question, and the reasons of those who refused


class Link(NamedTuple):
    """A connection to another end of the same transport."""

    peer: str  # who that is, see `Transport.identity`
    kind: str  # what the other end is to the transport: client, router, peer
    local: str  # this side's address
    remote: str  # the other's


class Transport(Protocol):
    """Carries payloads. Key expressions may hold `*` for one part and a final `**` for any rest."""

    @property
    def user(self) -> str:
        """Who this side is to the host; "" where nobody is asked."""

    @property
    def endpoint(self) -> str:
        """Where the host is; "" inside one process."""

    def publish(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Sends to all who subscribe; never waits for a reader."""

    def publish_made(self, key: str, make: Callable[[], bytes], delivery: Delivery) -> None:
        """Sends what `make` returns, which is called once: here and now, or soon and on another thread."""

    def has_listener(self, key: str) -> bool:
        """Whether anybody subscribes to a key now: what costs something to make may be left out if not."""

    def subscribe(self, key_expression: str, on_sample: Callable[[str, bytes], None]) -> Closer:
        """Calls `on_sample(key, payload)` for what others and this side publish."""

    def serve(self, key_expression: str, on_query: Callable[[IncomingQuery], None]) -> Closer:
        """Answers requests to these keys."""

    def request(self, key_expression: str, payload: bytes, timeout: float, answer: Answer) -> None:
        """Asks; the first answer within `timeout` seconds counts."""

    def survey(self, key_expression: str, payload: bytes, timeout: float, answers: Answers) -> None:
        """Asks all who serve these keys; `answers` hears once, when all have spoken or after `timeout` seconds."""

    def identity(self) -> str:
        """What this end is called by others' `links`."""

    def links(self) -> list[Link]:
        """The connections there are now."""

    def announce(self, key: str) -> Closer:
        """Shows others that this key's owner is alive, until closed or dead."""

    def watch(self, key_expression: str, on_change: Callable[[str, bool], None]) -> Closer:
        """Calls `on_change(key, alive)` for those alive now and at every change."""

    def watch_link(self, on_change: Callable[[bool], None]) -> Closer:
        """Calls `on_change(connected)` now and when the connection to the host goes or comes; the host hears nothing."""

    @property
    def silence(self) -> float:
        """[s] since something came from the host; 0 where there is no way that could break, and for the host itself."""

    @property
    def round_trip(self) -> float:
        """[s] to the host and back, as it was measured when the connection was made; 0 where that is not known."""

    def suspect(self) -> None:
        """The host was silent for too long: looks for another way to it, unless it speaks first."""

    def close(self) -> None:
        """Ends everything this transport holds. A second call does nothing."""
