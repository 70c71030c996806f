"""One viewer's stream, at the viewer: frames in, whole state frames and acknowledgements out. Pure: no clock, no socket."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from elys.bus.messages.state_frame import HAS_TAIL, HEADER, PLAYING, StateFrame, is_whole, pack_frame
from elys.bus.state_packing.compact import ANGULAR_STEPS, F4, LINEAR_STEPS
from elys.bus.streaming.claims import Claim
from elys.bus.streaming.held import Held
from elys.bus.streaming.motion import elapsed_since, moved_on
from elys.bus.streaming.packing import Unpacked, unpack_frame
from elys.bus.streaming.wire import WANTS_KEY, WINDOW, Ack, FrameHead, unpack_head
from elys.common.errors import MessageError

MOST_KEPT: Final = 48 << 20  # [B] of what it had at earlier acks
_FEWEST_KEPT: Final = 4


class Arrival(NamedTuple):
    """What a frame brought. `state` is the body of a state frame; None: nothing newer than was shown already."""

    head: FrameHead
    state: bytes | None
    claim: Claim  # no body of it is farther off
    is_new: bool  # it counts: an ack is due


class Receiver:
    """Give it every frame (`take`), in whatever order, and send `ack` back after each that is new."""

    def __init__(self) -> None:
        self.generation = 0
        self.restarts = 0  # beginnings from nothing after the first
        self.head: FrameHead | None = None  # of the newest frame
        self.missed = 0  # frames that others came before and that have not come
        self.late = 0  # of those, how many came then
        self.came = 0
        self._begin(0)

    def _begin(self, generation: int) -> None:
        self.generation = generation
        self._held: Held | None = None
        self._kept: dict[int, Held] = {}  # what was here at an ack
        self._came: dict[int, int] = {}  # frame -> the last ack before it came
        self._merged = 0
        self._ack_number = 0
        self._newest = 0
        self._asks_anew = False
        self._shown = (0, -1, 0)  # epoch, tick, published at, of what was handed on last

    @property
    def known_count(self) -> int:
        """Bodies that were told at least once."""
        return 0 if self._held is None else int(np.count_nonzero(self._held.number))

    @property
    def body_count(self) -> int:
        """Bodies that there are, as far as is known here."""
        return 0 if self._held is None else len(self._held.entities)

    @property
    def size(self) -> int:
        """Bytes kept."""
        return sum(held.size for held in self._kept.values())

    def ack(self, lanes: int) -> Ack:
        """What is here, for the sender; `lanes` are bits of the connections by which more can come."""
        bits = 0
        for number in self._came:
            back = self._newest - 1 - number
            if 0 <= back < WINDOW:
                bits |= 1 << back
        flags = WANTS_KEY if self._asks_anew else 0
        return Ack(flags, self.generation, self._ack_number, self._newest, bits, self._merged, lanes)

    def take(self, payload: bytes | memoryview, *, offset: int = 0) -> Arrival:
        """A frame that came.

        Raises:
            MessageError: it is damaged; nothing has changed.
        """
        head = unpack_head(payload, offset)
        nothing = Arrival(head, None, Claim(np.inf, np.inf), is_new=False)
        if head.generation < self.generation:
            return nothing
        if head.generation > self.generation or (self._held is None and self._asks_anew):
            if head.base:  # what it is told against was never here
                self._asks(head.generation)
                return nothing
            self.restarts += self.generation > 0
            self._begin(head.generation)
        held = self._held
        if head.number in self._came or self._newest - head.number >= WINDOW:
            return nothing
        if held is not None and head.table < held.table:
            return nothing  # of an earlier list of bodies: the sender counts it as lost
        base = self._kept.get(head.base)
        if head.base and base is None:
            self._asks_anew = True
            return nothing
        unpacked = unpack_frame(payload, offset, base, head)
        self._merge(unpacked)
        state = self._state(unpacked) if head.number == self._newest else None
        return Arrival(head, state, self._claim(head), is_new=True)

    def _asks(self, generation: int) -> None:
        """Nothing of that generation can be read here: the sender shall begin anew."""
        self._begin(generation)
        self._asks_anew = True

    def _merge(self, unpacked: Unpacked) -> None:
        head, _, told = unpacked
        held = self._held
        if held is None:
            held = Held.nothing(told.table, told.entities)
        elif held.table != told.table:
            held = held.moved_to(told.table, told.entities)
        elif len(held.entities) != len(told.entities):
            raise MessageError("a streamed frame has another list of bodies under the same number")
        held.merge(told)
        self._held = held
        self._merged += 1
        self.came += 1
        if head.number > self._newest:
            self.missed += head.number - self._newest - 1
            self._newest, self.head = head.number, head
        else:
            self.late += 1
        self._came[head.number] = self._ack_number
        for number in [number for number in self._came if self._newest - number > WINDOW]:
            del self._came[number]
        self._ack_number += 1
        self._kept[self._ack_number] = held.copy()
        self._forget(head.base)

    def _forget(self, base: int) -> None:
        """Frames on their way are told against the base of the newest one or a later one, or a little earlier: they overtake."""
        most = max(MOST_KEPT // max(self._kept[self._ack_number].size, 1), _FEWEST_KEPT)
        for number in [number for number in self._kept if number < base - WINDOW]:
            del self._kept[number]
        while len(self._kept) > min(most, 2 * WINDOW):
            del self._kept[next(iter(self._kept))]

    def _claim(self, head: FrameHead) -> Claim:
        """What the sender vouches for: the better of two, if exactly what it counts on is here."""
        here = 0
        for number, ack in self._came.items():
            back = head.number - 1 - number
            if ack >= head.base and 0 <= back < WINDOW:
                here |= 1 << back
        if here == head.others:
            return Claim(head.position_error, head.rotation_error)
        return Claim(head.open_position_error, head.open_rotation_error)

    def _state(self, unpacked: Unpacked) -> bytes:
        assert self._held is not None
        held = self._held
        epoch, tick, time, published_at, sequence, state_hash, _, flags = HEADER.unpack(unpacked.header)
        last = self._shown
        if (epoch, tick) == last[:2]:  # told again, more exactly: it must not be taken for what is here already
            published_at = max(published_at, last[2] + 1)
        self._shown = (epoch, tick, published_at)
        known = held.is_known
        rows = slice(None) if known.all() else np.flatnonzero(known)
        codes = held.codes.rows(rows)
        position, rotation = moved_on(codes, elapsed_since(held.time[rows], time), unpacked.head.fall)
        bodies = pack_frame(
            StateFrame(
                epoch=epoch,
                tick=tick,
                simulation_time=time,
                published_at=published_at,
                delta_sequence=sequence,
                state_hash=state_hash,
                playing=bool(flags & PLAYING),
                position=np.ascontiguousarray(position.T),
                rotation=np.ascontiguousarray(rotation.T),
                linear_velocity=np.ascontiguousarray((codes.linear * (1.0 / LINEAR_STEPS)).astype(F4).T),
                angular_velocity=np.ascontiguousarray((codes.angular * (1.0 / ANGULAR_STEPS)).astype(F4).T),
                entity=codes.entity if isinstance(rows, slice) else held.entities[rows],
            )
        )
        return _with_tail(bodies, flags, held.tail.data)


def _with_tail(body: bytes, flags: int, tail: bytes) -> bytes:
    """A packed frame with the flags that it came with and what is animated; without that, if it is not whole."""
    fields = list(HEADER.unpack_from(body))
    fields[7] = (flags & ~HAS_TAIL) | (HAS_TAIL if tail else 0)
    whole = HEADER.pack(*fields) + body[HEADER.size :] + tail
    if tail and not is_whole(whole):
        return _with_tail(body, flags, b"")
    return whole
