"""One viewer's stream, at the sender: what to tell it next, against what it has.

    truth ──▶ who is shown wrong by how much ──▶ who waits longest for most ──▶ as many as the link carries ──▶ a frame
    ack ───▶ what the viewer has (`base`), how long frames take (`rate`)

`base` is what the viewer had when it sent the newest ack: frames are told against it, so that any of them can be lost. `shown` is
what it will show when all that is on its way has come: who is right there needs nothing. Pure: no clock, no socket.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.streaming import StreamInterest
from elys.bus.state_packing.compact import POSITION_STEPS
from elys.bus.streaming.claims import Claim, claims
from elys.bus.streaming.flight import Flight, Sent
from elys.bus.streaming.held import NO_TAIL, Held, Tail, Told
from elys.bus.streaming.interest import Regard, regard
from elys.bus.streaming.lanes import LaneChoice
from elys.bus.streaming.motion import ARM, angles, distances, elapsed_since, moved_on
from elys.bus.streaming.packing import FramePacker, joined_rows
from elys.bus.streaming.rate import RateControl
from elys.bus.streaming.telling import COARSEST, coarse
from elys.bus.streaming.truth import Truth
from elys.bus.streaming.wire import FRAME_SIZE, WANTS_KEY, WINDOW, Ack, FrameHead

TOLERANCE: Final = 1.5 / POSITION_STEPS  # [m] times 2^level: what rounding at that level can be off, and a little
LONGEST_PAUSE: Final = 0.2  # [s] between two frames, where nothing is to be told
KEY_PAUSE: Final = 0.25  # [s] between two beginnings from nothing
LEVEL_PAUSE: Final = 0.2  # [s] between two changes of precision
OVERDUE: Final = 0.5  # [s], or three round trips, that a frame may come after one sent later by another connection
_FRAME_SHARE: Final = 600.0  # [B] a frame should be, that its head is no great part: slow links get fewer frames
_OVERHEAD: Final = 120  # [B] of zenoh, TCP and IP around a frame
_MOST_WAIT: Final = 1000.0  # tolerances off, beyond which more do not count
_TAIL_PATIENCE: Final = 6  # frames that what is animated may wait for a smaller one
_MOST_OUT: Final = WINDOW - 4  # frames on their way
_REGARD_EVERY: Final = 6  # frames
_MOST_GENERATION: Final = 1 << 62


class Outgoing(NamedTuple):
    """A frame to be sent by a connection."""

    lane: int
    body: bytes


class Sender:
    """Tell it each truth (`frame`), each ack (`acked`) and each interest."""

    def __init__(self, now: float, *, generation: int) -> None:
        self.rate = RateControl(now)
        self.interest = StreamInterest()
        self.generation = generation
        self.refused = 0  # acks that cannot be
        self.lost = 0  # frames
        self.sent = 0  # frames
        self.restarts = 0
        self._has_to_begin = False  # as soon as that may be
        self._packer = FramePacker()
        self._lanes = LaneChoice()
        self._key_at = now
        self._level = 0  # added to what each body is regarded with: the link's part in precision
        self._level_at = now
        self._tokens = 2.0 * _FRAME_SHARE  # [B]
        self._filled_at = now
        self._begin()

    def _begin(self) -> None:
        self._number = 0
        self._ack_number = 0
        self._merged = 0
        self._newest = 0  # that the viewer has
        self._base: Held | None = None
        self._shown: Held | None = None
        self._flight = Flight()
        self._patience = np.zeros(0)
        self._regard: Regard | None = None
        self._regarded = 0
        self._sent_at = -1.0
        self._tail_waits = 0
        self._last: Truth | None = None

    @property
    def size(self) -> int:
        """Bytes kept for this viewer, about."""
        held = sum(part.size for part in (self._base, self._shown) if part is not None)
        rows = sum(len(sent.told.rows) for sent in self._flight.all())
        return held + 60 * rows + self._patience.nbytes

    @property
    def is_waiting(self) -> bool:
        """Whether answers are due."""
        return bool(self._flight.pending())

    # --- what the viewer says ----------------------------------------------------------------------------------------

    def restart(self, now: float) -> None:
        """Begins anew from nothing, but not all the time."""
        self._has_to_begin = now - self._key_at < KEY_PAUSE
        if not self._has_to_begin:
            self._key_at = now
            self.generation += 1
            self.restarts += 1
            self._begin()

    def acked(self, ack: Ack, now: float) -> None:
        """Learns what the viewer has. What cannot be is refused, and costs the viewer a beginning from nothing at most."""
        self._count_lost(self._flight.give_up(ack.lanes))
        if ack.lanes != self._lanes.open or self.rate.stands_still:
            self.rate.heard(now)
        self._lanes.open = ack.lanes
        if ack.generation != self.generation:
            if self.generation < ack.generation < _MOST_GENERATION:  # of a sender before, whose clock was ahead
                self.generation = ack.generation
                self.restart(now)
            return
        if ack.flags & WANTS_KEY:
            self.restart(now)
            return
        if ack.number <= self._ack_number:
            return  # overtaken by a later one
        if ack.newest > self._number or ack.newest < self._newest:
            self.refused += 1
            return
        found, lost = self._flight.arrived(ack)
        self._count_lost(lost)
        if any(sent.is_lost for sent in found):  # and came after all
            self._shown = None
        if found:
            # Others have come that were sent much later: a lane that was closed meanwhile, or a message given up on the way.
            last = max(sent.at for sent in found)
            self._count_lost(self._flight.give_up_before(last - max(OVERDUE, 3.0 * self.rate.smoothed_trip)))
        self._take(found, ack, now)

    def _count_lost(self, count: int) -> None:
        self.lost += count
        if count:
            self._shown = None  # made anew, without what was lost

    def _take(self, found: list[Sent], ack: Ack, now: float) -> None:
        self._merged += len(found)
        if self._merged != ack.merged:  # one of both has miscounted: nothing can be told against that
            self.refused += 1
            self.restart(now)
            return
        self._ack_number, self._newest = ack.number, ack.newest
        for sent in found:
            base, told = self._base, sent.told
            if base is None:
                base = Held.nothing(told.table, told.entities)
            elif base.table != told.table:
                base = base.moved_to(told.table, told.entities)
            base.merge(told)
            self._base = base
        self.rate.answered(now, [(sent.at, now - sent.at) for sent in found], sum(sent.size for sent in found))

    # --- what is said to it --------------------------------------------------------------------------------------------

    def frame(self, truth: Truth, now: float, *, hold: float = 0.0) -> Outgoing | None:
        """The next frame, if there is something to tell and the link carries it now. `hold` [s]: how old the truth is."""
        if self._has_to_begin:
            self.restart(now)
        room = None if self._has_to_begin else self._room(now)
        if room is None:
            self.rate.look(now, is_limited=True, is_waiting=self.is_waiting)
            return None
        shown = self._shown_of(truth)
        position, rotation = moved_on(shown.codes, elapsed_since(shown.time, truth.time), truth.fall)
        off = distances(position, truth.position), angles(rotation, truth.rotation)
        levels = self._levels(truth)
        tolerance = TOLERANCE * np.exp2(levels.astype(np.float64))
        wrongness = (off[0] + ARM * off[1]) / tolerance
        wrongness[~shown.is_known] = _MOST_WAIT
        rows = np.flatnonzero(wrongness > 1.0)
        tail_changed = truth.tail != shown.tail.data
        self._wait(rows, wrongness)
        chosen = self._chosen(rows, shown, room)
        self.rate.look(now, is_limited=len(chosen) < len(rows), is_waiting=self.is_waiting)
        if not self._is_due(truth, now, shown, bool(len(rows)) or tail_changed):
            return None
        self._follow_link(now, len(rows), len(chosen))
        tail = self._tail(truth, shown, room) if tail_changed else None
        return self._send(truth, now, chosen, levels, off, tail, waiting=len(rows) - len(chosen), hold=hold)

    def _room(self, now: float) -> int | None:
        """Bytes that the next frame may have; None: not now."""
        rate = self.rate.rate
        pause = max(_FRAME_SHARE / rate, 1.0 / 240.0)
        self._tokens = min(self._tokens + rate * (now - self._filled_at), rate * 2.0 * max(pause, 0.025))
        self._filled_at = now
        pending = self._flight.pending()
        out = sum(sent.size for sent in pending if not self._lanes.is_stuck(sent, now, self.rate))
        everything = sum(sent.size for sent in pending)
        window = self.rate.window
        if self._number - self._newest >= _MOST_OUT or out >= window or everything >= 3.0 * window:
            return None
        if self._tokens < min(rate * pause, _FRAME_SHARE) or self._lanes.best(pending, now, self.rate) is None:
            return None
        return int(max(min(self._tokens, window - out + _FRAME_SHARE), _FRAME_SHARE)) - FRAME_SIZE - _OVERHEAD

    def _shown_of(self, truth: Truth) -> Held:
        """What the viewer will show when all that is expected has come, in the order of the truth's table."""
        if self._shown is None:
            base = self._base
            shown = (
                Held.nothing(truth.table, truth.entities)
                if base is None
                else base.moved_to(truth.table, truth.entities)
            )
            for sent in self._flight.pending():
                told = sent.told
                shown.merge(told if told.table == truth.table else told.moved_to(truth.table, truth.entities))
            self._shown = shown
        elif self._shown.table != truth.table:
            self._shown = None
            return self._shown_of(truth)
        if len(self._patience) != truth.count or self._regard is None or len(self._regard.weight) != truth.count:
            self._patience, self._regard = np.zeros(truth.count), None
        return self._shown

    def _levels(self, truth: Truth) -> NDArray[np.int32]:
        self._regarded -= 1
        if self._regard is None or self._regarded <= 0:
            self._regarded = _REGARD_EVERY
            self._regard = regard(self.interest, truth.position, truth.entities)
        return np.clip(self._regard.level + self._level, 0, COARSEST)

    def _wait(self, rows: NDArray[np.intp], wrongness: NDArray[np.float64]) -> None:
        """Who is shown wrong grows impatient, the sooner the more wrong and the more it matters; who is right does not."""
        assert self._regard is not None
        before = self._patience[rows]
        self._patience = np.zeros(len(self._patience))
        growth = self._regard.weight[rows] * np.minimum(wrongness[rows], _MOST_WAIT)
        self._patience[rows] = before + growth

    def _chosen(self, rows: NDArray[np.intp], shown: Held, room: int) -> NDArray[np.intp]:
        """As many as there is room for, the most impatient."""
        costs = np.where(shown.is_known[rows], self._packer.cost_known, self._packer.cost_new)
        if costs.sum() <= room:
            return rows
        order = np.argsort(-self._patience[rows], kind="stable")
        count = int(np.searchsorted(np.cumsum(costs[order]), room, side="right"))
        return np.sort(rows[order[:count]])

    def _is_due(self, truth: Truth, now: float, shown: Held, has_news: bool) -> bool:
        if has_news or now - self._sent_at >= LONGEST_PAUSE:
            return True
        if truth is self._last:
            return False
        codes = shown.codes
        return bool(
            codes.linear.any() or codes.angular.any()
        )  # it moves on as it was told, and has to be shown doing so

    def _follow_link(self, now: float, wanted: int, told: int) -> None:
        """Coarser while the turns take longer than two frames, finer while all are told and the half would be enough."""
        if now - self._level_at < LEVEL_PAUSE:
            return
        share = self._tokens / max(self._packer.cost_known * wanted, 1.0)
        if told * 2 < wanted and self._level < COARSEST:
            self._level, self._level_at = self._level + 1, now
        elif told == wanted and share > 2.5 and self._level > -COARSEST:
            self._level, self._level_at = self._level - 1, now

    def _tail(self, truth: Truth, shown: Held, room: int) -> bytes | None:
        self._tail_waits += 1
        if self._packer.tail_cost * len(truth.tail) > 0.5 * room and self._tail_waits < _TAIL_PATIENCE:
            return None
        self._tail_waits = 0
        return truth.tail

    def _send(
        self,
        truth: Truth,
        now: float,
        chosen: NDArray[np.intp],
        levels: NDArray[np.int32],
        off: tuple[NDArray[np.float64], NDArray[np.float64]],
        tail: bytes | None,
        *,
        waiting: int,
        hold: float,
    ) -> Outgoing:
        assert self._shown is not None
        self._number += 1
        number, base = self._number, self._base
        if base is not None and base.table != truth.table:
            base = base.moved_to(truth.table, truth.entities)
        groups = [
            (int(level), rows, coarse(truth.codes.rows(rows), int(level)))
            for level in np.unique(levels[chosen])
            for rows in (chosen[levels[chosen] == level],)
        ]
        rows, codes = joined_rows(groups, truth)
        told_tail = NO_TAIL if tail is None else Tail(number, tail)
        told = Told(number, truth.table, truth.entities, rows, codes, truth.time, told_tail)
        settled, opened = claims(truth, off, told, self._shown, base, self._flight.all())
        head = self._head(truth, waiting, settled, opened, levels, hold)
        has_table = self._base is None or self._base.table != truth.table
        body = self._packer.pack(head, truth, groups, base, tail=tail, has_table=has_table)
        self._shown.merge(told)
        self._patience[chosen] = 0.0
        lane = self._lanes.best(self._flight.pending(), now, self.rate)
        assert lane is not None
        self._lanes.used(lane, now)
        size = len(body) + _OVERHEAD
        self._flight.add(Sent(told, lane, size, now))
        self._tokens -= size
        self._sent_at, self._last = now, truth
        self.sent += 1
        return Outgoing(lane, body)

    def _head(
        self,
        truth: Truth,
        waiting: int,
        settled: Claim,
        opened: Claim,
        levels: NDArray[np.int32],
        hold: float,
    ) -> FrameHead:
        return FrameHead(
            flags=0,
            groups=0,
            generation=self.generation,
            number=self._number,
            base=self._ack_number if self._base is not None else 0,
            table=truth.table,
            waiting=waiting,
            others=self._flight.others(self._number),
            position_error=settled.position,
            rotation_error=settled.rotation,
            open_position_error=opened.position,
            open_rotation_error=opened.rotation,
            round_trip=self.rate.fastest,
            hold=hold,
            rate=self.rate.rate,
            step=float(np.exp2(levels.max(initial=0)) / POSITION_STEPS),
            gravity_x=truth.gravity[0],
            gravity_y=truth.gravity[1],
            gravity_z=truth.gravity[2],
        )
