"""Events as classes: a named tuple or a msgspec Struct says what an event holds, and which types that has.

    class DoorOpened(NamedTuple):        told and heard as "door_opened", with `door` and `speed` as its values
        door: Entity
        speed: float = 1.0

On the bus, in recordings and between files an event is its name and plain values: each script has a class of its own of what it
imports, and who listens may be in no script at all. So a value is checked and made plain where it is told, and made again, of the
listener's own class, where it is heard.
"""

from __future__ import annotations

import inspect
import logging
import re
import sys
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec

from elys.bus.messages.session import Event
from elys.common.components import Vec3
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.event_names import event_name, is_event_class
from elys.sim_node.scripts.handles import EntityHandle
from elys.sim_node.scripts.interruption import is_interruption
from elys.sim_node.scripts.modules import describe
from elys.sim_node.scripts.vector import Vector
from elys.sim_node.scripts.watchdog import ScriptGrowth, ScriptTimeout

Names = Mapping[str, Any]  # of the module that declares a class
_PLACE: Final = re.compile(r" - at `\$\.?(.*)`$")
_log = logging.getLogger(__name__)


class EventClasses:
    """Checks and makes events of classes that scripts declare."""

    def __init__(self, names_of: Callable[[type[Any]], Names], handle_of: Callable[[int], EntityHandle]) -> None:
        """`names_of` gives what the module of a class knows, `handle_of` the handle of an id."""
        self._names_of = names_of
        self._handle_of = handle_of
        self._checkers: dict[type[Any], tuple[type[msgspec.Struct], dict[str, Any]]] = {}

    def values_of(self, event: Any) -> dict[str, Any]:
        """The plain values of an event; TypeError naming the field that is of another type than its class says."""
        kind = type(event)
        checker, hints = self._checker(kind)
        plain = {name: _plain(getattr(event, name)) for name in hints}
        checked = _converted(kind, plain, checker)
        return {name: getattr(checked, name) for name in hints}

    def made(self, event: Event, kind: type[Any]) -> Any:
        """An event that was heard, as a value of a class; TypeError saying what of it does not fit."""
        checker, hints = self._checker(kind)
        checked = _converted(kind, event.values, checker)
        given = ((name, getattr(checked, name)) for name in hints)
        told = {name: value for name, value in given if value is not msgspec.UNSET}  # of others its class has defaults
        try:
            return kind(**{name: self._full(hints[name], value) for name, value in told.items()})
        except BaseException as error:  # out of the class's own code, as a __post_init__
            if isinstance(error, (ScriptTimeout, ScriptGrowth)) or is_interruption(error):
                raise
            raise TypeError(f"{kind.__name__} (event {event.kind!r}) is not made of that: {describe(error)}") from error

    def heard(self, happened: Mapping[str, Event], names: tuple[str | type[Any], ...]) -> Any | None:
        """The first of some names and classes that has happened; what does not fit its class is said, and not heard."""
        for name in names:
            if isinstance(name, str):
                if name in happened:
                    return happened[name]
            elif (event := happened.get(event_name(name))) is not None:
                try:
                    return self.made(event, name)
                except TypeError as error:
                    _log.error("an event that is waited for is not heard: %s", error)
        return None

    def _full(self, hint: Any, value: Any) -> Any:
        if value is not None and _names_entity(hint):
            return self._handle_of(value)
        return Vector(value) if hint == Vec3 else value

    def _checker(self, kind: type[Any]) -> tuple[type[msgspec.Struct], dict[str, Any]]:
        """A Struct of the same fields that takes no others, entities as ids; and the fields' own types."""
        if kind not in self._checkers:
            names = self._names_of(kind)
            hints = {name: _evaluated(kind, name, hint, names) for name, hint in _declared(kind).items()}
            optional = _with_default(kind)
            fields: list[Any] = []
            for name, hint in hints.items():
                plain = _as_plain(hint)
                fields.append((name, plain | msgspec.UnsetType, msgspec.UNSET) if name in optional else (name, plain))
            try:
                checker = msgspec.defstruct(kind.__name__, fields, forbid_unknown_fields=True, kw_only=True)
                msgspec.json.Decoder(checker)  # says what it cannot check
            except TypeError as error:
                raise TypeError(f"{kind.__name__} can be no event: {' '.join(str(error).split())}") from error
            self._checkers[kind] = checker, hints
        return self._checkers[kind]


