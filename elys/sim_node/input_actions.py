"""Actions, axes and vectors: what keys, sticks and motions of a player mean in a scene, in this tick.

    InputMap of the scene ──┐
    a player's own bindings ┴─> Meaning ── with what his devices do in this tick ──> action, axis, vector

What a player has bound, and which of his actions were down when the last tick ended, is part of the simulation's state. All else
follows from it and from the raw input of the tick, so it may be asked at any time in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, Final, NamedTuple, Protocol

import msgspec

from elys.common.components import InputMap
from elys.common.components.values import values_from, values_text
from elys.common.errors import InputError, RequestError, StateError
from elys.common.ids import MAX_ENTITIES
from elys.common.input_controls import Control, Sort, check_name, controls_of, sorts_taking
from elys.common.input_response import axial, clipped, clipped_vector, radial
from elys.sim_node.ecs.world import World

MOST_BINDINGS: Final = 64  # names that a player binds
PUSHED: Final = 0.5  # of the way, from which on a stick or a trigger is a button that is down
LET_GO: Final = 0.4  # below which it is up again
Bindings = Mapping[str, str]  # controls by name, as `input_controls` reads them


class ActionState(NamedTuple):
    """What an action does in a tick; true where it is down."""

    is_down: bool
    was_pressed: bool  # in this tick, however shortly
    was_released: bool

    def __bool__(self) -> bool:
        return self.is_down


class Direction(NamedTuple):
    """A vector of an input: x to the right, y up, forward or away from the player."""

    x: float
    y: float


class Declared(NamedTuple):
    """What a scene declares: the texts of its InputMap, and how devices answer."""

    actions: str  # as JSON
    axes: str
    vectors: str
    stick_dead_zone: float
    trigger_dead_zone: float
    curve: float
    pointer_speed: float  # [points/s]
    wheel_speed: float  # [notches/s]
    tick_rate: float  # [1/s]


class Meaning(NamedTuple):
    """The controls of everything that a player can do, and whether a motion may go beyond 1."""

    declared: Declared
    controls: Mapping[Sort, Mapping[str, tuple[Control, ...]]]
    free: frozenset[tuple[Sort, str]]  # axes and vectors that the scene itself gives a motion

    def of(self, sort: Sort, name: str) -> tuple[Control, ...]:
        """The controls of a name; ValueError for one that is none, with those there are."""
        known = self.controls[sort]
        if name not in known:
            there = f"there are {', '.join(known)}" if known else "the scene declares none"
            raise ValueError(f"there is no {sort} {str(name)[:60]!r}: {there}")
        return known[name]


class Doing(Protocol):
    """What a player's devices do in this tick, see `inputs.PlayerInput`."""

    def is_down(self, name: str) -> bool: ...
    def is_kept_down(self, name: str) -> bool: ...
    def was_pressed(self, name: str) -> bool: ...
    def was_released(self, name: str) -> bool: ...
    def moved(self, name: str) -> float: ...
    def axis(self, name: str) -> float: ...
    def stick(self, x: str, y: str) -> tuple[float, float]: ...


def declared_in(world: World, tick_rate: float) -> Declared:
    """What the first InputMap that is switched on says; the defaults where there is none."""
    entities = world.query(InputMap, enabled_only=True).entities
    if not len(entities):
        return _defaults(tick_rate)
    table = world.table(InputMap)
    row = table.row_of[int(entities[0]) & MAX_ENTITIES]
    stored = {field: table.whole_column(field)[row] for field in Declared._fields[:-1]}
    return Declared(
        actions=world.strings.lookup(int(stored["actions"])),
        axes=world.strings.lookup(int(stored["axes"])),
        vectors=world.strings.lookup(int(stored["vectors"])),
        stick_dead_zone=float(stored["stick_dead_zone"]),
        trigger_dead_zone=float(stored["trigger_dead_zone"]),
        curve=float(stored["curve"]),
        pointer_speed=float(stored["pointer_speed"]),
        wheel_speed=float(stored["wheel_speed"]),
        tick_rate=tick_rate,
    )


