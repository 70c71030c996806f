"""Markers of a recording's timeline: what was said in it from beginning to end, a piece at a time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from elys.bus import codec, topics
from elys.bus.marker_log import MarkerLog, markers_of_command, markers_of_contacts, markers_of_events
from elys.bus.messages.timeline import Marker
from elys.bus.recording import Recording
from elys.bus.transports.mcap_reading import RecordedMessage
from elys.common.errors import MessageError, RecordingError

_READ_IN_A_ROW: Final = 240  # frames whose messages are looked through before others have their turn
_MARKED: Final[dict[str, Callable[[Any, float], list[Marker]]]] = {
    topics.EVENTS.name: markers_of_events,
    topics.CONTACTS.name: markers_of_contacts,
    topics.COMMANDS.name: markers_of_command,
}
_log = logging.getLogger(__name__)


async def read_markers(recording: Recording, log: MarkerLog) -> None:
    """Puts into `log` what was said in the whole recording; who asks meanwhile gets what was found so far."""
    for first in range(0, len(recording), _READ_IN_A_ROW):
        last = min(first + _READ_IN_A_ROW, len(recording)) - 1
        try:
            log.add(marker for m in recording.messages_of(first, last) for marker in _marked(recording, m))
        except RecordingError as error:
            _log.warning("markers end at tick %d: %s", recording.tick[first], error)
            return
        await asyncio.sleep(0.001)


def _marked(recording: Recording, message: RecordedMessage) -> list[Marker]:
    """The markers of a message."""
    make = _MARKED.get(message.channel)
    if make is None:
        return []
    topic = topics.topic_named(message.channel)
    try:
        content = codec.decode_body(message.body, topic.message, topic.encoding)
    except MessageError:
        return []  # it is told when it is played
    place = min(int(np.searchsorted(recording.tick, content.tick)), len(recording) - 1)
    return make(content, float(recording.time[place]))
