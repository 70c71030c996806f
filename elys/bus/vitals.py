"""Counting what a node sends and hears, so that it can say how it does when somebody asks (`elys top`, `elys topic info`).

Nothing of it is sent unasked. A count costs a fraction of a microsecond a message; of a topic that several listen to in one
node the first listener's counts stand for it, since the network carries each message to the node once.
"""

from __future__ import annotations

import os
import platform
import struct
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import msgspec

import elys
from elys.bus.messages.vitals import Neighbour, Stream, Vitals, VitalsRequest
from elys.bus.topics import Encoding, Topic
from elys.bus.transports.transport import Transport

if TYPE_CHECKING:
    from elys.bus.mailbox import Mailbox
    from elys.bus.session import Session

OnSample = Callable[[str, bytes], None]

_STATE_HEAD: Final = struct.Struct("<QQdQ")  # epoch, tick, simulation time, published at: see messages/state_frame.py
_STATE_PREFIX: Final = 8  # [bytes] before it
_AGES_KEPT: Final = 256  # of the last messages
_STEPS_KEPT: Final = 16  # differences of ticks by which the usual one is known
_LONGEST_GAP: Final = 600  # [ticks] a longer one is a jump in time, not a loss


class Arrivals:
    """What came of one topic; `note` may be called on any thread, but on one at a time."""

    def __init__(self, *, is_state: bool, clock: Callable[[], int] = time.time_ns) -> None:
        self.messages = 0
        self.size = 0
        self.missed = 0
        self.mailbox: Mailbox | None = None
        self._is_state = is_state
        self._clock = clock
        self._ages: deque[float] = deque(maxlen=_AGES_KEPT)
        self._steps: deque[int] = deque(maxlen=_STEPS_KEPT)
        self._last = (0, -1)  # epoch and tick

    def counted(self, put: OnSample) -> OnSample:
        """Counts what goes through to `put`."""

        def arrived(key: str, payload: bytes) -> None:
            self.note(payload)
            put(key, payload)

        return arrived

    def note(self, payload: bytes) -> None:
        """Counts one message."""
        self.messages += 1
        self.size += len(payload)
        if self._is_state and len(payload) >= _STATE_PREFIX + _STATE_HEAD.size:
            epoch, tick, _, published_at = _STATE_HEAD.unpack_from(payload, _STATE_PREFIX)
            self._note_tick(epoch, tick)
            self._ages.append((self._clock() - published_at) / 1e6)

    def _note_tick(self, epoch: int, tick: int) -> None:
        """A host tells every so many ticks (one; a replay at double speed two): what is beyond is missing."""
        (last_epoch, last_tick), self._last = self._last, (epoch, tick)
        step = tick - last_tick
        if epoch != last_epoch or not 0 < step < _LONGEST_GAP:
            return
        self._steps.append(step)
        self.missed += step // min(self._steps) - 1

    def stream(self) -> Stream:
        """The counts as they are told."""
        ages = sorted(self._ages.copy())
        known = bool(ages)
        return Stream(
            messages=self.messages,
            size=self.size,
            missed=self.missed,
            skipped=self.mailbox.skipped + self.mailbox.lost if self.mailbox is not None else 0,
            age_p50=ages[len(ages) // 2] if known else -1.0,
            age_p99=ages[len(ages) * 99 // 100] if known else -1.0,
        )


class Traffic:
    """What a node sent and heard, by topic."""

    def __init__(self) -> None:
        self._sent: dict[str, list[int]] = {}
        self._heard: dict[str, list[Arrivals]] = {}

    def count_sent(self, topic: str, size: int) -> None:
        """Counts one message."""
        counts = self._sent.get(topic)
        if counts is None:
            counts = self._sent.setdefault(topic, [0, 0])
        counts[0] += 1
        counts[1] += size

    def begin(self, topic: Topic[object], mailbox: Mailbox) -> Arrivals:
        """Counts for a new listener."""
        arrivals = Arrivals(is_state=topic.encoding is Encoding.STATE)
        arrivals.mailbox = mailbox
        self._heard.setdefault(topic.name, []).append(arrivals)
        return arrivals

    def end(self, topic: Topic[object], arrivals: Arrivals) -> None:
        """The listener is gone."""
        listeners = self._heard[topic.name]
        listeners.remove(arrivals)
        if not listeners:
            del self._heard[topic.name]

    def sent(self) -> dict[str, Stream]:
        """All that was sent."""
        return {topic: Stream(messages=counts[0], size=counts[1]) for topic, counts in self._sent.items()}

    def heard(self) -> dict[str, Stream]:
        """All that is listened to."""
        return {topic: listeners[0].stream() for topic, listeners in self._heard.items()}


async def give_vitals(session: Session, request: VitalsRequest, key: str) -> Vitals:
    """A session's answer to who asks how it does."""
    host = session.host_facts() if session.host_facts is not None else None
    vitals = vitals_of(session.transport, node=session.node.id, kind=session.node.kind)
    traffic = session.traffic
    return msgspec.structs.replace(vitals, sent=traffic.sent(), heard=traffic.heard(), host=host)


def vitals_of(transport: Transport, *, node: str, kind: str) -> Vitals:
    """What is so of any node: who and where it is, and whom it is connected to."""
    return Vitals(
        node=node,
        kind=kind,
        version=elys.__version__,
        machine=platform.node(),
        process=os.getpid(),
        clock=time.time_ns(),
        measured_at=time.monotonic(),
        identity=transport.identity(),
        neighbours=tuple(
            Neighbour(identity=link.peer, kind=link.kind, address=link.remote) for link in transport.links()
        ),
    )