@lru_cache(maxsize=4)
def _defaults(tick_rate: float) -> Declared:
    usual = InputMap()
    return Declared(
        actions=values_text(usual.actions),
        axes=values_text(usual.axes),
        vectors=values_text(usual.vectors),
        stick_dead_zone=usual.stick_dead_zone,
        trigger_dead_zone=usual.trigger_dead_zone,
        curve=usual.curve,
        pointer_speed=usual.pointer_speed,
        wheel_speed=usual.wheel_speed,
        tick_rate=tick_rate,
    )


@lru_cache(maxsize=64)
def meaning_of(declared: Declared, bindings: tuple[tuple[str, str], ...] = ()) -> Meaning:
    """A scene's map with what a player has bound in it; what he has bound to what means nothing for a name is left out."""
    bound = dict(bindings)
    sorts: tuple[tuple[Sort, str], ...] = (
        ("action", declared.actions),
        ("axis", declared.axes),
        ("vector", declared.vectors),
    )
    controls: dict[Sort, dict[str, tuple[Control, ...]]] = {}
    free = set()
    for sort, text in sorts:
        controls[sort] = {}
        for name, usual in values_from(text).items():
            own = controls_of(sort, usual)
            free |= {(sort, name)} if any(control.is_motion for control in own) else set()
            controls[sort][name] = _rebound(sort, bound.get(name), own)
    return Meaning(declared, controls, frozenset(free))


def _rebound(sort: Sort, text: str | None, usual: tuple[Control, ...]) -> tuple[Control, ...]:
    try:
        return usual if text is None else controls_of(sort, text)
    except InputError:  # bound in another scene, where the name is of another sort
        return usual


def action_of(doing: Doing, controls: Iterable[Control], *, was_down: bool) -> ActionState:
    """An action that was down when the last tick ended, or was not.

    One that another of its controls holds all the while is neither pressed nor released. A motion presses and releases it.
    """
    down = held = pressed = released = False
    for control in controls:
        name = control.names[0]
        if control.form == "button":
            down, held = down or doing.is_down(name), held or doing.is_kept_down(name)
            pressed, released = pressed or doing.was_pressed(name), released or doing.was_released(name)
        elif control.form == "axis":
            is_pushed = control.sign * doing.axis(name) >= (LET_GO if was_down else PUSHED)
            down, held = down or is_pushed, held or (is_pushed and was_down)
        elif control.sign * doing.moved(name) > 0.0:
            pressed = released = True
    if was_down:
        return ActionState(down, (not held) if down else pressed, not (down and held))
    return ActionState(down, down or pressed, released and pressed if down else pressed)


def axis_of(doing: Doing, controls: Iterable[Control], declared: Declared, *, is_free: bool) -> float:
    """What is held, added up and clipped to -1 to 1; and how fast things move, which goes beyond where it may."""
    place = motion = 0.0
    for control in controls:
        value = control.scale * control.sign * _number_of(doing, control, declared)
        if control.is_motion:
            motion += value
        else:
            place += value
    value = clipped(place) + motion
    return value if is_free else clipped(value)


def vector_of(doing: Doing, controls: Iterable[Control], declared: Declared, *, is_free: bool) -> Direction:
    """Likewise in two directions, clipped to a length of 1."""
    places, motions = [0.0, 0.0], [0.0, 0.0]
    for control in controls:
        x, y = _pair_of(doing, control, declared)
        told = motions if control.is_motion else places
        told[0] += control.scale * (-x if control.flip_x else x)
        told[1] += control.scale * (-y if control.flip_y else y)
    x, y = clipped_vector(*places)
    x, y = x + motions[0], y + motions[1]
    return Direction(x, y) if is_free else Direction(*clipped_vector(x, y))


def _number_of(doing: Doing, control: Control, declared: Declared) -> float:
    names = control.names
    match control.form:
        case "pair":
            return float(doing.is_down(names[1])) - float(doing.is_down(names[0]))
        case "axis":
            usual = declared.trigger_dead_zone if names[0].endswith("_trigger") else declared.stick_dead_zone
            return axial(doing.axis(names[0]), **_response(control, declared, usual))
        case "motion":
            return _speed(doing, names[0], declared)
    return float(doing.is_down(names[0]))


