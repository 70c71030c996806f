"""Messages to bytes and back: here a payload becomes a typed message or is refused with a reason.

Every payload starts with 8 bytes: b"ELYS", the protocol version (u16, little-endian), the encoding (u8) and a u8 that is 1 where
the body is packed (zstd), and in a request where its answer may be.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any, Final, TypeVar

import msgspec
import zstandard

from elys.bus.messages.state_frame import StateFrame, frame_parts, pack_frame, unpack_frame
from elys.bus.topics import PROTOCOL_VERSION, Encoding
from elys.common.errors import MessageError, ProtocolError

M = TypeVar("M")

MAGIC: Final = b"ELYS"
PREFIX: Final = struct.Struct("<4sHBB")
_ENCODING_CODES: Final = {Encoding.JSON: 1, Encoding.MSGPACK: 2, Encoding.STATE: 3, Encoding.RAW: 4}
_PREFIXES: Final = {
    encoding: PREFIX.pack(MAGIC, PROTOCOL_VERSION, code, 0) for encoding, code in _ENCODING_CODES.items()
}
PACKED: Final = 1
LONG: Final = 2048  # [bytes] from which on packing pays
MOST: Final = 256 << 20  # [bytes] of a body unpacked
_json = msgspec.json.Encoder()
_msgpack = msgspec.msgpack.Encoder()


def encode(message: Any, encoding: Encoding) -> bytes:
    """A message as it travels: prefix and body."""
    if encoding is Encoding.STATE:  # the longest and most frequent: its columns are copied once
        return b"".join((_PREFIXES[encoding], *frame_parts(message)))
    return with_prefix(encode_body(message, encoding), encoding)


def with_prefix(body: bytes, encoding: Encoding) -> bytes:
    """A body, as recordings keep it, as it travels."""
    return _PREFIXES[encoding] + body


def packed(payload: bytes) -> bytes:
    """A payload with its body packed, where that makes it shorter. Costs 3 ms for each megabyte."""
    body = zstandard.ZstdCompressor(level=1).compress(memoryview(payload)[PREFIX.size :])
    if len(body) + PREFIX.size >= len(payload):
        return payload
    return payload[: PREFIX.size - 1] + bytes((PACKED,)) + body


def with_packed_answer(request: bytes) -> bytes:
    """A request that says that its answer may be packed."""
    return request[: PREFIX.size - 1] + bytes((PACKED,)) + request[PREFIX.size :]


def may_be_packed(request: bytes) -> bool:
    """Whether the answer to a request may be packed."""
    return request[PREFIX.size - 1 : PREFIX.size] == bytes((PACKED,))


def unpacked(payload: bytes) -> bytes:
    """An answer's payload as it was before `packed`. Raises MessageError."""
    if not may_be_packed(payload):
        return payload
    view = memoryview(payload)[PREFIX.size :]
    try:
        size = zstandard.frame_content_size(view)
        if not 0 <= size <= MOST:
            raise MessageError(f"a packed message claims to have {size} bytes, at most {MOST} are read")
        return payload[: PREFIX.size - 1] + b"\0" + zstandard.ZstdDecompressor().decompress(view, max_output_size=size)
    except zstandard.ZstdError as error:
        raise MessageError(f"a packed message is damaged: {error}") from error


def encode_body(message: Any, encoding: Encoding) -> bytes:
    """A message without the prefix, as recordings keep it."""
    match encoding:
        case Encoding.JSON:
            return _json.encode(message)
        case Encoding.MSGPACK:
            return _msgpack.encode(message)
        case Encoding.STATE:
            assert isinstance(message, StateFrame)
            return pack_frame(message)
        case Encoding.RAW:
            return bytes(message)


def field_finder(field: str, encoding: Encoding) -> Callable[[bytes], str]:
    """Finds a text in payloads without decoding the rest; "" in those that have none."""
    kind = msgspec.defstruct("Named", [(field, str, "")])
    decoder = (msgspec.json if encoding is Encoding.JSON else msgspec.msgpack).Decoder(kind)

    def found(payload: bytes) -> str:
        try:
            return str(getattr(decoder.decode(memoryview(payload)[PREFIX.size :]), field))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return ""

    return found


def decode(payload: bytes, message: type[M], encoding: Encoding) -> M:
    """The message in a payload.

    Raises:
        ProtocolError: it was sent by another version of the protocol.
        MessageError: it is not such a message; the sentence says where it departs.
    """
    check_prefix(payload, encoding)
    return decode_body(payload, message, encoding, offset=PREFIX.size)


def decode_body(body: bytes, message: type[M], encoding: Encoding, *, offset: int = 0) -> M:
    """The message in a body that starts at `offset`; raises MessageError."""
    if encoding is Encoding.STATE:
        return unpack_frame(body, offset=offset)  # type: ignore[return-value]
    view = memoryview(body)[offset:]
    if encoding is Encoding.RAW:
        return bytes(view)  # type: ignore[return-value]
    try:
        return _decoder(message, encoding).decode(view)  # type: ignore[no-any-return, arg-type]
    except (msgspec.DecodeError, msgspec.ValidationError, RecursionError, UnicodeDecodeError) as error:
        raise MessageError(f"not a {message.__name__}: {error}") from error


def check_prefix(payload: bytes, encoding: Encoding) -> None:
    """Raises MessageError or ProtocolError unless the payload starts as one of ELYS in this encoding does."""
    if len(payload) < PREFIX.size:
        raise MessageError(f"a message has at least {PREFIX.size} bytes, this one {len(payload)}")
    magic, version, code, _ = PREFIX.unpack_from(payload)
    if magic != MAGIC:
        raise MessageError(f"not a message of ELYS: it starts with {magic!r}")
    if version != PROTOCOL_VERSION:
        raise ProtocolError(f"sent in protocol version {version}, this side speaks {PROTOCOL_VERSION}")
    if code != _ENCODING_CODES[encoding]:
        raise MessageError(f"encoded as {code}, expected {_ENCODING_CODES[encoding]} ({encoding.value})")


@cache
def _decoder(message: type[Any], encoding: Encoding) -> Any:
    if encoding is Encoding.JSON:
        return msgspec.json.Decoder(message)
    return msgspec.msgpack.Decoder(message)
