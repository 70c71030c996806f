"""Decoding: the inverse of encoding, and for every other payload a refusal that is one of two errors, never anything else."""

from __future__ import annotations

from typing import Any

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from elys.bus import codec, topics
from elys.bus.messages.session import Event, EventBatch
from elys.bus.messages.state_frame import COLUMNS, StateFrame
from elys.bus.topics import Encoding
from elys.common.errors import MessageError, ProtocolError

EVERYTHING: list[Any] = [
    *((topic.name, topic.message, topic.encoding) for topic in topics.TOPICS),
    *((f"{query.name} asked", query.request, query.request_encoding) for query in topics.QUERIES),
    *((f"{query.name} answered", query.reply, query.reply_encoding) for query in topics.QUERIES),
]
ALL = pytest.mark.parametrize(
    ("message", "encoding"), [row[1:] for row in EVERYTHING], ids=[row[0] for row in EVERYTHING]
)


def decode(payload: bytes, message: type[Any], encoding: Encoding) -> Any:
    try:
        return codec.decode(payload, message, encoding)
    except (MessageError, ProtocolError) as error:
        assert str(error)
        return None


@ALL
@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300), st.booleans())
@example(b"", True)
@example(b"[" * 5000, True)
@example(b"\x81" * 5000, True)
@example(b'{"epoch":' * 2000, True)
@example(b'{"epoch":1e999,"tick":-1}', True)
@example(b'{"epoch":99999999999999999999999999,"sequence":1,"tick":1}', True)
def test_any_bytes_are_a_message_or_are_refused(
    message: type[Any], encoding: Encoding, body: bytes, has_prefix: bool
) -> None:
    seen = decode(codec.with_prefix(body, encoding) if has_prefix else body, message, encoding)
    if encoding is not Encoding.RAW and seen is not None:
        assert isinstance(seen, message)


names = st.text(max_size=20)
numbers = st.integers(0, 2**32 - 1)
events = st.builds(
    Event,
    kind=names,
    entity=numbers,
    other=numbers,
    values=st.dictionaries(names, st.one_of(names, st.booleans(), st.floats(allow_nan=False, allow_infinity=False))),
)


@given(st.builds(EventBatch, epoch=numbers, tick=numbers, events=st.lists(events, max_size=5).map(tuple)))
def test_events_survive(batch: EventBatch) -> None:
    assert codec.decode(codec.encode(batch, Encoding.JSON), EventBatch, Encoding.JSON) == batch


@st.composite
def frames(draw: st.DrawFn) -> StateFrame:
    count = draw(st.integers(0, 20))
    columns = {}
    for name, dtype, width in COLUMNS:
        shape = (count, width) if width > 1 else (count,)
        columns[name] = draw(arrays.arrays(np.dtype(dtype), shape))
    u64 = st.integers(0, 2**64 - 1)
    return StateFrame(
        epoch=draw(u64),
        tick=draw(u64),
        simulation_time=draw(st.floats(allow_nan=False, allow_infinity=False)),
        published_at=draw(u64),
        delta_sequence=draw(u64),
        state_hash=draw(u64),
        playing=draw(st.booleans()),
        **columns,
    )


@settings(deadline=None)
@given(frames(), st.data())
def test_state_frames_survive_bit_for_bit_and_at_no_other_length(frame: StateFrame, data: st.DataObject) -> None:
    payload = codec.encode(frame, Encoding.STATE)
    seen = codec.decode(payload, StateFrame, Encoding.STATE)
    assert codec.encode(seen, Encoding.STATE) == payload
    for name, _, _ in COLUMNS:
        assert getattr(seen, name).tobytes() == getattr(frame, name).tobytes()
    length = data.draw(st.integers(0, len(payload) - 1))
    assert decode(payload[:length], StateFrame, Encoding.STATE) is None
    assert decode(payload + b"\0", StateFrame, Encoding.STATE) is None


@given(st.integers(0, 2**16 - 1))
def test_only_this_version_is_spoken(version: int) -> None:
    payload = codec.encode(EventBatch(epoch=1, tick=1, events=()), Encoding.JSON)
    other = payload[:4] + version.to_bytes(2, "little") + payload[6:]
    if version == topics.PROTOCOL_VERSION:
        assert decode(other, EventBatch, Encoding.JSON) is not None
    else:
        with pytest.raises(ProtocolError, match=str(version)):
            codec.decode(other, EventBatch, Encoding.JSON)