def _pair_of(doing: Doing, control: Control, declared: Declared) -> tuple[float, float]:
    names = control.names
    match control.form:
        case "cross":
            left, right, down, up = (float(doing.is_down(name)) for name in names)
            return right - left, up - down
        case "stick":
            x, y = doing.stick(*names)
            x, y = radial(x, y, **_response(control, declared, declared.stick_dead_zone))
            return x, -y  # devices count downwards
    x, y = (_speed(doing, name, declared) for name in names)
    return x, -y if names[1] == "pointer_y" else y


def _speed(doing: Doing, name: str, declared: Declared) -> float:
    """How fast pointer or wheel went in this tick, in its own unit: what comes of it does not depend on the tick rate."""
    unit = declared.pointer_speed if name.startswith("pointer") else declared.wheel_speed
    return doing.moved(name) * declared.tick_rate / unit


def _response(control: Control, declared: Declared, usual: float) -> dict[str, float]:
    return {
        "dead_zone": usual if control.dead_zone is None else control.dead_zone,
        "curve": declared.curve if control.curve is None else control.curve,
    }


def check_bindings(bindings: Bindings) -> None:
    """Raises RequestError for what could be bound in no scene."""
    if len(bindings) > MOST_BINDINGS:
        raise RequestError(f"a player may bind {MOST_BINDINGS} names, not {len(bindings)}")
    for name, text in bindings.items():
        try:
            check_name(name)
            sorts_taking(text)
        except InputError as error:
            raise RequestError(f"{name[:60]}: {error}") from error


class PlayerActions:
    """What players have bound, and what was down when the last tick ended: kept from tick to tick, and in states."""

    def __init__(self, declared: Callable[[], Declared] = lambda: _defaults(60.0)) -> None:
        self._declared = declared
        self._bindings: dict[int, tuple[tuple[str, str], ...]] = {}  # by player, by name in order
        self._down: dict[int, tuple[str, ...]] = {}  # actions by player, in the map's order

    def bindings(self, player: int) -> dict[str, str]:
        """What a player has bound."""
        return dict(self._bindings.get(player, ()))

    def bind(self, player: int, bindings: Bindings) -> None:
        """Binds this and nothing else. Names that the scene does not know wait for one that does.

        Raises:
            RequestError: what is bound to a name of this scene is no control of it.
        """
        check_bindings(bindings)
        for sort, known in meaning_of(self._declared()).controls.items():
            for name, text in bindings.items():
                try:
                    controls_of(sort, text if name in known else "")
                except InputError as error:
                    raise RequestError(f"{name}: {error}") from error
        self._bindings.pop(player, None)
        if bindings:
            self._bindings[player] = tuple(sorted(bindings.items()))

    def meaning(self, player: int) -> Meaning:
        """What a player's controls mean in the scene as it is now."""
        return meaning_of(self._declared(), self._bindings.get(player, ()))

    def was_down(self, player: int, action: str) -> bool:
        """Whether an action was down when the last tick ended."""
        return action in self._down.get(player, ())

    @property
    def players(self) -> tuple[int, ...]:
        """Those who had an action down when the last tick ended."""
        return tuple(sorted(self._down))

    def end_tick(self, players: Mapping[int, Doing]) -> None:
        """Keeps what of this tick counts in the next."""
        self._down = {
            player: down
            for player, doing in players.items()
            if (
                down := tuple(
                    name
                    for name, controls in self.meaning(player).controls["action"].items()
                    if action_of(doing, controls, was_down=self.was_down(player, name)).is_down
                )
            )
        }

    # --- as parts of states, see capture.py

    def saved(self) -> dict[str, Any]:
        """For a state."""
        return {"bindings": self._bindings, "down": self._down}

    def load(self, saved: Mapping[str, Any]) -> None:
        """From a state; one of before there were actions has none. StateError if it is no such."""
        try:
            self._bindings = msgspec.convert(saved["bindings"] or {}, dict[int, tuple[tuple[str, str], ...]])
            self._down = msgspec.convert(saved["down"] or {}, dict[int, tuple[str, ...]])
        except msgspec.ValidationError as error:
            raise StateError(f"this state's inputs/actions cannot be used: {error}") from error
