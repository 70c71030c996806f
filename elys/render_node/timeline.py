"""State frames and what lies between them: pictures are drawn at times at which no tick was, see `playout.py`."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import LOCAL_COLUMNS, WEIGHT_COLUMNS, StateFrame
from elys.common.math import quaternion
from elys.render_node.playout import STREAM_WAIT, Playout
from elys.render_node.rotation_path import FAST_TURN, rotations_between

LONGEST_LOOKAHEAD: Final = 0.1  # [s] of wall clock for which things go on as they did when the next frame comes late
LONGEST_GAP: Final = 0.5  # [s] of simulation between two frames; over longer ones things jump instead of gliding
PROBED: Final = 64  # bodies that are looked at before all are compared
KEPT_SEARCHES: Final = 3  # those who are asked for in turns

_ANIMATED: Final = tuple(name for name, _, _ in (*LOCAL_COLUMNS, *WEIGHT_COLUMNS))


class _Entry:
    """A state and the moments of the host's clock [s] between which things go there from the one before."""

    __slots__ = ("end", "frame", "start")

    def __init__(self, frame: StateFrame, start: float, end: float) -> None:
        self.frame, self.start, self.end = frame, start, end


class Timeline:
    """The state frames between which things are seen, and some that came early. A picture shows what was a steady while ago.

    When the next frame comes late things go on as they did, for one interval and LONGEST_LOOKAHEAD at most, then stand. When it
    comes at last they go on from where they are seen, and are some per cent faster until they are as late as before: time does
    not jump. It never goes back but where the host's does, or where a pause ends what was bridged.
    """

    def __init__(self) -> None:
        self.newest: StateFrame | None = None  # towards which things go
        self._previous: StateFrame | None = None
        self._entries: deque[_Entry] = deque()  # from the frame before on; the last is the one that came last
        self._playout = Playout()
        self._seen = 0.0  # [s] of simulation
        self._moment = 0.0  # [s] of the host's clock
        self._still: tuple[StateFrame | None, StateFrame | None, bool] = (None, None, False)
        self._found: list[tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.intp] | slice, NDArray[np.bool_]]]
        self._fastest: tuple[StateFrame | None, StateFrame | None, float, float] = (None, None, 0.0, 0.0)
        self._found = []  # who was looked for in which table, and where they stand

    def expect_stream(self) -> None:
        """States come by a stream, which leaves out what is late: less is waited for."""
        self._playout.longest_wait = STREAM_WAIT

    @property
    def interval(self) -> float:
        """Seconds of wall clock between two frames, as they come now."""
        return self._playout.interval

    @property
    def delay(self) -> float:
        """How long [s] after they can be here at the earliest frames are to be seen."""
        return self._playout.delay

    @property
    def previous(self) -> StateFrame | None:
        """The frame before the newest, where things glide from it."""
        return self._previous

    @property
    def latest(self) -> StateFrame | None:
        """The frame that came last, which may be seen later only."""
        return self._entries[-1].frame if self._entries else None

    @property
    def is_still(self) -> bool:
        """Whether the newest frame shows every body where the one before did."""
        newest, previous = self.newest, self._previous
        if newest is None or previous is None:
            return False
        if self._still[0] is not previous or self._still[1] is not newest:
            self._still = (previous, newest, _same_poses(previous, newest))
        return self._still[2]

    @property
    def gap(self) -> float:
        """Seconds of simulation between the two frames; 0 where there is but one."""
        if self._previous is None or self.newest is None:
            return 0.0
        return self.newest.simulation_time - self._previous.simulation_time

    @property
    def spins(self) -> bool:
        """Whether a body may have gone the long way round between the two frames."""
        newest, previous = self.newest, self._previous
        if newest is None or previous is None or not len(newest.entity):
            return False
        known = self._fastest
        if known[1] is not newest:
            before = known[3] if known[1] is previous else _largest(previous.angular_velocity)
            known = self._fastest = (previous, newest, before, _largest(newest.angular_velocity))
        return math.sqrt(3.0) * (known[2] + known[3]) / 2.0 * self.gap > FAST_TURN

    # --- taking ----------------------------------------------------------------------------------------------------

    def take(self, frame: StateFrame, now: float, *, first: float | None = None) -> bool:
        """Keeps a frame that arrived at `now` [s]; False for one that is older than what is here already.

        Those that it overtook came from `first` on, if they waited here for somebody to take them.
        """
        last = self._entries[-1] if self._entries else None
        if last is not None and frame.epoch == last.frame.epoch and frame.tick == last.frame.tick:
            if frame.playing == last.frame.playing and frame.published_at <= last.frame.published_at:
                return False
            if frame.playing <= last.frame.playing:
                self._take_again(last, frame, now)
                return True
        self._advance(now)
        stamp = frame.published_at * 1e-9
        if last is not None and frame.epoch != last.frame.epoch:
            self._playout.forget()
        if last is None or not self._follows(last, frame):
            self._playout.begin(stamp, frame.simulation_time, came=now)
            self._start_at(_Entry(frame, stamp, stamp))
        else:
            ticks = max(frame.tick - last.frame.tick, 1)
            first = now if first is None else first
            start, end = self._playout.follow(stamp, frame.simulation_time, ticks=ticks, first=first, came=now)
            if end <= last.end:  # the host's clock was set back: what is left until then is not waited for
                last.start = last.end = start
                self._start_at(last)
            self._entries.append(_Entry(frame, max(start, last.end), end))
        if not frame.playing:
            self._stop()
        self._advance(now)
        return True

    def lay(self, before: StateFrame, after: StateFrame) -> None:
        """Takes the two frames between which things are seen, whatever was told before; one twice where it is the only one."""
        self.newest, self._previous = after, before if before is not after else None

    def forget(self) -> None:
        """Starts anew, as after the host has changed."""
        self.newest = self._previous = None
        self._entries.clear()
        self._playout.forget()

    def show_latest(self) -> None:
        """Shows what came last at once, without waiting for what may be late."""
        if self._entries:
            self._seen, self._moment = self._entries[-1].frame.simulation_time, self._entries[-1].end
            self._look_up()

    def _take_again(self, last: _Entry, frame: StateFrame, now: float) -> None:
        """The same tick, told again: time stands from here on, or somebody edited while it stood."""
        self._advance(now)
        is_seen = self._seen >= last.frame.simulation_time
        was_playing, last.frame = last.frame.playing, frame
        if is_seen and not was_playing:
            self._start_at(last)
        if not frame.playing:
            self._stop()

    def _stop(self) -> None:
        """Time stands after the last frame: what was bridged has not come to pass."""
        self._playout.pause()
        self._seen = min(self._seen, self._entries[-1].frame.simulation_time)
        self._look_up()

    def _start_at(self, entry: _Entry) -> None:
        self._entries.clear()
        self._entries.append(entry)
        self._seen, self._moment = entry.frame.simulation_time, entry.end
        self._look_up()

    def _follows(self, last: _Entry, after: StateFrame) -> bool:
        before = last.frame
        gap = after.simulation_time - before.simulation_time
        if before.epoch != after.epoch or gap <= 0.0 or not (after.playing or before.playing):
            return False
        # Of a fast simulation states are far apart, and come as often as others.
        passed = (after.published_at - before.published_at) * 1e-9
        slope = self._playout.slope
        return gap <= LONGEST_GAP or (slope > 0.0 and gap <= 2.0 * passed / slope)

    # --- time ------------------------------------------------------------------------------------------------------

    def _advance(self, now: float) -> None:
        """Goes on to what is to be seen at `now`."""
        if len(self._entries) < 2:
            return
        last, before = self._entries[-1], self._entries[-2]
        length = max(last.end - last.start, 1e-6)
        ahead = min(length, LONGEST_LOOKAHEAD) if last.frame.playing else 0.0
        self._moment = moment = self._playout.moment(now, end=last.end + ahead)
        gap = last.frame.simulation_time - before.frame.simulation_time
        if moment >= last.end:
            time = last.frame.simulation_time + gap * (moment - last.end) / length
        else:
            time = self._time_of(moment)
        highest = last.frame.simulation_time + gap * ahead / length
        self._seen = max(self._seen, min(time, highest))
        self._look_up()

    def _time_of(self, moment: float) -> float:
        """The simulation time [s] that was at a moment of the host's clock before the last frame's."""
        before = self._entries[0].frame.simulation_time
        for entry in self._entries:
            if moment < entry.end:
                share = max(moment - entry.start, 0.0) / max(entry.end - entry.start, 1e-6)
                return before + share * (entry.frame.simulation_time - before)
            before = entry.frame.simulation_time
        return before

    def _look_up(self) -> None:
        """Finds the two frames between which it is, and forgets what is over."""
        entries = self._entries
        while len(entries) > 2 and entries[1].frame.simulation_time <= self._seen:
            entries.popleft()
        self.newest = entries[min(1, len(entries) - 1)].frame
        self._previous = entries[0].frame if len(entries) > 1 else None

    def fraction(self, now: float) -> float:
        """How far things have gone from the frame before (0) to the newest (1), or beyond while the next one is late."""
        self._advance(now)
        gap = self.gap
        if self.newest is None or gap <= 0.0:
            return 1.0
        return (self._seen - self.newest.simulation_time) / gap + 1.0

    def seen_time(self, now: float) -> float:
        """The simulation time [s] of what is seen at `now`; 0 before there is anything."""
        if self.newest is None:
            return 0.0
        self._advance(now)
        return self._seen

    def time_at(self, fraction: float) -> float:
        """The simulation time [s] of a fraction of the way; 0 before there is anything."""
        if self.newest is None or self._previous is None:
            return self.newest.simulation_time if self.newest is not None else 0.0
        gap = self.newest.simulation_time - self._previous.simulation_time
        return self._previous.simulation_time + gap * fraction

    def tick_at(self, fraction: float) -> int:
        """The last tick that is over at a fraction of the way; -1 before there is anything."""
        before, newest = self._previous, self.newest
        if newest is None or before is None or fraction >= 1.0:
            return newest.tick if newest is not None else -1
        return before.tick

    def seen_stamp(self, now: float) -> float:
        """What the host's clock said [s since 1970] when it was as is seen at `now`; 0 before there is anything."""
        if self.newest is None:
            return 0.0
        self._advance(now)
        return self._moment

    def seen_age(self, now: float) -> float:
        """How long ago [s] that was, without the way of the quickest frame: of that `bus.host_clock` knows."""
        return self._playout.age_of(self.seen_stamp(now), now) if self.newest is not None else 0.0

    def is_moving(self, now: float) -> bool:
        """Whether a picture a little later would differ even if no frame came."""
        self._advance(now)
        entries = self._entries
        if len(entries) < 2 or (len(entries) == 2 and self.is_still):
            return False
        last, gap = entries[-1], entries[-1].frame.simulation_time - entries[-2].frame.simulation_time
        length = max(last.end - last.start, 1e-6)
        ahead = min(1.0, LONGEST_LOOKAHEAD / length) if last.frame.playing else 0.0
        return self._seen < last.frame.simulation_time + gap * (ahead - 1e-6)

    def fraction_at(self, simulation_time: float) -> float:
        """The same at a time [s] of the simulation."""
        if self._previous is None or self.newest is None:
            return 1.0
        start, end = self._previous.simulation_time, self.newest.simulation_time
        return min(max((simulation_time - start) / (end - start), 0.0), 1.0)

    def poses(
        self, entities: NDArray[np.uint32], fraction: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.bool_]]:
        """World positions (K, 3) f64 [m] and rotations (K, 4) f32 of bodies, and whether each is known (K,)."""
        assert self.newest is not None
        rows, known = self._rows_of(self.newest.entity, entities)
        if not len(self.newest.entity):
            return np.zeros((len(entities), 3)), np.zeros((len(entities), 4), np.float32), known
        position, rotation = self.newest.position[rows], self.newest.rotation[rows]
        previous = self._previous
        if previous is None or fraction == 1.0 or not len(previous.entity):
            return position, rotation, known
        rows_before, known_before = self._rows_of(previous.entity, entities)
        position_before, rotation_before = previous.position[rows_before], previous.rotation[rows_before]
        share: NDArray[np.float64] | float = fraction
        between = position - position_before
        if known_before.all():
            between *= fraction
        else:  # who came with the newest frame stands where it says
            share = np.where(known_before, fraction, 1.0)
            between *= share[:, None]
        between += position_before
        turn = previous.angular_velocity[rows_before] + self.newest.angular_velocity[rows]
        turn *= np.float32((self.newest.simulation_time - previous.simulation_time) / 2)
        return between, rotations_between(rotation_before, rotation, share, turn=turn), known

    def _rows_of(
        self, table: NDArray[np.uint32], wanted: NDArray[np.uint32]
    ) -> tuple[NDArray[np.intp] | slice, NDArray[np.bool_]]:
        """As `rows_in`, without looking again while the same are wanted of frames that list the same; not to be written to."""
        for found in self._found:
            if found[1] is wanted and np.array_equal(found[0], table):
                return found[2], found[3]
        rows, known = rows_in(table, wanted)
        is_identity = len(table) == len(wanted) and bool(known.all()) and bool((np.diff(rows) == 1).all())
        self._found = [(table, wanted, slice(None) if is_identity else rows, known), *self._found[:KEPT_SEARCHES]]
        return self._found[0][2:]

    def locals(
        self, entities: NDArray[np.uint32], fraction: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """What animations make of entities, and whether each is known (K,).

        Position (K, 3) [m], rotation (K, 4) and scale (K, 3) are relative to the parent.
        """
        assert self.newest is not None
        newest, previous = self.newest, self._previous
        rows, known = rows_in(newest.local_entity, entities)
        if not len(newest.local_entity):
            count = len(entities)
            return np.zeros((count, 3), "f4"), np.zeros((count, 4), "f4"), np.zeros((count, 3), "f4"), known
        position, rotation = newest.local_position[rows], newest.local_rotation[rows]
        scale = newest.local_scale[rows]
        if previous is None or fraction >= 1.0 or not len(previous.local_entity):
            return position, rotation, scale, known
        before, known_before = rows_in(previous.local_entity, entities)
        share = np.where(known_before, fraction, 1.0).astype(np.float32)
        start, stretch = previous.local_position[before], previous.local_scale[before]
        return (
            start + (position - start) * share[:, None],
            quaternion.nlerp(previous.local_rotation[before], rotation, share).astype(np.float32),
            stretch + (scale - stretch) * share[:, None],
            known,
        )

    def weights(self, fraction: float) -> NDArray[np.float32]:
        """Of morph targets (W,), in the order of the newest frame."""
        assert self.newest is not None
        weight, before = self.newest.weight, self._previous
        if before is None or fraction >= 1.0 or not _same_weights(before, self.newest):
            return weight
        return np.asarray(before.weight + (weight - before.weight) * np.float32(fraction))


def _largest(numbers: NDArray[np.floating[Any]]) -> float:
    """Of their sizes."""
    return max(float(numbers.max(initial=0.0)), -float(numbers.min(initial=0.0)))


def _same_poses(before: StateFrame, after: StateFrame) -> bool:
    if len(before.entity) != len(after.entity):
        return False
    some = slice(
        None, None, 1 + len(after.entity) // PROBED
    )  # most frames differ in one of these: the rest is not read
    return (
        np.array_equal(before.position[some], after.position[some])
        and np.array_equal(before.entity, after.entity)
        and np.array_equal(before.position, after.position)
        and np.array_equal(before.rotation, after.rotation)
        and all(np.array_equal(getattr(before, name), getattr(after, name)) for name in _ANIMATED)
    )


def _same_weights(before: StateFrame, after: StateFrame) -> bool:
    """Whether both tell of the same targets of the same entities."""
    return np.array_equal(before.weight_entity, after.weight_entity) and np.array_equal(
        before.weight_target, after.weight_target
    )


def rows_in(table: NDArray[np.uint32], wanted: NDArray[np.uint32]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Where each of `wanted` (K,) stands in `table` (N,), and whether it does at all (else row 0)."""
    if len(table) == len(wanted) and np.array_equal(table, wanted):
        return np.arange(len(wanted)), np.ones(len(wanted), np.bool_)
    if not len(table):
        return np.zeros(len(wanted), np.intp), np.zeros(len(wanted), np.bool_)
    order = np.argsort(table, kind="stable")
    places = np.minimum(np.searchsorted(table, wanted, sorter=order), len(table) - 1)
    rows = order[places]
    known = table[rows] == wanted
    return np.where(known, rows, 0), known
