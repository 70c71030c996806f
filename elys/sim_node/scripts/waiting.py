"""What an `async` function of a script can await.

    await seconds(1.5)                          simulation time, so it stands while time stands
    await ticks(3)
    told = await event("door", Opened)          the next event of a name or a class; or of several
    await until(lambda: self.entity.position[1] > 3.0)
    await self.open_door()                      another async function
    await all_of(self.blink(), self.slide())    until all of them are over: their results, in order
    first, result = await first_of(self.blink(), event("stop"))      until one is; the others are ended

Each is a value, not an object of Python's that runs: a state of the simulation holds them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, Final

from elys.sim_node.scripts.event_names import is_event_class
from elys.sim_node.scripts.program import Program


class Waits:
    """What can be awaited. Python itself never does: the program of the function around it does."""

    __slots__ = ()

    def __await__(self) -> Generator[Any, None, Any]:
        raise TypeError("only async functions of scripts can await this")
        yield


@dataclass(frozen=True, slots=True)
class Seconds(Waits):
    """A span of simulation time [s]."""

    duration: float


@dataclass(frozen=True, slots=True)
class Ticks(Waits):
    """So many ticks."""

    count: int


@dataclass(frozen=True, slots=True)
class EventNamed(Waits):
    """The next event of one of these names, or of classes that declare events."""

    names: tuple[str | type[Any], ...]


@dataclass(frozen=True, slots=True)
class Until(Waits):
    """That a condition holds: looked at in each tick, and never kept; a state keeps the place where it was written."""

    condition: Callable[[], Any]


@dataclass(frozen=True, slots=True)
class Call(Waits):
    """Another async function, not begun yet."""

    program: Program
    arguments: tuple[Any, ...]
    named: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Several(Waits):
    """Several at once: until all are over, or until the first is."""

    parts: tuple[Awaited, ...]
    is_first: bool


Awaited = Seconds | Ticks | EventNamed | Until | Call | Several
_AWAITED: Final = (Seconds, Ticks, EventNamed, Until, Call, Several)  # a union would be made anew each time


def seconds(duration: float) -> Seconds:
    """Waits for a span of simulation time [s]; 0 or less goes on in the next tick."""
    number = float(duration)
    if not math.isfinite(number):
        raise ValueError(f"seconds() takes a finite number of seconds, not {duration!r}")
    return Seconds(number)


def ticks(count: int) -> Ticks:
    """Waits for so many ticks, at least one."""
    return Ticks(int(count))


def event(*names: str | type[Any]) -> EventNamed:
    """Waits for the next event of one of these names, or of classes that declare events; gives the event, of its class."""
    if not names or not all(isinstance(name, str) or is_event_class(name) for name in names):
        raise TypeError(
            'event() takes names of events and classes that declare them (named tuples and Structs), as in event("door", Opened)'
        )
    return EventNamed(names)


def until(condition: Callable[[], Any]) -> Until:
    """Waits until a condition holds, which is asked once a tick; gives what it said."""
    if not callable(condition):
        raise TypeError(
            "until() takes a function, as in until(lambda: self.is_open): what it is given is asked in each tick"
        )
    return Until(condition)


def all_of(*parts: Awaited) -> Several:
    """Waits until all of them are over; gives their results as a list, in order."""
    return Several(_checked("all_of", parts), False)


def first_of(*parts: Awaited) -> Several:
    """Waits until one of them is over and ends the others; gives its number and its result. Of equals the first counts."""
    return Several(_checked("first_of", parts), True)


def _checked(name: str, parts: tuple[Any, ...]) -> tuple[Awaited, ...]:
    for part in parts:
        require_awaited(part, f"{name}()")
        if isinstance(part, Until):
            raise TypeError(f"{name}() cannot take until(...): put it into an async function of its own")
    if not parts:
        raise TypeError(f"{name}() takes at least one thing to wait for")
    return parts


def require_awaited(value: Any, what: str) -> None:
    """Raises TypeError for what a script cannot await."""
    if not isinstance(value, _AWAITED):
        raise TypeError(
            f"{what} cannot wait for a {type(value).__name__}: await seconds(...), ticks(...), event(...), until(...), "
            "all_of(...), first_of(...) or an async function of a script"
        )
