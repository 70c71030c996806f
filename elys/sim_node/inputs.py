"""What players do with keys, buttons, pointer, wheel and sticks, as systems see it in a tick.

    def steer(world: World) -> None:
        player = simulation.inputs[1]
        if player.action("jump").was_pressed:
            ...
        turn, ahead = player.vector("move")
        if player.is_down("w"):  # the key itself, whatever it is bound to
            ...

`Input` commands are applied at a tick's start, so they are part of recordings and of the flight recorder, and the same ticks come
out the same again. A player may use several devices in several nodes: what any of them holds is held.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Final, NamedTuple

import msgspec

from elys.bus.messages.commands import Input
from elys.common.errors import RequestError
from elys.common.input_names import AXES, BUTTONS, MOTIONS
from elys.sim_node.input_actions import (
    ActionState,
    Declared,
    Direction,
    Meaning,
    PlayerActions,
    action_of,
    axis_of,
    check_bindings,
    vector_of,
)

MOST_PLAYERS: Final = 16
MOST_DEVICES: Final = 64
MOST_CHANGES: Final = 256  # of keys and buttons in one message
MOST_TEXT: Final = 1024  # characters typed in a tick
FARTHEST: Final = 1e6  # points or notches in a tick
SOURCE_LENGTH: Final = 200  # characters


class Device(msgspec.Struct, frozen=True, kw_only=True):
    """What one node does for one player."""

    player: int
    source: str
    held: tuple[str, ...] = ()  # in the order in which they went down
    pressed: tuple[str, ...] = ()  # in this tick, once each
    released: tuple[str, ...] = ()
    moved: tuple[tuple[str, float], ...] = ()  # in this tick, by name
    axes: tuple[tuple[str, float], ...] = ()  # that are not where they rest at 0
    text: str = ""  # typed in this tick


class _Keys(NamedTuple):
    """Names of keys and buttons of all devices of a player."""

    held: set[str]
    pressed: set[str]
    released: set[str]
    kept: set[str]  # by one device since before this tick


class PlayerInput:
    """What a player does in this tick."""

    def __init__(self, player: int, devices: tuple[Device, ...], actions: PlayerActions) -> None:
        self._player = player
        self._devices = devices
        self._actions = actions

    # --- what it means in the scene

    def action(self, name: str) -> ActionState:
        """What an action of the scene's InputMap does. ValueError for no such name, with those there are."""
        was_down = self._actions.was_down(self._player, name)
        return action_of(self, self._meaning.of("action", name), was_down=was_down)

    def axis(self, name: str) -> float:
        """An axis of the InputMap, -1 to 1; beyond that by a motion that the scene itself gave it.

        Or by a device's name where it stands: a stick from -1 to 1, a trigger from 0 to 1, of several devices the one that is
        pushed farthest, the first of equals. ValueError for neither, with those there are.
        """
        if name in AXES:
            places = [place for device in self._devices for axis, place in device.axes if axis == name]
            return max(places, key=abs, default=0.0)
        meaning = self._meaning
        is_free = ("axis", name) in meaning.free
        return axis_of(self, meaning.of("axis", name), meaning.declared, is_free=is_free)

    def vector(self, name: str) -> Direction:
        """A vector of the InputMap, x to the right and y up or forward, at most 1 long; beyond that by a motion likewise."""
        meaning = self._meaning
        is_free = ("vector", name) in meaning.free
        return vector_of(self, meaning.of("vector", name), meaning.declared, is_free=is_free)

    @cached_property
    def _meaning(self) -> Meaning:
        return self._actions.meaning(self._player)

    # --- what devices do

    def is_down(self, name: str) -> bool:
        """Whether a key or button is held; one that went down and up again within a tick is not. ValueError for no such name."""
        _require(name, BUTTONS, "key or button")
        return name in self._keys.held

    def was_pressed(self, name: str) -> bool:
        """Whether it went down in this tick, however shortly."""
        _require(name, BUTTONS, "key or button")
        return name in self._keys.pressed

    def was_released(self, name: str) -> bool:
        """Whether it went up in this tick."""
        _require(name, BUTTONS, "key or button")
        return name in self._keys.released

    def is_kept_down(self, name: str) -> bool:
        """Whether one device has held it since before this tick."""
        _require(name, BUTTONS, "key or button")
        return name in self._keys.kept

    def moved(self, name: str) -> float:
        """How far pointer or wheel went in this tick, see `input_names.MOTIONS`."""
        _require(name, MOTIONS, "motion")
        return sum((distance for device in self._devices for axis, distance in device.moved if axis == name), 0.0)

    def stick(self, x: str, y: str) -> tuple[float, float]:
        """Where two axes of one device stand: of several the one that is pushed farthest, the first of equals."""
        places = [(axes.get(x, 0.0), axes.get(y, 0.0)) for axes in map(dict, (device.axes for device in self._devices))]
        return max(places, key=lambda place: place[0] * place[0] + place[1] * place[1], default=(0.0, 0.0))

    @cached_property
    def _keys(self) -> _Keys:
        held, pressed, released, kept = set[str](), set[str](), set[str](), set[str]()
        for device in self._devices:
            held.update(device.held)
            pressed.update(device.pressed)
            released.update(device.released)
            kept.update(name for name in device.held if name not in device.pressed)
        return _Keys(held, pressed, released, kept)

    @property
    def held(self) -> tuple[str, ...]:
        """All that is down, once each."""
        return tuple(dict.fromkeys(name for device in self._devices for name in device.held))

    @property
    def text(self) -> str:
        """What was typed in this tick."""
        return "".join(device.text for device in self._devices)


