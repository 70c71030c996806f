"""A frame as bytes and back: head, table, groups, tail."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import HEADER
from elys.bus.state_packing.compact import Codes, no_codes
from elys.bus.state_packing.frames import pack_tail, unpack_tail
from elys.bus.state_packing.numbers import folded, unfolded
from elys.bus.state_packing.planes import PlaneReader, PlaneWriter
from elys.bus.streaming.held import NO_TAIL, Held, Tail, Told
from elys.bus.streaming.motion import elapsed_since
from elys.bus.streaming.telling import pack_group, unpack_group
from elys.bus.streaming.truth import Truth
from elys.bus.streaming.wire import (
    FRAME_SIZE,
    HAS_TABLE,
    HAS_TAIL_TOLD,
    MOST_BODIES,
    FrameHead,
    pack_head,
)
from elys.common.errors import MessageError, RecordingError

MOST_GROUPS: Final = 16
_SAME_TAIL, _NO_TAIL, _NEW_TAIL = 0, 1, 2
_LEARNING: Final = 0.1  # of the last frame in what a body is taken to cost
Group = tuple[int, NDArray[np.intp], Codes]  # level, rows of the table, what is told of them


class Unpacked(NamedTuple):
    """A frame that was understood."""

    head: FrameHead
    header: bytes  # of the state frame
    told: Told


def joined_rows(groups: Sequence[Group], truth: Truth) -> tuple[NDArray[np.intp], Codes]:
    """Rows of all groups, one after the other."""
    if not groups:
        return np.zeros(0, np.intp), no_codes(0, truth.entities[:0])
    columns = zip(*(codes for _, _, codes in groups), strict=True)
    joined = [np.concatenate(column, axis=-1) for column in columns]
    return np.concatenate([rows for _, rows, _ in groups]), Codes._make(joined)


class FramePacker:
    """Packs, and learns what a body costs: `cost_known` where the viewer has it already, `cost_new` where not [B]."""

    def __init__(self) -> None:
        self.cost_known = 14.0
        self.cost_new = 26.0
        self.tail_cost = 0.6  # [B] for each of a tail
        self._out = PlaneWriter()

    def pack(
        self,
        head: FrameHead,
        truth: Truth,
        groups: Sequence[Group],
        base: Held | None,
        *,
        tail: bytes | None,
        has_table: bool,
    ) -> bytes:
        """A frame; `base` stands in the order of the truth's table."""
        out, before = self._out, base or Held.nothing(truth.table, truth.entities)
        elapsed = elapsed_since(before.time, truth.time)
        elapsed[~before.is_known] = 0.0
        with np.errstate(all="ignore"):
            if has_table:
                out.words(_steps(truth.entities))
            table = out.take()
            for level, rows, codes in groups:
                pack_group(out, level, rows, codes, before.codes.rows(rows), elapsed[rows], truth.fall, truth.count)
            bodies = out.take()
            if tail is not None:
                _pack_tail(out, tail, before.tail.data)
            animated = out.take()
        self._learn(groups, before, len(bodies), animated, tail)
        flags = (HAS_TABLE if has_table else 0) | (HAS_TAIL_TOLD if animated else 0)
        head = head._replace(flags=flags, groups=len(groups))
        return b"".join((pack_head(head, _counted(truth)), table, bodies, animated))

    def _learn(self, groups: Sequence[Group], before: Held, size: int, animated: bytes, tail: bytes | None) -> None:
        if tail:
            self.tail_cost += _LEARNING * (len(animated) / len(tail) - self.tail_cost)
        told = sum(len(rows) for _, rows, _ in groups)
        known = sum(int(np.count_nonzero(before.number[rows])) for _, rows, _ in groups)
        if told < 8:
            return
        if known * 2 > told:
            cost = max(size - (told - known) * self.cost_new, 1.0) / known
            self.cost_known += _LEARNING * (min(cost, 60.0) - self.cost_known)
        else:
            cost = max(size - known * self.cost_known, 1.0) / (told - known)
            self.cost_new += _LEARNING * (min(cost, 80.0) - self.cost_new)


def unpack_frame(body: bytes | memoryview, offset: int, base: Held | None, head: FrameHead) -> Unpacked:
    """The frame whose `head` stands at `offset`; `base` is what this side had when it sent the ack that it names.

    Raises:
        MessageError: it is damaged, or told against something else.
    """
    header = bytes(memoryview(body)[offset + FRAME_SIZE - HEADER.size : offset + FRAME_SIZE])
    _, _, time, _, _, _, count, _ = HEADER.unpack(header)
    if count > MOST_BODIES or head.groups > MOST_GROUPS or not np.isfinite(time):
        raise MessageError(f"a streamed frame says that it has {count} bodies in {head.groups} groups at {time} s")
    packed = PlaneReader(body, offset + FRAME_SIZE)
    try:
        with np.errstate(all="ignore"):
            before = _before(packed, head, count, base)
            told = _told(packed, head, before, time)
            tail = NO_TAIL
            if head.flags & HAS_TAIL_TOLD:
                tail = Tail(head.number, _unpack_tail(packed, before.tail.data))
        packed.end()
    except RecordingError as error:
        raise MessageError(f"a streamed frame cannot be read: {error}") from error
    rows, codes = told
    return Unpacked(head, header, Told(head.number, head.table, before.entities, rows, codes, time, tail))


def _pack_tail(out: PlaneWriter, tail: bytes, before: bytes) -> None:
    if tail == before:
        out.byte(_SAME_TAIL)
    elif not tail:
        out.byte(_NO_TAIL)
    else:
        out.byte(_NEW_TAIL)
        pack_tail(out, tail, before)


def _unpack_tail(packed: PlaneReader, before: bytes) -> bytes:
    how = packed.byte()
    if how == _NEW_TAIL:
        return unpack_tail(packed, before)
    if how not in (_SAME_TAIL, _NO_TAIL):
        raise MessageError(f"a streamed frame tells what is animated in a way {how}")
    return before if how == _SAME_TAIL else b""


def _before(packed: PlaneReader, head: FrameHead, count: int, base: Held | None) -> Held:
    if head.flags & HAS_TABLE:
        entities = np.cumsum(unfolded(packed.words(count, 4)), dtype=np.int32).view(np.uint32)
        return Held.nothing(head.table, entities) if base is None else base.moved_to(head.table, entities)
    if base is None or base.table != head.table or len(base.entities) != count:
        raise MessageError("a streamed frame does not say which bodies it has")
    return base


def _told(packed: PlaneReader, head: FrameHead, before: Held, time: float) -> tuple[NDArray[np.intp], Codes]:
    elapsed = elapsed_since(before.time, time)
    elapsed[~before.is_known] = 0.0
    fall = head.fall
    found = [unpack_group(packed, before.codes, elapsed, fall, len(before.entities)) for _ in range(head.groups)]
    if not found:
        return np.zeros(0, np.intp), no_codes(0, before.entities[:0])
    columns = zip(*(codes for _, codes in found), strict=True)
    rows = np.concatenate([rows for rows, _ in found])
    if len(np.unique(rows)) != len(rows):
        raise MessageError("a streamed frame tells a body twice")
    return rows, Codes._make(np.concatenate(column, axis=-1) for column in columns)


def _steps(entities: NDArray[np.uint32]) -> NDArray[np.uint32]:
    return np.asarray(folded(np.diff(entities.view(np.int32), prepend=np.int32(0))))


def _counted(truth: Truth) -> bytes:
    """The header with as many bodies as can be told of."""
    fields = list(HEADER.unpack(truth.header))
    fields[6] = truth.count
    return HEADER.pack(*fields)
