"""Which classes declare events, and what those are called: `class DoorOpened(NamedTuple)` declares "door_opened"."""

from __future__ import annotations

import re
from typing import Any, TypeGuard

import msgspec

from elys.bus.messages.session import Event


def is_event_class(kind: object) -> TypeGuard[type[Any]]:
    """Whether a class declares an event: a named tuple or a msgspec Struct."""
    return (
        isinstance(kind, type)
        and kind is not Event
        and (issubclass(kind, msgspec.Struct) or (issubclass(kind, tuple) and hasattr(kind, "_fields")))
    )


def event_name(kind: type[Any]) -> str:
    """What an event of a class is called."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__).lower()
