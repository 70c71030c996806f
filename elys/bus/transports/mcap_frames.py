"""State frames out of a file that tells them against frames before them: any of them, from as few others as it takes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np

from elys.bus.state_packing.frames import Kind, Told, head_of, unpack_told
from elys.bus.topics import STATE
from elys.bus.transports.mcap_records import Place, RecordedMessage
from elys.common.errors import RecordingError

STATE_KEYS_NAME: Final = "elys/state_keys.v2"  # the attachment that says where keys stand
STATE_KEYS: Final = np.dtype([("number", "<u4"), ("chunk", "<u4"), ("message", "<u4")])
ROOM: Final = 64 << 20  # [bytes] of frames that are remembered, as they are on the bus
_LONGEST: Final = 4096  # differences in a row that are followed; a recorder writes fewer than a hundred


class StoredFrames(NamedTuple):
    """Where a file's stored messages are had."""

    chunk: Callable[[int], list[RecordedMessage]]
    keys: Callable[[], dict[int, Place]]  # by number


class FrameReader:
    """Unpacks the messages of the channel "state" of one file. Raises RecordingError."""

    def __init__(self, stored: StoredFrames) -> None:
        self._stored = stored
        self._told: OrderedDict[Place, Told] = OrderedDict()
        self._size = 0  # of their bodies [bytes]
        self._key: tuple[Place, Told] | None = None

    def body(self, message: RecordedMessage) -> bytes:
        """A frame as it was on the bus."""
        body = self._frame(message).body
        assert isinstance(body, bytes)
        return body

    def _frame(self, message: RecordedMessage) -> Told:
        chain: list[RecordedMessage] = []
        base: Told | None = None
        following: RecordedMessage | None = message
        while following is not None:
            known = self._known(following.place)
            if known is not None:
                base = known
                break
            chain.append(following)
            head = head_of(following.body)
            if head.kind is Kind.REFRESH:
                base = self._key_frame(head.base)
            if head.kind is not Kind.DIFFERENCE:
                break
            if len(chain) > _LONGEST:
                raise RecordingError(f"frame {head.number} is told against too many others")
            following = self._before(following, head.base)
        while chain:
            told = chain.pop()
            base = unpack_told(told.body, base)
            self._keep(told.place, base)
        assert base is not None
        return base

    def _known(self, place: Place) -> Told | None:
        if self._key is not None and self._key[0] == place:
            return self._key[1]
        if place not in self._told:
            return None
        self._told.move_to_end(place)
        return self._told[place]

    def _keep(self, place: Place, told: Told) -> None:
        self._told[place] = told
        self._size += len(told.body)
        while self._size > ROOM and len(self._told) > 2:
            self._size -= len(self._told.popitem(last=False)[1].body)

    def _key_frame(self, number: int) -> Told:
        """The key of this number, which is remembered: a whole run of frames may be told against it."""
        place = self._stored.keys().get(number)
        if place is None:
            raise RecordingError(f"the key frame {number} is not there")
        known = self._known(place)
        if known is None:
            messages = self._stored.chunk(place.chunk)
            if not 0 <= place.message < len(messages) or messages[place.message].channel != STATE.name:
                raise RecordingError(f"the key frame {number} is not where the file says")
            known = unpack_told(messages[place.message].body, None)
        if known.number != number:
            raise RecordingError(f"the key frame {number} is not where the file says")
        self._key = (place, known)
        return known

    def _before(self, message: RecordedMessage, number: int) -> RecordedMessage:
        """The frame of that number, which stands before the message."""
        for found in self._backwards(message.place):
            if (there := head_of(found.body).number) == number:
                return found
            if there < number:
                break
        raise RecordingError(f"frame {number}, which others are told against, is not there")

    def _backwards(self, place: Place) -> Iterator[RecordedMessage]:
        """The stored frames before a place, in its chunk and in those before."""
        number, last = place
        while True:
            messages = self._stored.chunk(number)
            for found in reversed(messages[:last]):
                if found.channel == STATE.name:
                    yield found
            number -= 1
            if number < 0:
                return
            last = len(self._stored.chunk(number))
