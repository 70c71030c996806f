"""What scripts remember comes back as it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

from elys.common.errors import ScriptError
from elys.sim_node.scripts.memory import Finder, Keeper, World


class Nobody:
    """Whom values name who live elsewhere: there is nobody."""

    def word_for(self, value: Any) -> None:
        return None

    def name_of_record(self, kind: type[Any]) -> None:
        return None


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
