"""What scripts remember, as values that a state of the simulation can hold, and back.

Numbers, texts, tuples, lists, dicts, sets, arrays, entities, components, other behaviours, random generators, Python's own
exceptions (without where they were raised), what can be awaited, and records (named tuples, dataclasses, Structs, enumerations)
that a script file declares, with their classes. What two places share they share again afterwards. Anything else, an open file
or a socket, has no other time to go back to and is refused by name.
"""

from __future__ import annotations

import builtins
import contextlib
import dataclasses
import enum
import random
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, Protocol

import msgspec
import numpy as np

from elys.bus.messages.session import Event
from elys.common.components import Component, component_from, values_of
from elys.common.errors import ScriptError
from elys.sim_node.input_actions import ActionState, Direction
from elys.sim_node.scripts.program import Program
from elys.sim_node.scripts.task import Frame, Task, Wait
from elys.sim_node.scripts.vector import Rotation, Vector
from elys.sim_node.scripts.waiting import Call, EventNamed, Seconds, Several, Ticks
from elys.sim_node.state import ATOMS

_MARK: Final = "\0"  # begins the word for what a value is
_DEEPEST: Final = 100
_CONTAINERS: Final[Mapping[str, Callable[..., Any]]] = {"list": list, "set": set, "deque": deque, "dict": dict}
_ROWS: Final[Mapping[str, type[Any]]] = {
    kind.__name__: kind for kind in (Vector, Rotation, Direction, ActionState)
}  # tuples of plain values
_ERRORS: Final[Mapping[str, type[Exception]]] = {
    name: kind for name, kind in vars(builtins).items() if isinstance(kind, type) and issubclass(kind, Exception)
}
_SIMPLE_WAITS: Final[Mapping[str, type[Any]]] = {kind.__name__: kind for kind in (Seconds, Ticks, EventNamed)}


class World(Protocol):
    """What values of scripts name that lives elsewhere."""

    def word_for(self, value: Any) -> tuple[Any, ...] | None:
        """An entity or a behaviour as a few plain values; None for what is neither."""

    def named_by(self, words: tuple[Any, ...]) -> Any:
        """What `word_for` had words for; ScriptError if nobody knows them any more."""

    def program(self, name: str, digest: str) -> Program:
        """An async function; ScriptError if it is other now or not there."""

    def record(self, name: str) -> type[Any] | None:
        """A class that a script declares, by "file:Name"."""

    def name_of_record(self, kind: type[Any]) -> str | None:
        """The opposite; None for a class of anybody else."""