class Inputs:
    """All players. Who has no devices holds nothing. `declared` tells what the scene lets them do."""

    def __init__(self, declared: Callable[[], Declared] | None = None) -> None:
        self._devices: tuple[Device, ...] = ()  # in the order in which they were used first
        self.actions = PlayerActions(declared) if declared is not None else PlayerActions()

    def __getitem__(self, player: int) -> PlayerInput:
        """What a player does in this tick, from 1 on."""
        _require_player(player)
        return PlayerInput(player, tuple(d for d in self._devices if d.player == player), self.actions)

    @property
    def players(self) -> tuple[int, ...]:
        """Those who do or hold anything, in order."""
        return tuple(sorted({device.player for device in self._devices}))

    def holds(self, source: str) -> bool:
        """Whether a node holds anything."""
        return bool(self.players_of(source))

    def players_of(self, source: str) -> tuple[int, ...]:
        """As whom a node holds anything; what it let go of while time stands is still told in the next tick."""
        return tuple(
            device.player for device in self._devices if device.source == source and (device.held or device.axes)
        )

    def take(self, command: Input) -> None:
        """Applies what a player did, after what was applied in this tick already.

        Raises:
            RequestError: a name or a number is none, or there is too much of it. Nothing has changed then.
        """
        check_input(command)
        key = (command.player, command.source)
        before = next((device for device in self._devices if (device.player, device.source) == key), None)
        if before is None and len(self._devices) >= MOST_DEVICES:
            raise RequestError(f"{MOST_DEVICES} devices play already: let one leave first")
        if command.bindings is not None:
            self.actions.bind(command.player, command.bindings)
        after = _applied(before or Device(player=command.player, source=command.source), command)
        if before is None:
            self._devices = (*self._devices, after)
        else:
            self._devices = tuple(after if device is before else device for device in self._devices)

    def end_tick(self) -> None:
        """What happened in the tick is over; what is held stays."""
        if self._devices or self.actions.players:
            players = sorted({*self.players, *self.actions.players})
            self.actions.end_tick({player: self[player] for player in players})
        if self._devices:
            ended = (Device(player=d.player, source=d.source, held=d.held, axes=d.axes) for d in self._devices)
            self._devices = tuple(device for device in ended if device.held or device.axes)


def _applied(device: Device, command: Input) -> Device:
    held, released = dict.fromkeys(device.held), dict.fromkeys(device.released)
    pressed, axes = dict.fromkeys(device.pressed), dict(device.axes)
    if command.lets_go:
        released |= held
        held, axes = {}, {}
    for name, is_down in command.changes:
        if is_down and name not in held:
            held[name] = pressed[name] = None
        elif not is_down and name in held:
            del held[name]
            released[name] = None
    moved = dict(device.moved)
    for name, distance in command.moved.items():
        moved[name] = min(max(moved.get(name, 0.0) + distance, -FARTHEST), FARTHEST)
    axes |= command.axes
    return Device(
        player=device.player,
        source=device.source,
        held=tuple(held),
        pressed=tuple(pressed),
        released=tuple(released),
        moved=tuple(sorted(moved.items())),
        axes=tuple(sorted((name, place) for name, place in axes.items() if place)),
        text=(device.text + command.text)[:MOST_TEXT],
    )


def check_input(command: Input) -> None:
    """Raises RequestError for what cannot be applied, whoever sent it."""
    _require_player(command.player)
    if len(command.source) > SOURCE_LENGTH:
        raise RequestError(f"who plays may be called by {SOURCE_LENGTH} characters, not {len(command.source)}")
    if len(command.changes) > MOST_CHANGES:
        raise RequestError(f"one message may tell of {MOST_CHANGES} keys, not {len(command.changes)}: send several")
    for name, _ in command.changes:
        if name not in BUTTONS:
            raise RequestError(
                f"there is no key or button {name[:40]!r}: they are called as in elys.common.input_names"
            )
    for values, known, what, limit in (
        (command.moved, MOTIONS, "motion", FARTHEST),
        (command.axes, AXES, "axis", 1.0),
    ):
        for name, value in values.items():
            if name not in known:
                raise RequestError(f"there is no {what} {name[:40]!r}: there are {', '.join(sorted(known))}")
            if not (math.isfinite(value) and abs(value) <= limit):
                raise RequestError(f"{name} must lie between -{limit:g} and {limit:g}, not be {value:g}")
    if len(command.text) > MOST_TEXT:
        raise RequestError(f"{MOST_TEXT} characters can be typed in a tick, not {len(command.text)}")
    if command.bindings is not None:
        check_bindings(command.bindings)


def _require_player(player: int) -> None:
    if not 1 <= player <= MOST_PLAYERS:
        raise RequestError(f"players are numbered from 1 to {MOST_PLAYERS}, not {player}")


def _require(name: str, known: frozenset[str], what: str) -> None:
    if name not in known:
        raise ValueError(f"there is no {what} {name!r}: they are called as in elys.common.input_names")
