"""A state frame as the simulation told it, in steps, made ready once for all who are sent it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import BODY_SIZE, HEADER, PLAYING, is_whole
from elys.bus.state_packing.bodies import bodies_of
from elys.bus.state_packing.compact import Codes, codes_of, have_codes
from elys.bus.streaming.motion import FALLS, fall_in_steps
from elys.common.errors import MessageError

_LONGEST_STEP: Final = 0.1  # [s] between frames that tell how bodies are accelerated
_LEAST_PULL: Final = 0.1  # [m/s^2] by which a body is accelerated at all
_MOST_PULL: Final = 1e4  # [m/s^2]
_ALIKE: Final = 0.02  # of it, within which it is the same


@dataclass(frozen=True, slots=True)
class Truth:
    """One instant of N bodies; those too far or too fast to be counted in steps are left out."""

    header: bytes  # of the state frame
    time: float  # [s] of simulation
    published_at: int  # [ns]
    is_playing: bool
    table: int  # rises whenever the list of entities becomes another
    position: NDArray[np.float64]  # [3, N] m
    rotation: NDArray[np.float32]  # [4, N]
    codes: Codes  # marked where they fall
    tail: bytes
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m/s^2] of those, as float32 holds it

    @property
    def fall(self) -> NDArray[np.float64]:
        """[3, 1] what gravity does, in steps."""
        return fall_in_steps(self.gravity)

    @property
    def count(self) -> int:
        """N."""
        return self.codes.body_count

    @property
    def entities(self) -> NDArray[np.uint32]:
        """[N] the table."""
        return self.codes.entity


class TruthReader:
    """Makes truths of payloads, and numbers their tables."""

    def __init__(self) -> None:
        self._table = 0
        self._entities: NDArray[np.uint32] | None = None
        self._before: tuple[float, NDArray[np.float32]] | None = None  # time and linear velocities of that table
        self._gravity = (0.0, 0.0, 0.0)

    def read(self, payload: bytes, *, offset: int) -> Truth:
        """The frame whose header stands at `offset`; MessageError if it is none."""
        if not is_whole(payload, offset=offset):
            raise MessageError("a state frame is shorter or longer than it says")
        view = memoryview(payload)[offset:]
        _, _, time, published_at, _, _, count, flags = HEADER.unpack_from(view)
        bodies = bodies_of(view, count)
        codes = codes_of(bodies)
        if codes is None:
            bodies = bodies.rows(np.flatnonzero(have_codes(bodies)))
            codes = codes_of(bodies)
            if codes is None:
                raise MessageError("a state frame holds bodies that cannot be told in steps")
        if self._entities is None or not np.array_equal(codes.entity, self._entities):
            self._table += 1
            self._entities, self._before = codes.entity, None
        falls = self._falling(time, bodies.linear)
        largest = codes.largest | np.where(falls, FALLS, np.uint8(0))
        return Truth(
            header=bytes(view[: HEADER.size]),
            time=time,
            published_at=published_at,
            is_playing=bool(flags & PLAYING),
            table=self._table,
            position=bodies.position,
            rotation=bodies.rotation,
            codes=codes._replace(entity=self._entities, largest=largest),
            tail=bytes(view[HEADER.size + count * BODY_SIZE :]),
            gravity=self._gravity,
        )

    def _falling(self, time: float, linear: NDArray[np.float32]) -> NDArray[np.bool_]:
        """[N] who is moved by gravity alone: as the frame before tells it, for the scene's settings are not known here.

        What most of those that are accelerated have in common is gravity; where one body touches another it is something else.
        """
        before, self._before = self._before, (time, linear)
        none = np.zeros(linear.shape[1], np.bool_)
        if before is None or not 0.0 < time - before[0] < _LONGEST_STEP:
            return none
        gained = (linear - before[1]) / np.float32(time - before[0])
        pulled = np.flatnonzero((np.abs(gained) > _LEAST_PULL).any(axis=0))
        if not len(pulled):
            return none
        x, y, z = np.median(gained[:, pulled], axis=1).tolist()
        size = math.sqrt(x * x + y * y + z * z)
        likely = np.array(((x,), (y,), (z,)), np.float32)
        falls: NDArray[np.bool_] = (np.abs(gained - likely) < _ALIKE * size).all(axis=0)
        if np.count_nonzero(falls) * 4 < len(pulled) or not 0.0 < size < _MOST_PULL:
            return none
        self._gravity = (x, y, z)
        return falls