def classes_heard_by(behaviour: type[Behaviour], names: Names) -> tuple[type[Any], ...]:
    """The events that `on_event` takes, as its argument is annotated: `event: DoorOpened | DoorClosed`; () for all."""
    hook: Any = behaviour.on_event
    program = getattr(hook, "program", None)  # of an async one
    signature = program.signature if program is not None else inspect.signature(hook)
    annotations = [parameter.annotation for parameter in list(signature.parameters.values())[1:2]]
    hint = annotations[0] if annotations else None
    if isinstance(hint, str):
        try:
            hint = eval(hint, dict(names))  # the script's own text, as Python itself would read it
        except Exception:  # a name for whoever reads it, as those under TYPE_CHECKING
            return ()
    is_union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    kinds = typing.get_args(hint) if is_union else (hint,)
    return kinds if all(map(is_event_class, kinds)) else ()


def module_names(kind: type[Any]) -> Names:
    """What the module of a class knows that is imported as in any program."""
    return vars(sys.modules[kind.__module__]) if kind.__module__ in sys.modules else {}


def _declared(kind: type[Any]) -> dict[str, Any]:
    """The fields of a class with their types as they are written, its bases' first."""
    found: dict[str, Any] = {}
    for owner in reversed(kind.__mro__):
        found |= inspect.get_annotations(owner)
    fields = kind.__struct_fields__ if issubclass(kind, msgspec.Struct) else kind._fields
    return {name: found.get(name, Any) for name in fields}


def _with_default(kind: type[Any]) -> set[str]:
    if not issubclass(kind, msgspec.Struct):
        return set(kind._field_defaults)
    defaults = kind.__struct_defaults__
    named = zip(reversed(kind.__struct_fields__), reversed(defaults), strict=False)
    return {name for name, default in named if default is not msgspec.NODEFAULT}


def _evaluated(kind: type[Any], name: str, hint: Any, names: Names) -> Any:
    if isinstance(hint, typing.ForwardRef):
        hint = hint.__forward_arg__
    if not isinstance(hint, str):
        return hint
    try:
        return eval(hint, dict(names))  # the script's own text, as Python itself would read it
    except Exception as error:
        raise TypeError(f"{kind.__name__}.{name}: its type {hint!r} cannot be read: {error}") from error


def _parts_of(hint: Any) -> tuple[Any, ...]:
    is_union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    return typing.get_args(hint) if is_union else (hint,)


def _names_entity(hint: Any) -> bool:
    return EntityHandle in _parts_of(hint)


def _as_plain(hint: Any) -> Any:
    """A field's type as it goes over the bus: an entity is its id."""
    if not _names_entity(hint):
        return Vec3 if hint is Vector else hint
    parts = [int if part is EntityHandle else part for part in _parts_of(hint)]
    return typing.Union[tuple(parts)]  # noqa: UP007  of parts that are known only now


def _plain(value: Any) -> Any:
    if isinstance(value, EntityHandle):
        return int(value.id)
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value


def _converted(kind: type[Any], values: Mapping[str, Any], checker: type[msgspec.Struct]) -> msgspec.Struct:
    try:
        return msgspec.convert(dict(values), checker)
    except msgspec.ValidationError as error:
        text = str(error)
        place = _PLACE.search(text)
        field = f".{place[1]}" if place else ""
        said = _PLACE.sub("", text).replace("`", "")
        for words, ours in (
            ("Object missing required field", "it lacks"),
            ("Object contains unknown field", "it has no"),
        ):
            said = said.replace(words, ours)
        raise TypeError(f"{kind.__name__}{field} (event {event_name(kind)!r}): {said[:1].lower()}{said[1:]}") from error
