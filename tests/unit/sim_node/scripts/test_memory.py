"""What scripts remember comes back as it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, cast

import msgspec
import pytest

from elys.common.errors import ScriptError
from elys.sim_node.scripts.memory import Finder, Keeper, World


class Linked(msgspec.Struct):
    name: str
    other: Any = None


class Counted(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    number: int
    parts: list[Any]

    def __post_init__(self) -> None:
        self.parts.append("made")


class Pair(NamedTuple):
    one: Any
    two: Any


RECORDS = {kind.__name__: kind for kind in (Linked, Counted, Pair)}


class Nobody:
    """Whom values name who live elsewhere: there are some records, and nobody else."""

    def word_for(self, value: Any) -> None:
        return None

    def name_of_record(self, kind: type[Any]) -> str | None:
        return kind.__name__ if kind in RECORDS.values() else None

    def record(self, name: str) -> type[Any] | None:
        return RECORDS.get(name)


def there_and_back(value: Any) -> Any:
    world = cast("World", Nobody())
    return Finder(world).found(Keeper(world).kept(value, "self.x"))


def test_exceptions_come_back_with_what_they_say():
    caught: list[Exception] = [ValueError("no", 3), KeyError("door"), StopAsyncIteration()]
    with pytest.raises(OSError) as lost:
        Path("/nowhere/at/all").read_bytes()
    with pytest.raises(UnicodeDecodeError) as garbled:
        b"\xff".decode()
    for error in (*caught, lost.value, garbled.value):
        again = there_and_back(error)
        assert type(again) is type(error) and str(again) == str(error) and again.args == error.args
    one, two = there_and_back([caught[0], caught[0]])
    assert one is two


class OwnError(Exception):
    pass


@pytest.mark.parametrize("value", [OwnError("x"), KeyboardInterrupt(), ValueError(object())])
def test_what_cannot_be_kept_is_refused_by_name(value: BaseException):
    with pytest.raises(ScriptError, match=r"self\.x"):
        there_and_back(value)


def test_structs_that_name_each_other_come_back() -> None:
    one, two = Linked("one"), Linked("two")
    one.other, two.other = [two], one
    again = there_and_back(one)
    assert type(again) is Linked and again.name == "one" and again.other[0].name == "two"
    assert again.other[0].other is again


def test_a_struct_comes_back_without_being_made_again() -> None:
    again = there_and_back(Counted(number=3, parts=[]))
    assert type(again) is Counted and (again.number, again.parts) == (3, ["made"])
    with pytest.raises(AttributeError):
        again.number = 4


def test_what_has_to_be_made_before_its_parts_may_not_be_one_of_them() -> None:
    inside: list[Any] = []
    inside.append(Pair(1, inside))
    again = there_and_back(inside)  # that way round it comes back
    assert again[0].two is again
    with pytest.raises(ScriptError, match=r"self\.x\[1\]\[0\] is the Pair that it is part of"):
        there_and_back(inside[0])


def test_what_is_shared_with_something_that_cannot_be_kept_is_kept_all_the_same() -> None:
    world, shared = cast("World", Nobody()), [1, 2]
    keeper = Keeper(world)
    with pytest.raises(ScriptError):
        keeper.kept([shared, object()], "self.x")
    assert Finder(world).found(keeper.kept([shared, shared], "self.y")) == [[1, 2], [1, 2]]
