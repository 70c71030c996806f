"""What of a session's messages a recording keeps: all that say something new, and of contacts in a compact one fewer digits.

Where nothing moves, ticks are alike: of their profiles four a second are kept and those of slow ticks; diagnostics that are what
they were a tick before are not told again. Who reads takes what is missing to be as it was.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.messages.state_frame import HEADER

PROFILE_INTERVAL: Final = 250_000_000  # [ns] between those of ticks in which nothing moves
SLOW: Final = 2.0  # times as long as the tick whose profile was kept last
_PIECE: Final = 24 << 10  # [bytes]
# What is kept of contacts in a compact recording, up to which column: 1 mm of points, 0.01 of normals, then 0.00001 of depths
# [m], impulses [N s] and speeds [m/s], or of what stands before an exponent.
_DECIMALS: Final = ((b'"normal":', 3), (b'"depth":', 2), (None, 5))
_TICK: Final = b'{"tick":'


class _Cost(msgspec.Struct):
    """What is looked at of a profile."""

    total: float


_costs: Final = msgspec.json.Decoder(_Cost)


class MessageSieve:
    """Looks at messages in the order in which they come."""

    def __init__(self, *, compact: bool) -> None:
        self._compact = compact
        self._frame = b""  # the last one without its header
        self._is_still = False
        self._profile_time = -PROFILE_INTERVAL
        self._profile_total = 0.0
        self._diagnostics = b""  # the last that were kept, without their tick
        self._tick = -1  # of the last diagnostics

    def kept(self, channel: str, body: bytes, time_ns: int) -> bytes | None:
        """What is recorded of a message; None for nothing."""
        if channel == topics.STATE.name:
            self._look(body)
        elif channel == topics.PROFILE.name and self._is_still:
            return body if self._is_wanted(body, time_ns) else None
        elif channel == topics.DIAGNOSTICS.name:
            return body if self._is_new(body) else None
        elif channel == topics.CONTACTS.name and self._compact:
            return with_fewer_digits(body)
        return body

    def _look(self, frame: bytes) -> None:
        columns = frame[HEADER.size :]
        self._is_still = columns == self._frame
        self._frame = columns

    def _is_wanted(self, profile: bytes, time_ns: int) -> bool:
        try:
            total = _costs.decode(profile).total
        except msgspec.DecodeError:
            return True
        if 0 <= time_ns - self._profile_time < PROFILE_INTERVAL and total < SLOW * self._profile_total:
            return False
        self._profile_time, self._profile_total = time_ns, total
        return True

    def _is_new(self, diagnostics: bytes) -> bool:
        number, comma, said = diagnostics.removeprefix(_TICK).partition(b",")
        if not comma or not number.isdigit():
            return True
        # Where time went back the file tells again what holds from there on.
        is_new = said != self._diagnostics or int(number) <= self._tick
        self._diagnostics, self._tick = said, int(number)
        return is_new


def with_fewer_digits(contacts: bytes) -> bytes:
    """The text of contacts with numbers cut off: points after 3 decimals (1 mm), normals after 2, the rest after 5.

    Done on the text, in pieces that fit a processor's cache: reading numbers and writing them again takes several times as long.
    """
    parts, start = [], 0
    for name, most in _DECIMALS:
        limit = len(contacts) if name is None else max(contacts.find(name, start), start)
        while start < limit:
            end = contacts.find(b",", start + _PIECE, limit) + 1 or limit  # not within a number
            parts.append(_cut_off(np.frombuffer(contacts, np.uint8, end - start, start), most))
            start = end
    return b"".join(parts)


def _cut_off(text: NDArray[np.uint8], most: int) -> bytes:
    is_digit = (text - np.uint8(ord("0"))) < 10
    place = np.arange(len(text), dtype=np.uint16)
    before = np.maximum.accumulate(np.where(is_digit, np.uint16(0), place))  # the last that is no digit
    is_decimal = text[before] == np.uint8(ord("."))
    return bytes(text[~(is_digit & is_decimal & (place - before > most))])