class Keeper:
    """Makes values of memories. One keeper sees all that share anything."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._seen: dict[int, int] = {}
        self._held: list[Any] = []  # so that no id is given twice
        self._way: list[str] = []
        self._unmade: set[int] = set()  # what is made only when all its parts are, on the way

    def kept(self, value: Any, name: str) -> Any:
        """A value to be held by a state; ScriptError naming what in `name` cannot be one."""
        with self._beginning(name):
            return self._kept(value)

    def task(self, task: Task, name: str) -> Any:
        """A task likewise."""
        with self._beginning(name):
            return self._task(task)

    @contextlib.contextmanager
    def _beginning(self, name: str) -> Iterator[None]:
        """What was seen in a value that cannot be kept counts not as seen: nobody could find it there again."""
        self._way, self._unmade, count = [name], set(), len(self._seen)
        try:
            yield
        except BaseException:
            for seen in list(self._seen)[count:]:
                del self._seen[seen]
            raise

    def _kept(self, value: Any) -> Any:
        kind = type(value)
        if kind is tuple:
            return (f"{_MARK}tuple", *self._items(value))
        if kind in ATOMS:
            return value
        if isinstance(value, np.generic):
            return value.item()
        if (words := self._world.word_for(value)) is not None:
            return (f"{_MARK}named", *words)
        if isinstance(value, Component):
            return (f"{_MARK}component", kind.__name__, self._kept(values_of(value)))
        if kind is Event:
            return (f"{_MARK}Event", value.kind, value.entity, value.other, tuple(value.values.items()))
        if kind in _ROWS.values():
            return (f"{_MARK}{kind.__name__}", *value)
        if kind in _SIMPLE_WAITS.values():
            return (f"{_MARK}{kind.__name__}", *self._items(dataclasses.astuple(value)))
        if kind is Several:
            return (f"{_MARK}Several", value.is_first, *self._items(value.parts))
        if kind is Call:
            parts = (value.program.name, value.program.digest, self._kept(value.arguments), self._kept(value.named))
            return (f"{_MARK}Call", *parts)
        if isinstance(value, type) and (name := self._world.name_of_record(value)) is not None:
            return (f"{_MARK}class", name)
        if (number := self._seen.get(id(value))) is not None:
            if number in self._unmade:
                raise ScriptError(
                    f"{self._place} is the {kind.__qualname__} that it is part of, which cannot be kept: "
                    "lists, dicts, sets, dataclasses and Structs may hold themselves"
                )
            return (f"{_MARK}again", number)
        number = self._seen[id(value)] = len(self._seen)
        self._held.append(value)
        return self._whole(value, kind, number)

    def _whole(self, value: Any, kind: type[Any], number: int) -> Any:
        if kind in (list, deque):
            return (f"{_MARK}{kind.__name__}", number, *self._items(value))
        if kind is set:
            return (f"{_MARK}set", number, *sorted(self._items(value), key=repr))
        if kind is dict:
            items = ((self._kept(key), self._inside(f"[{key!r}]", item)) for key, item in value.items())
            return (f"{_MARK}dict", number, *(part for pair in items for part in pair))
        if kind is np.ndarray and not value.dtype.hasobject:
            return (f"{_MARK}array", number, value.dtype.str, value.shape, value.tobytes())
        if kind is random.Random:
            version, state, gauss = value.getstate()
            return (f"{_MARK}random", number, version, np.array(state, np.uint32).tobytes(), gauss)
        if _ERRORS.get(kind.__name__) is kind:
            return (f"{_MARK}error", number, kind.__name__, *self._parts_of(number, value.__reduce__()[1]))
        if _is_record(kind) and (name := self._world.name_of_record(kind)) is not None:
            return self._record(value, kind, name, number)
        raise ScriptError(
            f"{self._place} is a {kind.__qualname__}, which cannot be kept: a script may remember "
            "numbers, texts, tuples, lists, dicts, sets, arrays, entities, other scripts, exceptions and records of its own file"
        )

    def _record(self, value: Any, kind: type[Any], name: str, number: int) -> Any:
        if isinstance(value, enum.Enum):
            return (f"{_MARK}choice", number, name, value.name)
        if isinstance(value, tuple):
            return (f"{_MARK}record", number, name, *self._parts_of(number, value))
        fields = _fields_of(kind)
        parts = (self._inside(f".{field}", getattr(value, field)) for field in fields)
        return (f"{_MARK}record", number, name, *parts)

    def _task(self, task: Task) -> Any:
        frames = tuple(
            (
                frame.program.name,
                frame.program.digest,
                frame.place,
                tuple(frame.guards),
                tuple((name, self._inside(f", {name}", value)) for name, value in frame.variables.items()),
            )
            for frame in task.frames
        )
        wait = task.wait
        parts = tuple(self._task(part) for part in wait.parts) if wait is not None else ()
        waits = None if wait is None else (wait.due, self._items(wait.names), parts, wait.is_first, wait.asks)
        return (frames, waits, task.is_done, self._inside(" result", task.result))

    @property
    def _place(self) -> str:
        return "".join(self._way)

    def _parts_of(self, number: int, values: Any) -> tuple[Any, ...]:
        """Of what cannot be made before them."""
        self._unmade.add(number)
        parts = self._items(values)
        self._unmade.discard(number)
        return parts

    def _items(self, values: Any) -> tuple[Any, ...]:
        return tuple(self._inside(f"[{number}]", item) for number, item in enumerate(values))

    def _inside(self, step: str, value: Any) -> Any:
        if type(value) in ATOMS:
            return value
        if len(self._way) > _DEEPEST:
            raise ScriptError(
                f"{self._way[0]} holds values {_DEEPEST} deep in one another, which cannot be kept: make it flatter"
            )
        self._way.append(step)
        kept = self._kept(value)
        self._way.pop()
        return kept


def _is_record(kind: type[Any]) -> bool:
    is_plain = issubclass(kind, msgspec.Struct | enum.Enum) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))
    return is_plain or dataclasses.is_dataclass(kind)


def _fields_of(kind: type[Any]) -> tuple[str, ...]:
    if issubclass(kind, msgspec.Struct):
        return kind.__struct_fields__
    return tuple(field.name for field in dataclasses.fields(kind))


def _bare(kind: type[msgspec.Struct]) -> Any:
    """A Struct whose fields are still to come. None of its own code runs: `__post_init__` has run once, when it was new."""
    maker = kind
    if hasattr(
        kind, "__post_init__"
    ):  # which Structs call by their class alone: made of one without, it becomes the other
        config = kind.__struct_config__
        maker = msgspec.defstruct(
            kind.__name__,
            (),
            bases=(kind,),
            namespace={"__post_init__": lambda _: None},
            gc=config.gc,
            weakref=config.weakref,
            dict=config.dict,
        )
    made = maker(**dict.fromkeys(kind.__struct_fields__))
    if maker is not kind:
        msgspec.structs.force_setattr(made, "__class__", kind)
    return made


class Finder:
    """Makes memories of what a Keeper made, in the order in which it was kept."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._made: dict[int, Any] = {}

    def found(self, value: Any) -> Any:
        """A value as a script had it; ScriptError if it names what is not there any more."""
        if type(value) is not tuple:
            return value
        kind, *parts = value
        match kind.removeprefix(_MARK):
            case "tuple":
                return tuple(map(self.found, parts))
            case "named":
                return self._world.named_by(tuple(parts))
            case "again":
                return self._made[parts[0]]
            case "class":
                return self._kind(parts[0])
            case "component":
                return component_from(parts[0], self.found(parts[1]))
            case "Event":
                name, entity, other, values = parts
                return Event(kind=name, entity=entity, other=other, values=dict(values))
            case word if word in _ROWS:
                return _ROWS[word](*parts)
            case "Several":
                return Several(tuple(map(self.found, parts[1:])), parts[0])
            case "Call":
                name, digest, arguments, named = parts
                return Call(self._world.program(name, digest), self.found(arguments), self.found(named))
            case word if word in _SIMPLE_WAITS:
                return _SIMPLE_WAITS[word](*map(self.found, parts))
            case word:
                return self._whole(word, parts[0], parts[1:])

    def _whole(self, word: str, number: int, parts: list[Any]) -> Any:
        made: Any
        match word:
            case "array":
                dtype, shape, data = parts
                made = np.frombuffer(bytearray(data), dtype).reshape(shape)
            case "random":
                version, state, gauss = parts
                made = random.Random()
                made.setstate((version, tuple(np.frombuffer(state, np.uint32).tolist()), gauss))
            case "error" if parts[0] in _ERRORS:
                made = _ERRORS[parts[0]](*map(self.found, parts[1:]))
            case "choice":
                made = self._kind(parts[0])[parts[1]]
            case "record":
                return self._record(number, parts[0], parts[1:])
            case _:
                made = self._made[number] = _CONTAINERS[word]()  # known before its parts: one may be itself
                items = map(self.found, parts)
                if word == "dict":
                    made.update(dict(zip(items, items, strict=True)))
                elif word == "set":
                    made.update(items)
                else:
                    made.extend(items)
        self._made[number] = made
        return made

    def _record(self, number: int, name: str, parts: list[Any]) -> Any:
        kind = self._kind(name)
        if issubclass(kind, tuple):
            made = self._made[number] = kind(*map(self.found, parts))
            return made
        is_struct = issubclass(kind, msgspec.Struct)
        made = self._made[number] = _bare(kind) if is_struct else object.__new__(kind)
        put = msgspec.structs.force_setattr if is_struct else object.__setattr__
        for field, part in zip(_fields_of(kind), parts, strict=True):
            put(made, field, self.found(part))
        return made

    def _kind(self, name: str) -> type[Any]:
        kind = self._world.record(name)
        if kind is None:
            raise ScriptError(f"there is no {name} any more, of which a value was remembered")
        return kind

    def task(self, kept: Any) -> Task:
        """A task as it was; ScriptError if a function that it is in was changed since."""
        frames, waits, is_done, result = kept
        made = []
        for name, digest, place, guards, variables in frames:
            program = self._world.program(name, digest)
            values = {variable: self.found(value) for variable, value in variables}
            made.append(Frame(program, values, place, [(target, depth) for target, depth in guards]))
        wait = None
        if waits is not None:
            due, names, parts, is_first, asks = waits
            wait = Wait(due, tuple(map(self.found, names)), [self.task(part) for part in parts], is_first, asks)
        return Task(made, wait, is_done, self.found(result))
