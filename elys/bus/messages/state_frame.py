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
    60      4      flags             u32  bit 0: playing, bit 1: a tail follows the bodies,
                                              bit 2: told again, from a simulation's flight recorder,
                                              bit 3: of a fork, before it is as old as what it was forked from
                                              bits 4 to 31: the instant that it shows (see CommandRecord) + 1,
                                              modulo 2^28; 0: not told
    64      24 N   position          f64 x 3  [m]      world
            16 N   rotation          f32 x 4  x y z w  world
            12 N   linear velocity   f32 x 3  [m/s]
            12 N   angular velocity  f32 x 3  [rad/s]
            4 N    entity            u32

The tail is of what animations move, relative to each one's parent, and of the weights of morph targets:

            4      local count       u32  M
            4      weight count      u32  W
            12 M   local position    f32 x 3  [m]
            16 M   local rotation    f32 x 4  x y z w
            12 M   local scale       f32 x 3
            4 M    local entity      u32
            4 W    weight            f32
            4 W    weight entity     u32
            4 W    weight target     u32  which of its mesh' morph targets
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
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
TAIL_HEADER: Final = struct.Struct("<II")
LOCAL_COLUMNS: Final[tuple[tuple[str, str, int], ...]] = (
    ("local_position", "<f4", 3),
    ("local_rotation", "<f4", 4),
    ("local_scale", "<f4", 3),
    ("local_entity", "<u4", 1),
)
WEIGHT_COLUMNS: Final[tuple[tuple[str, str, int], ...]] = (
    ("weight", "<f4", 1),
    ("weight_entity", "<u4", 1),
    ("weight_target", "<u4", 1),
)
BODY_SIZE: Final = sum(np.dtype(dtype).itemsize * width for _, dtype, width in COLUMNS)
_LOCAL_SIZE: Final = sum(np.dtype(dtype).itemsize * width for _, dtype, width in LOCAL_COLUMNS)
_WEIGHT_SIZE: Final = sum(np.dtype(dtype).itemsize * width for _, dtype, width in WEIGHT_COLUMNS)
MAX_BODIES: Final = 1 << 22
PLAYING: Final = 1
HAS_TAIL: Final = 2
TOLD_AGAIN: Final = 4
FORKED: Final = 8
INSTANT_SHIFT: Final = 4
INSTANTS: Final = 1 << 28  # that can be told apart


def _no_rows(dtype: str, *width: int) -> NDArray[Any]:
    rows = np.zeros((0, *width), dtype)
    rows.setflags(write=False)
    return rows


_NO_VECTORS: Final = _no_rows("f4", 3)
_NO_ROTATIONS: Final = _no_rows("f4", 4)
_NO_NUMBERS: Final = _no_rows("f4")
_NO_IDS: Final = _no_rows("u4")


