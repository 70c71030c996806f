"""Frames and acknowledgements of a stream as bytes. docs/streaming.md has the same in words, enough to write a client.

frame   head, the header of a state frame (56 bytes), the table if bit 0, groups (see `telling`), the tail if bit 1
ack     a head alone
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import HEADER
from elys.bus.streaming.motion import fall_in_steps
from elys.common.errors import MessageError

VERSION: Final = 1
HAS_TABLE: Final = 1
HAS_TAIL_TOLD: Final = 2
WANTS_KEY: Final = 1
WINDOW: Final = 64  # frames back that an ack, and a frame about others, tells of
LANES: Final = 32  # numbers of connections
MOST_BODIES: Final = 1 << 20
_FRAME: Final = struct.Struct("<BBHQIIIIQfffffffffff")
_ACK: Final = struct.Struct("<BBHQIIQII")
FRAME_SIZE: Final = _FRAME.size + HEADER.size
ACK_SIZE: Final = _ACK.size


class FrameHead(NamedTuple):
    """What a frame says of itself."""

    flags: int
    groups: int
    generation: int  # told anew from nothing whenever it rises
    number: int  # from 1 on, in a generation
    base: int  # the number of the ack whose bodies it is told against; 0: against nothing
    table: int  # number of its list of entities
    waiting: int  # bodies that are less exact than they should be
    others: int  # bit i: frame number - 1 - i is on its way, or was not acknowledged in `base`
    position_error: float  # [m] at most, where all those have come and no more
    rotation_error: float  # [rad]
    open_position_error: float  # [m] at most, whichever have come
    open_rotation_error: float  # [rad]
    round_trip: float  # [s] of the fastest of the last frames
    hold: float  # [s] from the simulation's publishing to the sending
    rate: float  # [B/s] that the link is taken to carry
    step: float  # [m] of the coarsest precision in use
    gravity_x: float  # [m/s^2] of what is marked as falling
    gravity_y: float
    gravity_z: float

    @property
    def fall(self) -> NDArray[np.float64]:
        """[3, 1] what gravity does, in steps."""
        return fall_in_steps((self.gravity_x, self.gravity_y, self.gravity_z))


class Ack(NamedTuple):
    """What a viewer has: of which frames, and by which connections more can come."""

    flags: int
    generation: int
    number: int  # of the ack, from 1 on, in a generation
    newest: int  # frame
    bits: int  # bit i: frame newest - 1 - i has come
    merged: int  # how many frames there were in this generation
    lanes: int  # bit i: connection i is open


def pack_head(head: FrameHead, state_header: bytes | memoryview) -> bytes:
    """The first bytes of a frame."""
    return _FRAME.pack(VERSION, *head) + bytes(state_header)


def unpack_head(body: bytes | memoryview, offset: int) -> FrameHead:
    """What a frame says of itself; raises MessageError."""
    if len(body) - offset < FRAME_SIZE:
        raise MessageError(f"a streamed frame has at least {FRAME_SIZE} bytes, this one {len(body) - offset}")
    version, *rest = _FRAME.unpack_from(body, offset)
    head = FrameHead(*rest)
    if version != VERSION:
        raise MessageError(f"a streamed frame of version {version}, this side reads {VERSION}")
    if not head.number or not head.table:
        raise MessageError("a streamed frame has no number")
    if not np.isfinite(head[8:19]).all():
        raise MessageError("a streamed frame says figures of itself that are no numbers")
    return head


def pack_ack(ack: Ack) -> bytes:
    """An acknowledgement."""
    return _ACK.pack(VERSION, ack.flags, 0, *ack[1:])


def unpack_ack(body: bytes | memoryview, offset: int) -> Ack:
    """An acknowledgement; raises MessageError."""
    if len(body) - offset != ACK_SIZE:
        raise MessageError(f"an acknowledgement has {ACK_SIZE} bytes, this one {len(body) - offset}")
    version, flags, _, *rest = _ACK.unpack_from(body, offset)
    if version != VERSION:
        raise MessageError(f"an acknowledgement of version {version}, this side reads {VERSION}")
    return Ack(flags, *rest)
