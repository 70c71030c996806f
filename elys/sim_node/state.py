"""Everything that decides what comes next, as one value: what `Simulation.capture` gives and `Simulation.restore` takes.

    state = simulation.capture()
    ...                                 # ticks, edits
    simulation.restore(state)           # the ticks from here give the same bits as they did

Values lie by path ("world/allocator/ids"), arrays as their bytes: what has not changed since another state is shared with it. The
byte form is msgpack behind a magic word, a version and a digest; who reads it believes none of it.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.commands import Grab
from elys.bus.messages.session import Event
from elys.common.errors import StateError
from elys.common.scene import SceneSettings
from elys.sim_node.ecs.changes import EntityDespawned, EntityReparented, EntitySpawned, WorldChanges
from elys.sim_node.inputs import Device
from elys.sim_node.physics.joints import BrokenJoint
from elys.sim_node.physics.settings import PhysicsSettings, SceneTraits
from elys.sim_node.physics.states import Problem
from elys.sim_node.systems.scene_joints import HeldJoint

MAGIC: Final = b"ELYSstat"
VERSION: Final = 1
_DIGEST_SIZE: Final = 16
_SMALL: Final = 1 << 15  # [bytes] of arrays that are compared at once
_FIRST_LOOK: Final = 1 << 14  # [bytes] of larger ones

_encode: Final = msgspec.msgpack.Encoder().encode

ATOMS: Final = frozenset({type(None), bool, int, float, str, bytes})
# Immutable through and through, so that a state may hold them as they are.
RECORDS: Final[Mapping[str, type[Any]]] = {
    record.__name__: record
    for record in (
        HeldJoint,
        Problem,
        BrokenJoint,
        EntitySpawned,
        EntityDespawned,
        EntityReparented,
        WorldChanges,
        Event,
        Grab,
        Device,
        SceneSettings,
        PhysicsSettings,
        SceneTraits,
    )
}
_CONTAINERS: Final[Mapping[str, Callable[[Iterable[Any]], Any]]] = {
    "list": list,
    "tuple": tuple,
    "set": set,
    "deque": deque,
}


class Column(NamedTuple):
    """An array as its bytes, which nothing can change."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    data: bytes | memoryview

    @classmethod
    def of(cls, array: NDArray[Any], previous: object = None, *, is_ours: bool = False) -> Column:
        """A copy of an array, or the array itself where nobody else has it; the previous column where it has the same bits."""
        if isinstance(previous, Column) and previous.equals(array):
            return previous
        if is_ours and array.flags.c_contiguous and array.nbytes:
            return cls(array.dtype, array.shape, _flat_bytes(array).data.toreadonly())
        return cls(array.dtype, array.shape, array.tobytes())

    def equals(self, array: NDArray[Any]) -> bool:
        """Whether an array has the same bits."""
        if self.shape != array.shape or self.dtype != array.dtype or not array.flags.c_contiguous:
            return False
        if array.nbytes <= _SMALL:
            return array.tobytes() == bytes(self.data)
        mine, other = np.frombuffer(self.data, np.uint8), _flat_bytes(array)
        first = slice(0, _FIRST_LOOK)  # what moves differs in its first rows already
        if not np.array_equal(mine[first], other[first]):
            return False
        whole = len(mine) // 8 * 8
        same = np.array_equal(mine[:whole].view(np.uint64), other[:whole].view(np.uint64))
        return same and np.array_equal(mine[whole:], other[whole:])

    def array(self) -> NDArray[Any]:
        """The array, to be written to."""
        return np.frombuffer(bytearray(self.data), self.dtype).reshape(self.shape)