@dataclass(frozen=True, slots=True, kw_only=True)
class StateFrame:
    """Poses and velocities of N bodies, and what M entities and W weights are animated to, at one tick.

    Arrays are read-only views of the message where it was decoded.

    Attributes:
        position: [N, 3] f64 m, world. rotation: [N, 4] f32 x y z w. linear_velocity: [N, 3] f32 m/s.
        angular_velocity: [N, 3] f32 rad/s. entity: [N] u32.
        local_position: [M, 3] f32 m, relative to the parent. local_rotation: [M, 4] f32 x y z w. local_scale: [M, 3] f32.
        local_entity: [M] u32.
        weight: [W] f32 of a morph target. weight_entity: [W] u32. weight_target: [W] u32, its number.
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
    local_position: NDArray[np.float32] = field(default_factory=lambda: _NO_VECTORS)
    local_rotation: NDArray[np.float32] = field(default_factory=lambda: _NO_ROTATIONS)
    local_scale: NDArray[np.float32] = field(default_factory=lambda: _NO_VECTORS)
    local_entity: NDArray[np.uint32] = field(default_factory=lambda: _NO_IDS)
    weight: NDArray[np.float32] = field(default_factory=lambda: _NO_NUMBERS)
    weight_entity: NDArray[np.uint32] = field(default_factory=lambda: _NO_IDS)
    weight_target: NDArray[np.uint32] = field(default_factory=lambda: _NO_IDS)
    is_told_again: bool = False  # what a flight recorder shows of the past: it is not new
    is_forked: bool = False  # of a fork: what was told before it of later instants is void
    instant: int = -1  # that it shows, modulo `INSTANTS`; -1: not told

    @property
    def body_count(self) -> int:
        """How many bodies the frame tells of."""
        return len(self.entity)


def pack_frame(frame: StateFrame) -> bytes:
    """Header, columns and, where anything is animated, the tail, without the protocol prefix."""
    return b"".join(frame_parts(frame))


def frame_parts(frame: StateFrame) -> list[bytes | memoryview]:
    """What `pack_frame` joins, so that who puts something before it copies the columns once and not twice."""
    local_count, weight_count = len(frame.local_entity), len(frame.weight_entity)
    has_tail = local_count + weight_count > 0
    header = HEADER.pack(
        frame.epoch,
        frame.tick,
        frame.simulation_time,
        frame.published_at,
        frame.delta_sequence,
        frame.state_hash,
        frame.body_count,
        (PLAYING if frame.playing else 0)
        | (HAS_TAIL if has_tail else 0)
        | (TOLD_AGAIN if frame.is_told_again else 0)
        | (FORKED if frame.is_forked else 0)
        | ((frame.instant + 1) % INSTANTS << INSTANT_SHIFT),
    )
    parts: list[bytes | memoryview] = [header, *_packed(frame, COLUMNS)]
    if has_tail:
        parts += [TAIL_HEADER.pack(local_count, weight_count)]
        parts += [*_packed(frame, LOCAL_COLUMNS), *_packed(frame, WEIGHT_COLUMNS)]
    return parts


def instant_of(flags: int) -> int:
    """The instant that a frame with these flags shows, modulo `INSTANTS`; -1: it does not say."""
    return (flags >> INSTANT_SHIFT) - 1


def _packed(frame: StateFrame, columns: tuple[tuple[str, str, int], ...]) -> list[memoryview]:
    return [np.ascontiguousarray(getattr(frame, name), dtype).data for name, dtype, _ in columns]


def is_whole(payload: bytes | memoryview, *, offset: int = 0) -> bool:
    """Whether the frame in `payload` from `offset` on has as many bytes as it says."""
    if len(payload) - offset < HEADER.size:
        return False
    count: int
    flags: int
    *_, count, flags = HEADER.unpack_from(payload, offset)
    end = offset + HEADER.size + count * BODY_SIZE
    if count > MAX_BODIES or len(payload) < end:
        return False
    if not flags & HAS_TAIL:
        return len(payload) == end
    if len(payload) < end + TAIL_HEADER.size:
        return False
    local_count: int
    weight_count: int
    local_count, weight_count = TAIL_HEADER.unpack_from(payload, end)
    return len(payload) == end + TAIL_HEADER.size + local_count * _LOCAL_SIZE + weight_count * _WEIGHT_SIZE


def unpack_frame(payload: bytes, *, offset: int = 0) -> StateFrame:
    """The frame in `payload` from `offset` on, its arrays views into it.

    Raises:
        MessageError: too short, a length that does not fit its counts, or numbers that no sender can mean.
    """
    if len(payload) - offset < HEADER.size:
        raise MessageError(f"a state frame has at least {HEADER.size} bytes, this one {len(payload) - offset}")
    epoch, tick, time, published_at, sequence, state_hash, count, flags = HEADER.unpack_from(payload, offset)
    if not is_whole(payload, offset=offset):
        expected = HEADER.size + count * BODY_SIZE
        animated = " and more of what is animated" if flags & HAS_TAIL else ""
        raise MessageError(
            f"a state frame of {count} bodies has {expected} bytes{animated}, this one {len(payload) - offset}"
        )
    if not np.isfinite(time):
        raise MessageError(f"a state frame says its simulation time is {time}")
    arrays: dict[str, NDArray[Any]] = {}
    place = _unpack_columns(payload, offset + HEADER.size, COLUMNS, count, arrays)
    if flags & HAS_TAIL:
        local_count, weight_count = TAIL_HEADER.unpack_from(payload, place)
        place = _unpack_columns(payload, place + TAIL_HEADER.size, LOCAL_COLUMNS, local_count, arrays)
        _unpack_columns(payload, place, WEIGHT_COLUMNS, weight_count, arrays)
    return StateFrame(
        epoch=epoch,
        tick=tick,
        simulation_time=time,
        published_at=published_at,
        delta_sequence=sequence,
        state_hash=state_hash,
        playing=bool(flags & PLAYING),
        is_told_again=bool(flags & TOLD_AGAIN),
        is_forked=bool(flags & FORKED),
        instant=instant_of(flags),
        **arrays,
    )


def _unpack_columns(
    payload: bytes, place: int, columns: tuple[tuple[str, str, int], ...], count: int, arrays: dict[str, NDArray[Any]]
) -> int:
    """Adds columns that begin at byte `place`, and returns where they end."""
    for name, dtype, width in columns:
        column = np.frombuffer(payload, dtype, count * width, place)
        arrays[name] = column.reshape(count, width) if width > 1 else column
        place += column.nbytes
    return place
