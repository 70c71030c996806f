"""The state frame: where every moving body is at one tick, packed as a fixed header and columns.

It is sent each tick to whoever looks, newest wins, so it is laid out to be copied, not parsed (little-endian):

    offset  bytes  what
    0       8      protocol prefix, see `elys.bus.codec`
    8       8      epoch             u64  which run of the host made it
    16      8      tick              u64
    24      8      simulation time   f64  [s]
    32      8      published at      u64  [ns] wall clock of the sender
    40      8      delta sequence    u64  the scene deltas that must have been applied before it
    48      8      state hash        u64
    56      4      body count        u32  N
    60      4      flags             u32  bit 0: playing
    64      24 N   position          f64 x 3  [m]      world
            16 N   rotation          f32 x 4  x y z w  world
            12 N   linear velocity   f32 x 3  [m/s]
            12 N   angular velocity  f32 x 3  [rad/s]
            4 N    entity            u32
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import MessageError

HEADER: Final = struct.Struct("<QQdQQQII")
COLUMNS: Final[tuple[tuple[str, str, int], ...]] = (
    ("position", "<f8", 3),
    ("rotation", "<f4", 4),
    ("linear_velocity", "<f4", 3),
    ("angular_velocity", "<f4", 3),
    ("entity", "<u4", 1),
)
BODY_SIZE: Final = sum(np.dtype(dtype).itemsize * width for _, dtype, width in COLUMNS)
MAX_BODIES: Final = 1 << 22
PLAYING: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class StateFrame:
    """Poses and velocities of N bodies at one tick. Arrays are read-only views of the message where it was decoded.

    Attributes:
        position: [N, 3] f64 m, world. rotation: [N, 4] f32 x y z w. linear_velocity: [N, 3] f32 m/s.
        angular_velocity: [N, 3] f32 rad/s. entity: [N] u32.
    """

    epoch: int
    tick: int
    simulation_time: float
    published_at: int
    delta_sequence: int
    state_hash: int
    playing: bool
    position: NDArray[np.float64]
    rotation: NDArray[np.float32]
    linear_velocity: NDArray[np.float32]
    angular_velocity: NDArray[np.float32]
    entity: NDArray[np.uint32]

    @property
    def body_count(self) -> int:
        """How many bodies the frame tells of."""
        return len(self.entity)


def pack_frame(frame: StateFrame) -> bytes:
    """Header and columns, without the protocol prefix."""
    header = HEADER.pack(
        frame.epoch,
        frame.tick,
        frame.simulation_time,
        frame.published_at,
        frame.delta_sequence,
        frame.state_hash,
        frame.body_count,
        PLAYING if frame.playing else 0,
    )
    columns = [np.ascontiguousarray(getattr(frame, name), dtype).tobytes() for name, dtype, _ in COLUMNS]
    return b"".join((header, *columns))


def unpack_frame(payload: bytes, *, offset: int = 0) -> StateFrame:
    """The frame in `payload` from `offset` on, its arrays views into it.

    Raises:
        MessageError: too short, a length that does not fit its body count, or numbers that no sender can mean.
    """
    if len(payload) - offset < HEADER.size:
        raise MessageError(f"a state frame has at least {HEADER.size} bytes, this one {len(payload) - offset}")
    epoch, tick, time, published_at, sequence, state_hash, count, flags = HEADER.unpack_from(payload, offset)
    expected = HEADER.size + count * BODY_SIZE
    if count > MAX_BODIES or len(payload) - offset != expected:
        raise MessageError(f"a state frame of {count} bodies has {expected} bytes, this one {len(payload) - offset}")
    if not np.isfinite(time):
        raise MessageError(f"a state frame says its simulation time is {time}")
    arrays: dict[str, NDArray[Any]] = {}
    place = offset + HEADER.size
    for name, dtype, width in COLUMNS:
        column = np.frombuffer(payload, dtype, count * width, place)
        arrays[name] = column.reshape(count, width) if width > 1 else column
        place += column.nbytes
    return StateFrame(
        epoch=epoch,
        tick=tick,
        simulation_time=time,
        published_at=published_at,
        delta_sequence=sequence,
        state_hash=state_hash,
        playing=bool(flags & PLAYING),
        **arrays,
    )
