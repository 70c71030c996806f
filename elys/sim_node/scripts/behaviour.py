"""The class that scripts derive from, and how their fields are declared.

from elys.script import Behaviour, about, seconds
from typing import Annotated

class Door(Behaviour):
    \"\"\"Opens for whoever comes near.\"\"\"

    rise: Annotated[float, about("How far it goes up.", unit="m", minimum=0.0)] = 2.0
    stays_open: Annotated[float, about("Before it closes again.", unit="s", minimum=0.0)] = 1.5
    keeper: Entity | None = None

    async def on_trigger_enter(self, other):
        await self.entity.move_to(self.home + (0.0, self.rise, 0.0), duration=0.5)
        await seconds(self.stays_open)
        await self.entity.move_to(self.home, duration=0.5)
"""

from __future__ import annotations

import inspect
import logging
import math
import random
import types
import typing
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, TypeGuard, TypeVar, get_args, get_origin

from elys.common.components.declaration import (
    About,
    Component,
    ComponentDeclaration,
    FieldDeclaration,
    Kind,
    about,
)
from elys.common.components.declaration import declare_field as declared
from elys.common.components.values import check_value
from elys.common.errors import ComponentError, ScriptError

if TYPE_CHECKING:
    from elys.bus.messages.session import Event
    from elys.sim_node.scripts.game_world import GameWorld
    from elys.sim_node.scripts.handles import EntityHandle, Touch
    from elys.sim_node.scripts.waiting import Call

B = TypeVar("B", bound="Behaviour")
_log = logging.getLogger("elys.script")
# Hooks that are called with nothing but the behaviour itself, or with what happened.
HOOKS: Final = (
    "start",
    "fixed_update",
    "update",
    "on_trigger_enter",
    "on_trigger_stay",
    "on_trigger_exit",
    "on_contact",
    "on_event",
    "on_input",
    "on_destroy",
)


class Behaviour:
    """What an entity does. Derive from it, declare fields with defaults, and write the hooks that are needed.

    Every hook may be `async`: it is begun when it is called, goes on in later ticks, and ends with its entity.

    Attributes:
        entity: the one it belongs to.
        world: everything else: find, spawn, ask, tell.
    """

    entity: EntityHandle
    world: GameWorld

    def begin(self, call: Call | Coroutine[Any, Any, Any]) -> None:
        """Begins an async function beside everything else: `self.begin(self.blink())`."""
        self.entity._scripts.start_task(self, call)  # type: ignore[arg-type]  # a script's async functions give Calls

    @property
    def random(self) -> random.Random:
        """Random numbers of its own, the same in each run of the scene."""
        if "_random" not in self.__dict__:
            self._random = self.entity._scripts.random_of(self)
        return self._random

    def every(self, interval: float, function: Callable[[], Any]) -> None:
        """Calls a method of its own every so many seconds, until it returns False: `self.every(0.5, self.blink)`."""
        name = self._own_method("every", function)
        if not 0.0 < float(interval) < math.inf:
            raise ValueError(f"every() takes an interval above 0 s, not {interval!r}")
        self.begin(self.entity._scripts.prelude("every", self, name, float(interval)))

    def after(self, delay: float, function: Callable[..., Any], *arguments: Any) -> None:
        """Calls a method of its own once, in so many seconds: `self.after(2.0, self.open, door)`."""
        name = self._own_method("after", function)
        if not 0.0 <= float(delay) < math.inf:
            raise ValueError(f"after() takes a delay of 0 s or more, not {delay!r}")
        self.begin(self.entity._scripts.prelude("after", self, name, float(delay), arguments))

    def _own_method(self, what: str, function: Callable[..., Any]) -> str:
        """The name of a method, which is what a state can hold of it."""
        name = getattr(function, "__name__", "")
        if getattr(function, "__self__", None) is not self or not hasattr(type(self), name):
            raise TypeError(f"{what}() takes a method of the script itself, as in self.{what}(0.5, self.blink)")
        return str(name)

    def log(self, text: str, *, level: Literal["info", "warning", "error"] = "info") -> None:
        """A line for the console, with the entity's name."""
        levels = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}
        if level not in levels:
            raise ValueError(f"log() takes the levels {', '.join(levels)}, not {level!r}")
        _log.log(levels[level], "%s: %s", self.entity._scripts.simulation.named(self.entity.id), text)

    def start(self) -> Any:
        """It begins: in the first tick in which its entity and script are there and enabled."""

    def fixed_update(self, dt: float) -> Any:
        """Each tick, before physics moves anything; dt [s]."""

    def update(self, dt: float) -> Any:
        """Each tick, after physics has moved everything; dt [s]."""

    def on_trigger_enter(self, other: EntityHandle) -> Any:
        """Something has come into its trigger, or it has come into one."""

    def on_trigger_stay(self, other: EntityHandle) -> Any:
        """It is still inside, each tick."""

    def on_trigger_exit(self, other: EntityHandle) -> Any:
        """It has left, or is no more."""

    def on_contact(self, other: EntityHandle, touch: Touch) -> Any:
        """It has begun to touch something."""

    def on_event(self, event: Event) -> Any:
        """Something was told to all (`world.emit`), or to this entity."""

    def on_input(self, player: int) -> Any:
        """A player did something in this tick; `world.input(player)` says what."""

    def on_destroy(self) -> Any:
        """It ends: its entity, its script or the component is taken away. Not at the end of the run."""