def _flat_bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    return array.reshape(-1).view(np.uint8) if array.nbytes else np.zeros(0, np.uint8)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A simulation between two ticks.

    Attributes:
        tick: steps done. time: simulation time [s].
        values: all that was captured, by path.
        is_ours: captured in this process; what came from elsewhere is looked through before it is put back.
    """

    tick: int
    time: float
    values: Mapping[str, Any]
    is_ours: bool = False

    @property
    def size(self) -> int:
        """What its arrays take [bytes], those included that it shares with other states."""
        return size_of((self,))

    def to_bytes(self) -> bytes:
        """For files and other processes."""
        return b"".join(self.to_parts())

    def to_parts(self) -> list[bytes | memoryview]:
        """The bytes in pieces, where large arrays are not copied: for who writes them anyway."""
        content: list[bytes | memoryview] = []
        small = bytearray(b"\x93" + _encode(self.tick) + _encode(self.time) + _list_head(len(self.values)))
        for path, value in self.values.items():
            small += b"\x92" + _encode(path)
            if type(value) is Column and len(value.data) > _SMALL:
                name, descr, shape, data = _packed(value)
                small += b"\x94" + _encode(name) + _encode(descr) + _encode(shape) + _data_head(len(data))
                content += [bytes(small), data]
                small.clear()
            else:
                small += _encode(_packed(value))
        content.append(bytes(small))
        digest = hashlib.blake2b(digest_size=_DIGEST_SIZE)
        for part in content:
            digest.update(part)
        return [MAGIC, VERSION.to_bytes(4, "little"), digest.digest(), *content]

    @classmethod
    def from_bytes(cls, data: bytes) -> State:
        """What `to_bytes` gave.

        Raises:
            StateError: it is no state, of another version, damaged, or contradicts itself.
        """
        head = len(MAGIC) + 4 + _DIGEST_SIZE
        if len(data) < head or data[: len(MAGIC)] != MAGIC:
            raise StateError("this is no state of a simulation: it does not begin as one")
        version = int.from_bytes(data[len(MAGIC) : len(MAGIC) + 4], "little")
        if version != VERSION:
            raise StateError(
                f"this state has version {version}, and this ELYS reads {VERSION}: use the one that made it"
            )
        content = data[head:]
        if _digest(content) != data[head - _DIGEST_SIZE : head]:
            raise StateError(
                "this state is damaged: its content is not what it was when it was written; take another copy"
            )
        try:
            tick, time, values = msgspec.msgpack.decode(content, type=tuple[int, float, list[tuple[str, Any]]])
            return cls(
                tick=tick, time=time, values=MappingProxyType({path: _unpacked(value) for path, value in values})
            )
        except (msgspec.MsgspecError, ValueError, TypeError, KeyError, IndexError, RecursionError) as error:
            raise StateError(f"this state contradicts itself: {error}") from error


def size_of(states: Iterable[State]) -> int:
    """What the arrays of several states take together [bytes]; what they share counts once."""
    columns = {id(value): value for state in states for value in state.values.values() if type(value) is Column}
    return sum(len(column.data) for column in columns.values())


def copied(value: Any) -> Any:
    """A value of which nothing is shared that could change; TypeError for what a state cannot hold."""
    kind = type(value)
    if kind in ATOMS or RECORDS.get(kind.__name__) is kind:
        return value
    if kind in (list, tuple, set, deque):
        return kind(map(copied, value))
    if kind is dict:
        return {copied(key): copied(item) for key, item in value.items()}
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {kind.__module__}.{kind.__qualname__} cannot be part of a state")


def _list_head(count: int) -> bytes:
    """What msgpack writes before a list."""
    return bytes((0x90 | count,)) if count < 16 else b"\xdd" + count.to_bytes(4, "big")


def _data_head(size: int) -> bytes:
    """What msgpack writes before bytes of some length."""
    return b"\xc6" + size.to_bytes(4, "big")


def _packed(value: Any) -> Any:
    """A value as msgpack has it: lists begin with the word for what they are."""
    kind = type(value)
    if kind in ATOMS:
        return value
    if kind is Column:
        return ["array", np.lib.format.dtype_to_descr(value.dtype), list(value.shape), value.data]
    if kind is dict:
        return ["dict", [(_packed(key), _packed(item)) for key, item in value.items()]]
    if issubclass(kind, msgspec.Struct):
        return ["struct", kind.__name__, msgspec.to_builtins(value)]
    if kind.__name__ in RECORDS:
        return ["record", kind.__name__, [_packed(getattr(value, name)) for name in _fields_of(kind)]]
    return [kind.__name__, [_packed(item) for item in value]]


def _unpacked(value: Any) -> Any:
    if not isinstance(value, list):
        if type(value) not in ATOMS:
            raise ValueError(f"it holds a {type(value).__name__} where no state has one")
        return value
    kind, *rest = value
    if kind == "array":
        return _column(*rest)
    if kind == "dict":
        return {_unpacked(key): _unpacked(item) for key, item in rest[0]}
    if kind == "struct":
        return msgspec.convert(rest[1], RECORDS[rest[0]])
    if kind == "record":
        record = RECORDS[rest[0]]
        return record(**dict(zip(_fields_of(record), map(_unpacked, rest[1]), strict=True)))
    return _CONTAINERS[kind](map(_unpacked, rest[0]))


def _fields_of(record: type[Any]) -> tuple[str, ...]:
    """The fields of a named tuple or a dataclass."""
    return getattr(record, "_fields", None) or tuple(field.name for field in dataclasses.fields(record))


def _column(descr: Any, shape: list[int], data: bytes) -> Column:
    dtype = np.lib.format.descr_to_dtype(_tuples(descr))
    if dtype.hasobject:
        raise ValueError("it holds an array of objects")
    count = 1
    for length in shape:
        if not isinstance(length, int) or length < 0:
            raise ValueError(f"it holds an array of the shape {shape}")
        count *= length
    if not isinstance(data, bytes) or len(data) != count * dtype.itemsize:
        raise ValueError(f"an array of the shape {shape} has {count * dtype.itemsize} bytes, and it holds {len(data)}")
    return Column(dtype, tuple(shape), data)


def _tuples(descr: Any) -> Any:
    """The description of a dtype as numpy made it, of which msgpack makes lists."""
    if isinstance(descr, str):
        return descr
    return [(name, _tuples(inner), *(tuple(width) for width in more)) for name, inner, *more in descr]


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=_DIGEST_SIZE).digest()
