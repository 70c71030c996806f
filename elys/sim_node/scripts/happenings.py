"""What happens to scripts: who of them hears of which contact and visit to a trigger of the last step, and what they may tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import msgspec
import numpy as np

from elys.bus.messages.commands import Tell
from elys.bus.messages.session import Event
from elys.bus.messages.sounds import SOUND
from elys.common.errors import RequestError
from elys.sim_node.scripts.handles import EntityHandle, Touch
from elys.sim_node.scripts.vector import Vector

if TYPE_CHECKING:
    from elys.sim_node.scripts.runner import Scripts


NAME_LENGTH: Final = 200  # characters
EVENT_SIZE: Final = 64 << 10  # [bytes] that somebody may tell from outside
DEEPEST: Final = 8  # lists in one another likewise
# What nodes do something at: who could tell it could have them show what is not so.
OF_THE_HOST: Final = frozenset(
    ("playing", "paused", "forked", "scene_loaded", "kept", "script", "physics", "animation", "joint_broken", SOUND)
)


class Happening(NamedTuple):
    """A hook to be called."""

    entity: int
    hook: str
    arguments: tuple[Any, ...]


def visits_of(scripts: Scripts) -> Iterator[Happening]:
    """Who came into triggers, stays there, or left; told to the trigger's script and to the visitor's."""
    triggers = scripts.simulation.physics.events.triggers
    for hook, visits in (
        ("on_trigger_enter", triggers.entered),
        ("on_trigger_stay", triggers.stayed),
        ("on_trigger_exit", triggers.exited),
    ):
        entities = _listeners(scripts, hook)
        if not len(entities) or not len(visits.trigger):
            continue
        sides = (visits.trigger, visits.trigger_body), (visits.entity, visits.body)
        for mine, other in (sides, sides[::-1]):
            for row, entity in _rows_of(mine, entities):
                yield Happening(entity, hook, (EntityHandle(scripts, int(other[0][row])),))


def contacts_of(scripts: Scripts) -> Iterator[Happening]:
    """Which contacts began; told to both sides' scripts."""
    begun = scripts.simulation.physics.events.contacts.begun
    entities = _listeners(scripts, "on_contact")
    if not len(entities) or not len(begun.entity_a):
        return
    sides = (begun.entity_a, begun.body_a, -1.0), (begun.entity_b, begun.body_b, 1.0)
    for mine, other in (sides, sides[::-1]):
        for row, entity in _rows_of(mine[:2], entities):
            touch = Touch(
                Vector(begun.point[row].tolist()),
                Vector(begun.normal[row].tolist()) * mine[2],
                float(begun.normal_impulse[row]),
                float(begun.speed[row]),
            )
            yield Happening(entity, "on_contact", (EntityHandle(scripts, int(other[0][row])), touch))


def _listeners(scripts: Scripts, hook: str) -> np.ndarray[Any, Any]:
    return np.array([one.entity for one in scripts.listening(hook)], np.uint32)


def _rows_of(sides: tuple[Any, ...], entities: np.ndarray[Any, Any]) -> Iterator[tuple[int, int]]:
    """Rows with the entity that listens there: the collider's own, and its body's where that is another."""
    collider, body = sides
    for row in np.flatnonzero(np.isin(collider, entities) | np.isin(body, entities)).tolist():
        told = dict.fromkeys((int(collider[row]), int(body[row])))
        yield from ((row, entity) for entity in told if entity in entities)


def checked_event(kind: str, entity: int, values: dict[str, Any]) -> Event:
    """An event as scripts tell it; TypeError, or what the encoder raises, for what could not go over the bus."""
    told = Event(kind=kind, entity=entity, values=values)
    for name, value in values.items():
        if not _is_plain(value):
            raise TypeError(
                f"{name} of the event {kind!r} must be a number, a text or a tuple of such, not a {type(value).__name__}"
            )
    msgspec.json.encode(told)
    return told


def event_of(command: Tell, *, is_alive: Callable[[int], bool]) -> Event:
    """An event that somebody tells from outside; RequestError saying what of it cannot be."""
    if not 0 < len(command.kind) <= NAME_LENGTH:
        raise RequestError(f"an event is called by 1 to {NAME_LENGTH} characters")
    if command.kind in OF_THE_HOST:
        raise RequestError(f"{command.kind!r} is told by the host alone: call the event otherwise")
    if command.entity and not is_alive(command.entity):
        raise RequestError(f"there is no entity {command.entity} to be told anything")
    values = {name: _without_lists(value) for name, value in command.values.items()}
    if not all(map(_is_finite, values.values())):
        raise RequestError(f"the values of {command.kind!r} must be finite, and whole numbers below 2^63")
    try:
        told = checked_event(command.kind, command.entity, values)
    except (TypeError, ValueError) as error:
        raise RequestError(str(error)) from error
    if len(msgspec.json.encode(told)) > EVENT_SIZE:
        raise RequestError(f"an event may take {EVENT_SIZE >> 10} KB")
    return told


def _without_lists(value: Any, depth: int = 0) -> Any:
    if not isinstance(value, list | tuple):
        return value
    if depth >= DEEPEST:
        raise RequestError(f"the lists of an event may lie {DEEPEST} deep in one another")
    return tuple(_without_lists(item, depth + 1) for item in value)


def _is_finite(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, int | float) or (
        math.isfinite(value) if isinstance(value, float) else abs(value) < 2**63
    )


def _is_plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)
