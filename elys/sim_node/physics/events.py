"""What each step began and ended: contacts, and visits to triggers, as tables that kernels fill."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics import checks
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.kernels.events import describe_contacts, track_contacts, track_triggers
from elys.sim_node.physics.kernels.tables import MEETING, TOUCH, Geometry, Table
from elys.sim_node.physics.solving import SolverRoom
from elys.sim_node.physics.states import (
    ContactEvents,
    EventChanges,
    Meetings,
    Touches,
    TriggerEvents,
    Visits,
    WorldEvents,
)

Array = np.ndarray[Any, Any]


class EventLog:
    """The events of the last step, and what was taken out of the world since, which the next step tells."""

    def __init__(self, contacts: ContactStore) -> None:
        self._contacts = contacts
        self._make_room(0)
        self.forget()

    def forget(self) -> None:
        """As if nothing had touched before: what does has begun with the next step."""
        self._contacts.pairs["touched"] = 0
        self._clear()

    def _clear(self) -> None:
        self._begun = np.zeros(0, TOUCH)
        self._ended = self._entered = self._exited = np.zeros(0, MEETING)
        self._removed_contacts = self._removed_visits = np.zeros(0, MEETING)

    # ---------------------------------------------------------------- within a step

    @property
    def has_removed_visits(self) -> bool:
        """Whether somebody was taken out of a trigger, or a trigger from around somebody, since the last step."""
        return len(self._removed_visits) > 0

    def track_contacts(self, bodies: Array, colliders: Array, solver_bodies: Array, constants: Table) -> None:
        """Finds the contacts that a solved step has begun and ended; bodies are not moved yet."""
        contacts = self._contacts
        if len(contacts.watched) > len(self._begun_room):
            self._make_room(len(contacts.watched))
        begun, ended = track_contacts(
            bodies,
            colliders,
            contacts.pairs,
            contacts.watched,
            contacts.watched_count,
            contacts.manifolds,
            solver_bodies,
            self._begun_room,
            self._ended_room,
            constants,
        )
        self._begun, self._ended = self._begun_room[:begun], self._ended_room[:ended]
        self._entered, self._exited = self._entered_room[:0], self._exited_room[:0]
        if len(self._removed_contacts):
            self._begun, self._ended = _with_removed(self._begun, self._ended, self._removed_contacts)
            self._removed_contacts = self._removed_contacts[:0]

    def track_triggers(
        self, bodies: Array, colliders: Array, room: SolverRoom, geometry: Geometry, *, wanted: bool
    ) -> None:
        """Finds what has entered and left triggers, after bodies were moved; where it is not wanted nothing has."""
        contacts = self._contacts
        entered = exited = 0
        if wanted:
            entered, exited = track_triggers(
                bodies,
                colliders,
                contacts.pairs,
                contacts.triggers,
                contacts.trigger_count,
                room.starts_of_bodies,
                room.fractions,
                room.places,
                room.shapes,
                geometry,
                self._entered_room,
                self._exited_room,
            )
        self._entered, self._exited = self._entered_room[:entered], self._exited_room[:exited]
        if len(self._removed_visits):
            self._entered, self._exited = _with_removed(self._entered, self._exited, self._removed_visits)
            self._removed_visits = self._removed_visits[:0]

    # ---------------------------------------------------------------- between steps

    def note_removed(self, bodies: Array, colliders: Array, rows: Array) -> None:
        """Collider rows are about to lose their pairs: what they touched, and whom they were in, ends with the next step."""
        pairs = self._contacts.pairs
        self.note_dropped(bodies, colliders, np.flatnonzero(np.isin(pairs["a"], rows) | np.isin(pairs["b"], rows)))

    def note_dropped(self, bodies: Array, colliders: Array, slots: Array) -> None:
        """The same for pairs in slots (M,) that are about to end."""
        touched = self._touched_slots()
        pairs = self._contacts.pairs[touched[np.isin(touched, slots)]]
        if not len(pairs):
            return
        is_visit, named = _named(bodies, colliders, pairs[_starts_of_runs(pairs)])
        self._removed_contacts = np.concatenate([self._removed_contacts, named[~is_visit]])
        self._removed_visits = np.concatenate([self._removed_visits, named[is_visit]])

    def changes(self) -> EventChanges:
        """What the last step began and ended."""
        return EventChanges(
            _touches(self._begun.copy()),
            _meetings(self._ended.copy()),
            _visits(self._entered.copy()),
            _visits(self._exited.copy()),
        )

    def events(self, bodies: Array, colliders: Array) -> WorldEvents:
        """What the last step began and ended, and what goes on."""
        slots = self._touched_slots()
        pairs = self._contacts.pairs[slots]
        is_visit = (colliders["trigger"][pairs["a"]] != 0) | (colliders["trigger"][pairs["b"]] != 0)
        going_on = slots[~is_visit].astype(np.int32)
        touches = np.zeros(len(going_on), TOUCH)
        manifolds = self._contacts.manifolds
        count = describe_contacts(bodies, colliders, self._contacts.pairs, going_on, len(going_on), manifolds, touches)
        visits = pairs[is_visit]
        visits = visits[_starts_of_runs(visits)]
        changes = self.changes()
        return WorldEvents(
            ContactEvents(changes.begun, _touches(_without(touches[:count], self._begun)), changes.ended),
            TriggerEvents(
                changes.entered,
                _visits(_without(_named(bodies, colliders, visits)[1], self._entered)),
                changes.exited,
            ),
        )

    def saved(self) -> dict[str, Array]:
        """What the next step has to tell of the time before it."""
        return {"removed_contacts": self._removed_contacts.copy(), "removed_visits": self._removed_visits.copy()}

    def load(self, saved: dict[str, Array]) -> None:
        """Takes back what `saved` gave."""
        self._clear()
        self._removed_contacts = checks.saved_table(saved, "removed_contacts", MEETING)
        self._removed_visits = checks.saved_table(saved, "removed_visits", MEETING)

    def _touched_slots(self) -> Array:
        """Slots of all pairs that touched when they were last looked at, awake or not, sorted by colliders."""
        pairs = self._contacts.pairs
        slots = np.flatnonzero((pairs["touched"] != 0) & (pairs["a"] >= 0))
        chosen = pairs[slots]
        return slots[np.lexsort((chosen["part"], chosen["b"], chosen["a"]))]

    def _make_room(self, count: int) -> None:
        self._begun_room = np.zeros(count, TOUCH)
        self._ended_room = np.zeros(count, MEETING)
        self._entered_room = np.zeros(count, MEETING)
        self._exited_room = np.zeros(count, MEETING)


def _named(bodies: Array, colliders: Array, pairs: Array) -> tuple[Array, Array]:
    """Which pairs (P,) have a trigger, and their entities, the trigger first."""
    of_a, of_b = colliders["trigger"][pairs["a"]] != 0, colliders["trigger"][pairs["b"]] != 0
    a, b = np.where(of_b, pairs["b"], pairs["a"]), np.where(of_b, pairs["a"], pairs["b"])
    named = np.zeros(len(pairs), MEETING)
    named["a"], named["b"] = colliders["entity"][a], colliders["entity"][b]
    named["body_a"] = bodies["entity"][colliders["body"][a]]
    named["body_b"] = bodies["entity"][colliders["body"][b]]
    return of_a | of_b, named


def _starts_of_runs(rows: Array) -> Array:
    """(N,) bool: where sorted rows come to another a or b."""
    starts = np.ones(len(rows), bool)
    starts[1:] = (rows["a"][1:] != rows["a"][:-1]) | (rows["b"][1:] != rows["b"][:-1])
    return starts


def _with_removed(begun: Array, ended: Array, removed: Array) -> tuple[Array, Array]:
    """Begins and ends of a step together with what ended by being taken out before it.

    What was taken out and touches again, as a body that was made anew from its components, has done neither.
    """
    still_begun = _without(begun, removed)
    ended = np.concatenate([ended, _without(removed, begun)])
    return still_begun, ended[np.lexsort([checks.index_column(ended[name]) for name in ("b", "body_b", "a", "body_a")])]


def _without(rows: Array, others: Array) -> Array:
    """The rows whose two colliders are not among the others, as often as they are."""
    if not (len(rows) and len(others)):
        return rows
    known = _numbered(others)
    mine = _numbered(rows)
    return rows[~np.isin(mine, known)]


_NUMBERED = np.dtype([("a", "u4"), ("b", "u4"), ("number", "u8")])


def _numbered(rows: Array) -> Array:
    """(N,) void: names of two colliders, with a number where several have the same two entities."""
    order = np.lexsort((rows["b"], rows["a"]))
    ranked = rows[order]
    is_first = _starts_of_runs(ranked)
    places = np.arange(len(rows))
    names = np.zeros(len(rows), _NUMBERED)
    names["a"], names["b"] = rows["a"], rows["b"]
    names["number"][order] = places - np.maximum.accumulate(np.where(is_first, places, 0))
    return names


def _touches(rows: Array) -> Touches:
    return Touches(
        *(rows[name] for name in ("a", "b", "body_a", "body_b", "point", "normal", "depth", "impulse", "speed"))
    )


def _meetings(rows: Array) -> Meetings:
    return Meetings(*(rows[name] for name in ("a", "b", "body_a", "body_b")))


def _visits(rows: Array) -> Visits:
    return Visits(*(rows[name] for name in ("a", "b", "body_a", "body_b")))
