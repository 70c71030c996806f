"""Messages that could be meant seriously, made at random from the declarations of their types, and what may become of them."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from typing import Any

import msgspec
from msgspec import inspect

from elys.bus import codec
from elys.bus.messages.state_frame import BODY_SIZE, HEADER
from elys.bus.topics import PROTOCOL_VERSION, Encoding, Query, Topic

TEXTS = (
    "",
    "Ground",
    "RigidBody",
    "mass",
    "yard",
    "elys/yard/state",
    "../../etc/passwd",
    "é" * 40,
    "x" * 3000,
    "\x00",
    "{}",
)
NUMBERS = (0, 1, -1, 7, 2**31, 2**32 - 1, 2**53 + 1, 2**63 - 1, -(2**63), 1 << 20)
FLOATS = (0.0, -0.0, 1.0, -1.5, 1e-300, 1e300, 3.4e38, float("nan"), float("inf"), -float("inf"))
DEEPEST = 5


def message_of(kind: Any, chance: random.Random, depth: int = 0) -> Any:
    """A value of a type as msgspec describes it, as plain values that encode to what the type's reader expects."""
    match kind:
        case inspect.StructType():
            value = {
                field.encode_name: message_of(field.type, chance, depth + 1)
                for field in kind.fields
                if field.required or (depth < DEEPEST and chance.random() < 0.5)
            }
            return {kind.tag_field: kind.tag, **value} if kind.tag_field else value
        case inspect.UnionType():
            return message_of(chance.choice(kind.types), chance, depth + 1)
        case inspect.LiteralType():
            return chance.choice(kind.values)
        case inspect.IntType():
            return chance.choice(NUMBERS) if chance.random() < 0.5 else chance.randrange(300)
        case inspect.FloatType():
            return chance.choice(FLOATS) if chance.random() < 0.3 else chance.uniform(-10.0, 10.0)
        case inspect.StrType():
            return chance.choice(TEXTS)
        case inspect.BoolType():
            return chance.random() < 0.5
        case inspect.BytesType():
            return chance.randbytes(chance.randrange(200))
        case inspect.NoneType():
            return None
        case inspect.TupleType():
            return [message_of(item, chance, depth + 1) for item in kind.item_types]
        case inspect.ListType() | inspect.VarTupleType() | inspect.SetType() | inspect.FrozenSetType():
            length = chance.randrange(4) if depth < DEEPEST else 0
            return [message_of(kind.item_type, chance, depth + 1) for _ in range(length)]
        case inspect.DictType():
            length = chance.randrange(3) if depth < DEEPEST else 0
            return {str(chance.choice(TEXTS)): message_of(kind.value_type, chance, depth + 1) for _ in range(length)}
        case _:
            return chance.choice((None, 1, 1.5, "text", [1.0, 2.0, 3.0], {"mass": 1.0}))


def payload_of(message: type[Any], encoding: Encoding, chance: random.Random) -> bytes:
    """What a reader of such messages takes for one."""
    match encoding:
        case Encoding.RAW:
            body = chance.randbytes(chance.randrange(2000))
        case Encoding.STATE:
            count = chance.randrange(4)
            numbers = (chance.randrange(1 << 63), chance.randrange(1 << 20), chance.uniform(0.0, 100.0))
            header = HEADER.pack(*numbers, *(chance.randrange(1 << 63) for _ in range(3)), count, chance.randrange(2))
            body = header + chance.randbytes(count * BODY_SIZE)
        case _:
            value = message_of(inspect.type_info(message), chance)
            encoder = msgspec.json if encoding is Encoding.JSON else msgspec.msgpack
            body = encoder.encode(value)
    return codec.with_prefix(body, encoding)


def _flipped(payload: bytearray, chance: random.Random) -> None:
    for _ in range(chance.randrange(1, 8)):
        if payload:
            payload[chance.randrange(len(payload))] ^= 1 << chance.randrange(8)


def _cut(payload: bytearray, chance: random.Random) -> None:
    del payload[chance.randrange(len(payload) + 1) :]


def _repeated(payload: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(payload) + 1)
    payload[start:start] = payload[start : start + 200] * chance.randrange(1, 20)


def _stuffed(payload: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(payload) + 1)
    payload[start:start] = chance.choice((b"[" * 5000, b'{"a":' * 500, b"\xff" * 100, b"1e999", bytes(300), b'"'))


def _enlarged(payload: bytearray, chance: random.Random) -> None:
    payload += chance.choice((bytes, chance.randbytes))(chance.choice((70_000, 300_000)))


def _of_another_version(payload: bytearray, chance: random.Random) -> None:
    payload[:8] = struct.pack("<4sHBB", b"ELYS", chance.choice((0, 1, 4, PROTOCOL_VERSION + 1, 65535)), 1, 0)


def _of_another_encoding(payload: bytearray, chance: random.Random) -> None:
    payload[:8] = struct.pack("<4sHBB", b"ELYS", PROTOCOL_VERSION, chance.randrange(256), chance.randrange(256))


MUTATIONS: tuple[Callable[[bytearray, random.Random], None], ...] = (
    _flipped,
    _cut,
    _repeated,
    _stuffed,
    _of_another_version,
    _of_another_encoding,
)


def fuzzed(topic: Topic[Any] | Query[Any, Any], chance: random.Random) -> bytes:
    """A payload for a topic or a query: a third as it should be, a third changed, the rest noise; seldom a very large one."""
    kind, encoding = (
        (topic.message, topic.encoding) if isinstance(topic, Topic) else (topic.request, topic.request_encoding)
    )
    way = chance.random()
    if way > 0.8:
        return chance.randbytes(chance.choice((0, 1, 7, 8, 9, 50, 500)))
    payload = bytearray(payload_of(kind, encoding, chance))
    if way > 0.35:
        for _ in range(chance.randrange(1, 3)):
            chance.choice(MUTATIONS)(payload, chance)
    if chance.random() < 0.002:
        _enlarged(payload, chance)
    return bytes(payload)


class Stock:
    """Payloads that are used several times, as they are or changed again: making one takes long, and a million are wanted."""

    def __init__(self, chance: random.Random, *, size: int = 100, renewed: float = 0.05) -> None:
        self._chance = chance
        self._size = size
        self._renewed = renewed
        self._kept: dict[str, list[bytes]] = {}

    def of(self, topic: Topic[Any] | Query[Any, Any]) -> bytes:
        """One of a topic's."""
        kept, chance = self._kept.setdefault(topic.name, []), self._chance
        if len(kept) < self._size:
            kept.append(fuzzed(topic, chance))
            return kept[-1]
        place = chance.randrange(self._size)
        if chance.random() < self._renewed:
            kept[place] = fuzzed(topic, chance)
        if chance.random() < 0.5:
            return kept[place]
        payload = bytearray(kept[place])
        chance.choice(MUTATIONS)(payload, chance)
        return bytes(payload)
