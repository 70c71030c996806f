"""Where bodies have been in the last seconds, and what touches: what debug drawing must remember from tick to tick."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.physics import ContactBatch
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.render_node.marks import Lines
from elys.render_node.timeline import rows_in

TRAIL_SECONDS: Final = 2.0  # of simulation
TRAIL_SAMPLES: Final = 60
MOST_TRAILS: Final = 500  # of all bodies that move those that went farthest
LEAST_WAY: Final = 0.02  # [m] of a body that counts as moving
MOST_CONTACTS: Final = 20_000  # that are remembered at most


class Trails:
    """Samples of the positions of bodies, as far back as TRAIL_SECONDS."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, NDArray[np.uint32], NDArray[np.float64]]] = deque()
        self._epoch = 0

    def take(self, frame: StateFrame) -> None:
        """Keeps where bodies are in a frame, if the last one kept is old enough; starts anew when time has gone back."""
        time = frame.simulation_time
        if self._samples and (frame.epoch != self._epoch or time < self._samples[-1][0]):
            self._samples.clear()
        self._epoch = frame.epoch
        if self._samples and time - self._samples[-1][0] < TRAIL_SECONDS / TRAIL_SAMPLES * 0.999:
            return
        self._samples.append((time, frame.entity, frame.position))
        while self._samples[0][0] < time - TRAIL_SECONDS:
            self._samples.popleft()

    def forget(self) -> None:
        """Starts anew."""
        self._samples.clear()

    def ways(
        self, entity: NDArray[np.uint32], position: NDArray[np.float64], time: float
    ) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
        """The ways (B, S, 3) [m] of those of the bodies (N,) that moved, oldest place first and `position` (N, 3), where they
        are at `time` [s], last; and whose they are (B,). Who was not there yet has stood where it came from.
        """
        past = [sample for sample in self._samples if sample[0] < time]
        places = np.repeat(position[:, None], len(past) + 1, axis=1)
        for place in range(len(past) - 1, -1, -1):
            rows, known = rows_in(past[place][1], entity)
            if len(past[place][1]):
                places[:, place] = np.where(known[:, None], past[place][2][rows], places[:, place + 1])
        way = np.linalg.norm(np.diff(places, axis=1), axis=2).sum(axis=1)
        moved = np.flatnonzero(way > LEAST_WAY)
        if len(moved) > MOST_TRAILS:
            moved = np.sort(moved[np.argsort(-way[moved], kind="stable")[:MOST_TRAILS]])
        return places[moved], entity[moved]


def trail_lines(ways: NDArray[np.float64], color: NDArray[np.uint8]) -> Lines:
    """Segments along ways (B, S, 3) in colours (B, 3), thinner the longer ago."""
    steps = ways.shape[1] - 1
    ends = np.stack([ways[:, :-1], ways[:, 1:]], axis=2).reshape(-1, 2, 3)
    width = np.tile(np.linspace(0.8, 2.4, steps), len(ways)) if steps else np.zeros(0)
    lines = Lines.of(ends, np.repeat(color, steps, axis=0), width=width)
    moving = (lines.ends[:, 0] != lines.ends[:, 1]).any(axis=1)
    return Lines(lines.ends[moving], lines.color[moving], lines.width[moving], lines.hidden[moving])


class Touching(NamedTuple):
    """C contacts that last: where they began, carried along by the body that moves."""

    point: NDArray[np.float64]  # (C, 3) world [m]
    normal: NDArray[np.float64]  # (C, 3) from a to b
    impulse: NDArray[np.float64]  # (C,) [N s] of the tick in which they began


class ContactLog:
    """What touches, from what is said when contacts begin and end: all that a recording tells of them."""

    def __init__(self) -> None:
        self._lasting: dict[tuple[int, int, int, int], tuple[int, NDArray[np.float64], NDArray[np.float64], float]] = {}
        self._epoch = 0

    def take(self, batch: ContactBatch, mirror: SceneMirror) -> None:
        """Notes what began and ended, the mirror standing at the batch's tick."""
        if batch.epoch != self._epoch:
            self._lasting.clear()
        self._epoch = batch.epoch
        ended = batch.ended
        for pair in zip(ended.entity_a, ended.entity_b, ended.body_a, ended.body_b, strict=True):
            self._lasting.pop(pair, None)
        begun = batch.begun
        pairs = zip(begun.entity_a, begun.entity_b, begun.body_a, begun.body_b, strict=True)
        for pair, point, normal, impulse in zip(pairs, begun.point, begun.normal, begun.normal_impulse, strict=True):
            # Who moves takes it along, without turning: a wheel's contact stays below the wheel.
            moving = [body for body in pair[2:] if body in mirror.entities and mirror.frame_row(body) >= 0]
            carrier = moving[0] if moving else pair[2]
            if carrier in mirror.entities and len(self._lasting) < MOST_CONTACTS:
                offset = np.subtract(point, mirror.world_pose(carrier).position)
                self._lasting[pair] = (carrier, offset, np.asarray(normal, np.float64), impulse)

    def forget(self) -> None:
        """Starts anew."""
        self._lasting.clear()

    def touching(self, mirror: SceneMirror, means: Callable[[Collection[int]], bool]) -> Touching:
        """Contacts where they are now, between entities that are meant."""
        found = [lasting for pair, lasting in self._lasting.items() if lasting[0] in mirror.entities and means(pair)]
        if not found:
            return Touching(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
        positions = np.array([mirror.world_pose(carrier).position for carrier, *_ in found], np.float64)
        return Touching(
            positions + np.array([offset for _, offset, _, _ in found]),
            np.array([normal for _, _, normal, _ in found]),
            np.array([impulse for *_, impulse in found]),
        )