# What a field cannot be called: hooks, and all that scripts use of themselves.
_EVERY: Final = frozenset(name for name in (*dir(Behaviour), *Behaviour.__annotations__) if not name.startswith("_"))


def is_a(itself: Behaviour | None, behaviour: type[B]) -> TypeGuard[B]:
    """Whether it is one of a class, or of the same class of the same file as another script has imported it.

    Each script runs with copies of its own of the files it imports, so that each can be reloaded by itself.
    """
    named = (behaviour.__module__, behaviour.__qualname__)
    return itself is not None and any((base.__module__, base.__qualname__) == named for base in type(itself).__mro__)


def fields_of(
    behaviour: type[Behaviour], names: dict[str, Any], place_of: Callable[[type[Any], str], str]
) -> tuple[FieldDeclaration, ...]:
    """The fields that a behaviour declares, its bases' first: annotations with defaults that a scene can hold.

    Args:
        names: the script's module, in which annotations are looked up.
        place_of: the line at which a class declares a field.

    Raises:
        ScriptError: a field has a type or a default that no field can have, or a name that every behaviour has.
    """
    found: dict[str, FieldDeclaration] = {}
    for owner in reversed(behaviour.__mro__):
        if not issubclass(owner, Behaviour) or owner is Behaviour:
            continue
        for name, hint in inspect.get_annotations(owner).items():
            if name.startswith("_"):
                continue
            try:
                hint = _evaluated(behaviour, name, hint, names)
                if get_origin(hint) is ClassVar or name not in owner.__dict__:
                    continue  # a variable with no default is the script's own affair
                found[name] = _field(behaviour, name, hint, owner.__dict__[name])
            except ScriptError as error:
                raise ScriptError(f"{place_of(owner, name)}: {error}") from error
    return tuple(found.values())


def _evaluated(behaviour: type[Behaviour], name: str, hint: Any, names: dict[str, Any]) -> Any:
    if not isinstance(hint, str):
        return hint
    try:
        return eval(hint, names)  # the script's own text, as Python itself would read it
    except Exception as error:
        raise ScriptError(f"{behaviour.__name__}.{name}: its type {hint!r} cannot be read: {error}") from error


def _field(behaviour: type[Behaviour], name: str, hint: Any, default: Any) -> FieldDeclaration:
    if name in _EVERY:
        raise ScriptError(f"{behaviour.__name__}.{name} is what every behaviour has: give the field another name")
    base, note = hint, about("")
    if get_origin(hint) is Annotated:
        base = get_args(hint)[0]
        note = next((part for part in get_args(hint)[1:] if isinstance(part, About)), note)
    if _is_entity(base):
        base, note = int, _as_entity(note)
        default = 0 if default is None else default
    try:
        field = declared(behaviour.__name__, name, Annotated[base, note], default)
    except ComponentError as error:
        raise ScriptError(f"{error}, or Entity for another entity") from error
    if not all(isinstance(choice, str) for choice in field.choices):
        shown = ", ".join(map(repr, field.choices))
        raise ScriptError(
            f'{behaviour.__name__}.{name} has the choices {shown}: choices are texts, as Literal["a", "b"]'
        )
    if field.kind is Kind.ENTITY and isinstance(default, str):
        return field  # a path in the scene, which is looked up there
    owner = ComponentDeclaration(
        name=f"the default of {behaviour.__name__}", struct=Component, text="", fields=(field,)
    )
    try:
        return replace(field, default=check_value(owner, field, default))
    except ComponentError as error:
        raise ScriptError(str(error)) from error


def _is_entity(hint: Any) -> bool:
    from elys.sim_node.scripts.handles import EntityHandle

    if hint is EntityHandle:
        return True
    return get_origin(hint) in (typing.Union, types.UnionType) and EntityHandle in get_args(hint)


def _as_entity(note: About) -> About:
    return about(note.text, unit=note.unit, kind=Kind.ENTITY)
