"""The exact state: all that decides how a simulation goes on, at one instant, for recordings that can be run again.

Little-endian, no padding:

    offset  bytes  what
    0       8      epoch             u64  which run of the host made it
    8       8      instant           u64  the beat after which it stands, see CommandRecord
    16      8      changes           u64  how many commands had changed the simulation by then
    24      8      tick              u64
    32      8      simulation time   f64  [s]
    40      8      state hash        u64  as the state frame has it
    48      4      fork              u32  how many forks there were
    52      4      flags             u32  bit 0: what led here cannot be done again, this state is how it goes on
    56             the state, as `elys.sim_node.state` writes it
"""

from __future__ import annotations

import math
import struct
from typing import Final, NamedTuple

import msgspec

from elys.common.errors import MessageError

EXACT_HEADER: Final = struct.Struct("<QQQQdQII")
UNEXPLAINED: Final = 1


class ExactHead(NamedTuple):
    """Of which instant an exact state is."""

    epoch: int
    instant: int
    changes: int
    tick: int
    time: float  # [s]
    state_hash: int
    fork: int
    is_unexplained: bool  # what led here is not in commands and steps

    def pack(self) -> bytes:
        """As it stands before the state."""
        return EXACT_HEADER.pack(*self[:7], UNEXPLAINED if self.is_unexplained else 0)


def unpack_head(body: bytes | memoryview) -> ExactHead:
    """The head of an exact state; raises MessageError if it is none."""
    if len(body) < EXACT_HEADER.size:
        raise MessageError(f"an exact state has at least {EXACT_HEADER.size} bytes, this one {len(body)}")
    epoch, instant, changes, tick, time, state_hash, fork, flags = EXACT_HEADER.unpack_from(body)
    head = ExactHead(epoch, instant, changes, tick, time, state_hash, fork, bool(flags & UNEXPLAINED))
    if not math.isfinite(head.time):
        raise MessageError(f"an exact state says its simulation time is {head.time}")
    return head


class ExactRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks for an exact state: the oldest kept at or after an instant, or as it is now (-1); with `newest` the newest kept."""

    instant: int = -1
    newest: bool = False


class ExactReply(msgspec.Struct, frozen=True, kw_only=True):
    """An exact state, compressed with zstd, and what the simulation is that made it (see recording-format.md)."""

    packed: bytes
    size: int  # [bytes] unpacked
    build: dict[str, str]
