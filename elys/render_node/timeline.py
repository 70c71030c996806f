"""Two state frames and what lies between them: pictures are drawn at times at which no tick was."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import LOCAL_COLUMNS, WEIGHT_COLUMNS, StateFrame
from elys.common.math import quaternion
from elys.render_node.rotation_path import FAST_TURN, rotations_between

LONGEST_LOOKAHEAD: Final = 0.1  # [s] of wall clock for which things go on as they did when the next frame comes late
LONGEST_DELAY: Final = 0.5  # [s] by which a frame waits more than others; beyond, somebody has set a clock
DELAY_FOLLOWING: Final = 0.01  # of a longer delay, from frame to frame
SHORTEST_WAY: Final = 0.3  # of an interval, for what is left of the way to a frame that came very late
LONGEST_GAP: Final = 0.5  # [s] of simulation between two frames; over longer ones things jump instead of gliding
PROBED: Final = 64  # bodies that are looked at before all are compared
KEPT_SEARCHES: Final = 3  # those who are asked for in turns

_ANIMATED: Final = tuple(name for name, _, _ in (*LOCAL_COLUMNS, *WEIGHT_COLUMNS))


class Timeline:
    """The newest two frames. By default a picture shows what was one frame ago, moving towards the newest one.

    When the next frame comes late things go on as they did, for one interval and LONGEST_LOOKAHEAD at most. When it comes at
    last they go on from where they are seen, to be where it says when they would be had it come in time: frames that only
    waited on their way do not disturb an even motion.
    """

    def __init__(self) -> None:
        self.newest: StateFrame | None = None
        self._previous: StateFrame | None = None
        self._arrived = 0.0  # [s]
        self._first_fraction = 0.0  # where things were seen when the newest frame came
        self._delay = 0.0  # [s] from the sender's clock to this one's, of frames that do not wait
        self._reached = 0.0  # [s] when things are where the newest frame says
        self._interval = 1.0 / 60.0  # [s] in which the newest frame came after the one before
        self.is_still = False  # the newest frame shows every body where the one before did
        self._found: list[tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.intp] | slice, NDArray[np.bool_]]]
        self._fastest: tuple[StateFrame | None, StateFrame | None, float, float] = (None, None, 0.0, 0.0)
        self._found = []  # who was looked for in which table, and where they stand

    @property
    def interval(self) -> float:
        """Seconds of wall clock between the newest two frames."""
        return self._interval

    @property
    def previous(self) -> StateFrame | None:
        """The frame before the newest, where things glide from it."""
        return self._previous

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

    def take(self, frame: StateFrame, now: float) -> bool:
        """Keeps a frame that arrived at `now` [s]; False for one that is older than what is here already."""
        newest = self.newest
        if (
            newest is not None
            and frame.epoch == newest.epoch
            and frame.tick == newest.tick
            and frame.playing == newest.playing
        ):
            if frame.published_at <= newest.published_at:
                return False
            self.newest = frame  # a pause's edit: the same tick, told again
            self._previous, self.is_still = None, False
            return True
        seen_time = self.seen_time(now)
        self._previous = newest if newest is not None and self._follows(newest, frame) else None
        self._first_fraction = 0.0
        delay = now - frame.published_at * 1e-9
        is_known = self._previous is not None and self._delay <= delay <= self._delay + LONGEST_DELAY
        # Creeps up where all frames have become slower.
        self._delay = self._delay + DELAY_FOLLOWING * (delay - self._delay) if is_known else delay
        if self._previous is not None:
            # By the sender's clock: messages that waited arrive in bunches.
            between = (frame.published_at - self._previous.published_at) * 1e-9
            self._interval = min(max(between, 1e-3), 0.25)
            gap = frame.simulation_time - self._previous.simulation_time
            self._first_fraction = min(max((seen_time - self._previous.simulation_time) / gap, 0.0), 1.0)
        self.is_still = self._previous is not None and _same_poses(self._previous, frame)
        in_time = frame.published_at * 1e-9 + self._delay + self._interval
        self._reached = max(in_time, now + SHORTEST_WAY * self._interval)
        self.newest, self._arrived = frame, now
        return True

    def lay(self, before: StateFrame, after: StateFrame) -> None:
        """Takes the two frames between which things are seen, whatever was told before; one twice where it is the only one."""
        self.newest, self._previous = after, before if before is not after else None
        self.is_still = self._previous is not None and _same_poses(before, after)

    def forget(self) -> None:
        """Starts anew, as after the host has changed."""
        self.newest = self._previous = None
        self.is_still = False

    def fraction(self, now: float) -> float:
        """How far things have gone from the frame before (0) to the newest (1), or beyond while the next one is late."""
        if self._previous is None:
            return 1.0
        if now < self._reached:
            share = max(now - self._arrived, 0.0) / (self._reached - self._arrived)
            return self._first_fraction + (1.0 - self._first_fraction) * share
        return min(1.0 + (now - self._reached) / self._interval, self._last_fraction)

    def seen_time(self, now: float) -> float:
        """The simulation time [s] of what is seen at `now`; 0 before there is anything."""
        if self.newest is None:
            return 0.0
        if self._previous is None:
            return self.newest.simulation_time
        return self.time_at(self.fraction(now))

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

    def seen_age(self, now: float) -> float:
        """How long ago [s] what is seen at `now` was so: since the newest frame came, and what of the way to it is left."""
        return max(now - self._arrived + (1.0 - self.fraction(now)) * self._interval, 0.0)

    def is_moving(self, now: float) -> bool:
        """Whether a picture a little later would differ even if no frame came."""
        return self._previous is not None and not self.is_still and self.fraction(now) < self._last_fraction - 1e-9

    @property
    def _last_fraction(self) -> float:
        return 1.0 + min(1.0, LONGEST_LOOKAHEAD / self._interval)

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

    @staticmethod
    def _follows(before: StateFrame, after: StateFrame) -> bool:
        gap = after.simulation_time - before.simulation_time
        return before.epoch == after.epoch and after.playing and 0.0 < gap <= LONGEST_GAP


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
