"""One step, as a table of contents."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from elys.sim_node.physics.activity import Activity
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.events import EventLog
from elys.sim_node.physics.joints import JointTable
from elys.sim_node.physics.kernels.colouring import colour_contacts
from elys.sim_node.physics.kernels.groups import form_groups
from elys.sim_node.physics.kernels.integrator import finish_step
from elys.sim_node.physics.kernels.islands import build_islands
from elys.sim_node.physics.kernels.joint_preparation import prepare_joints
from elys.sim_node.physics.kernels.joints import finish_joints
from elys.sim_node.physics.kernels.narrow_phase import update_manifolds, update_simple_manifolds
from elys.sim_node.physics.kernels.overlaps import find_deep_overlaps
from elys.sim_node.physics.kernels.placement import fatten_boxes, place_colliders
from elys.sim_node.physics.kernels.preparation import prepare_bodies, prepare_impacts
from elys.sim_node.physics.kernels.solver import (
    solve_contacts,
    solve_jointed_contacts,
    solve_shared_contacts,
    solve_shared_jointed_contacts,
)
from elys.sim_node.physics.kernels.sweep import stop_at_impacts
from elys.sim_node.physics.kernels.tables import Table
from elys.sim_node.physics.plan import Switches
from elys.sim_node.physics.solving import SolverRoom
from elys.sim_node.physics.team import Team

Array = np.ndarray[Any, Any]
Result = TypeVar("Result")

_NONE: Array = np.zeros(0, np.int32)


class Step:
    """One step of a world: its stages in order, each timed into the profile [s]."""

    def __init__(
        self,
        bodies: BodyTable,
        colliders: ColliderTable,
        contacts: ContactStore,
        joints: JointTable,
        activity: Activity,
        events: EventLog | None,
        switches: Switches,
        room: SolverRoom,
        team: Team,
        constants: Table,
        strengths: Table,
        *,
        sleeping: bool,
    ) -> None:
        self._bodies = bodies
        self._colliders = colliders
        self._contacts = contacts
        self._joints = joints
        self._activity = activity
        self._events = events
        self._switches = switches
        self._sleeping = sleeping
        self._room = room
        self._team = team
        self.constants = constants
        self._strengths = strengths
        self._links: Array | None = None  # of joints, as islands were last made of them
        self._stepped: Array | None = None  # the rows of bodies that were stepped last
        self.deep: tuple[Array, Array] = (_NONE, np.zeros(0))  # slots of pairs, depths [m]

    def run(self, profile: dict[str, float]) -> tuple[Array, Array]:
        """Moves everything; returns the rows of bodies whose numbers are not finite any more, and of joints that broke."""
        switches = self._switches
        broken = _NONE
        self._stepped = self._bodies.rows
        while True:
            _timed(profile, "place_bodies", self._place_bodies)
            _timed(profile, "update_pairs", self._update_pairs)
            if not _timed(profile, "update_manifolds", self._update_manifolds):
                break
            self._activity.wake_marked()
        if switches.overlap_check:
            _timed(profile, "find_deep_overlaps", self._find_deep_overlaps)
        self._make_room()
        if switches.islands:
            _timed(profile, "build_islands", self._build_islands)
            _timed(profile, "colour_contacts", self._colour_contacts)
        is_solved, is_jointed = switches.solver, switches.joints
        if is_solved:
            _timed(profile, "prepare_bodies", self._prepare_bodies)
        if is_jointed:
            _timed(profile, "prepare_joints", self._prepare_joints)
        if is_solved:
            _timed(profile, "solve_contacts", self._solve_contacts)
        if is_jointed:
            broken = _timed(profile, "finish_joints", self._finish_joints)
        if self._events is not None:
            _timed(profile, "track_contacts", self._track_contacts)
        faulty = _timed(profile, "finish_step", self._finish_step)
        if switches.continuous_collision and not len(faulty):
            _timed(profile, "stop_at_impacts", self._stop_at_impacts)
        if self._events is not None and not len(faulty) and (switches.triggers or self._events.has_removed_visits):
            _timed(profile, "track_triggers", self._track_triggers)
        if self._sleeping:
            _timed(profile, "put_to_sleep", self._put_to_sleep)
        return faulty, broken

    def _place_bodies(self) -> None:
        activity = self._activity
        activity.update()
        geometry = self._colliders.geometry.arrays
        place_colliders(self._bodies.rows, self._colliders.rows, activity.colliders, activity.collider_count, geometry)

    def _update_pairs(self) -> None:
        activity, contacts = self._activity, self._contacts
        bodies, colliders = self._bodies.rows, self._colliders.rows
        if contacts.is_outdated:
            contacts.list_active(bodies, colliders)
        awake = (activity.colliders, activity.collider_count)
        count = fatten_boxes(bodies, colliders, self._colliders.proxies, *awake, activity.moved, self.constants)
        if count:
            contacts.list_sleeping(bodies, colliders, wanted=activity.has_fresh)
            geometry, unpaired = self._colliders.geometry.arrays, self._joints.unpaired
            contacts.update_pairs(colliders, self._colliders.proxies, geometry, unpaired, activity.moved, count)

    def _update_manifolds(self) -> bool:
        """Returns whether anything was touched in its sleep: then it wakes first."""
        contacts = self._contacts
        active = (contacts.active, contacts.active_count, contacts.room, contacts.margins)
        pairs = (self._colliders.proxies, contacts.pairs, *active, contacts.manifolds, contacts.found)
        results = (self.constants, contacts.touching, contacts.fast, contacts.watched, contacts.triggers)
        bodies, colliders = self._bodies.rows, self._colliders.rows
        if self._switches.polytopes:
            facts = update_manifolds(bodies, colliders, *pairs, self._colliders.geometry.arrays, *results)
        else:
            facts = update_simple_manifolds(bodies, colliders, *pairs, *results)
        contacts.touching_count, is_changed, self._switches.fast_count, is_woken, *others = facts
        contacts.watched_count, contacts.trigger_count = others
        contacts.is_changed |= is_changed
        return bool(is_woken)

    def _find_deep_overlaps(self) -> None:
        contacts = self._contacts
        slots, depths = np.zeros(contacts.touching_count, np.int32), np.zeros(contacts.touching_count)
        count = find_deep_overlaps(
            self._bodies.rows,
            self._colliders.rows,
            contacts.pairs,
            contacts.touching,
            contacts.touching_count,
            contacts.manifolds,
            slots,
            depths,
        )
        self.deep = slots[:count], depths[:count]
        self._bodies.has_fresh = False

    @property
    def islands(self) -> int:
        """Another number whenever islands are others than before; 0 if bodies came or went since the step."""
        return self._room.island_version if self._stepped is self._bodies.rows else 0

    def take_deep(self) -> tuple[Array, Array]:
        """Slots (M,) of pairs and depths (M,) [m] of what was found put deep into others, once."""
        deep, self.deep = self.deep, (_NONE, np.zeros(0))
        return deep

    def _make_room(self) -> None:
        contacts = self._contacts
        contacts.is_changed |= self._room.reserve(len(self._bodies.rows), contacts.touching_count)
        contacts.is_changed |= self._links is not self._joints.links
        self._links = self._joints.links

    def _build_islands(self) -> None:
        room, contacts, activity = self._room, self._contacts, self._activity
        contacts.is_changed |= build_islands(
            self._bodies.rows,
            activity.bodies,
            activity.body_count,
            self._colliders.rows,
            contacts.pairs,
            contacts.touching,
            contacts.touching_count,
            contacts.manifolds,
            self._joints.links,
            room.parent,
            room.islands,
            self._strengths,
            self.constants,
            contacts.is_changed,
        )

    def _colour_contacts(self) -> None:
        room, contacts = self._room, self._contacts
        if not contacts.is_changed:
            return
        contacts.is_changed = False
        room.island_version += 1
        group_count, self._switches.held_end = form_groups(
            self._bodies.rows,
            self._activity.bodies,
            self._activity.body_count,
            contacts.touching_count,
            room.parent,
            room.islands,
            len(self._strengths),
            room.all_groups,
            room.present,
            room.held,
            room.group_of,
        )
        room.use_groups(group_count)
        needed = self._deal_out()
        if needed > len(room.counts):
            room.make_batch_room(needed)
            self._deal_out()

    def _deal_out(self) -> int:
        room, contacts = self._room, self._contacts
        return colour_contacts(
            self._bodies.rows,
            self._colliders.rows,
            contacts.pairs,
            contacts.touching,
            contacts.touching_count,
            contacts.manifolds,
            room.group_of,
            room.masks,
            room.keys,
            room.order,
            room.starts,
            room.colour_counts,
            room.groups,
            room.spans,
            room.body_a,
            room.body_b,
            room.slots,
            room.counts,
        )

    def _prepare_bodies(self) -> None:
        room, contacts = self._room, self._contacts
        prepare_bodies(
            self._bodies.rows,
            self._bodies.forces,
            room.held,
            self._switches.held_end,
            room.groups,
            room.solver_bodies,
            room.drives,
            self._strengths,
            self.constants,
        )
        if not self._switches.bounces:
            return
        prepare_impacts(
            self._bodies.rows,
            self._colliders.rows,
            contacts.pairs,
            contacts.touching,
            contacts.touching_count,
            contacts.manifolds,
            room.rows,
            room.row_points,
            room.group_of,
            room.groups,
            room.solver_bodies,
            room.drives,
            self.constants,
        )

    def _prepare_joints(self) -> None:
        self._joints.prepare(self._bodies, len(self._strengths))
        prepare_joints(self._joints.tables, self._room.drives, self._strengths)

    def _finish_joints(self) -> Array:
        joints = self._joints
        count = finish_joints(joints.tables, self._room.solver_bodies, self.constants, joints.broken_room)
        return joints.broken_room[:count].copy() if count else _NONE

    def _solve_contacts(self) -> None:
        work, team, switches = self._room.work(self._contacts), self._team, self._switches
        given = (self._strengths, self.constants)
        held_end = switches.held_end
        if not switches.shared_solver(team.threads):
            if switches.joints:
                solve_jointed_contacts(work, held_end, self._joints.tables, *given)
            else:
                solve_contacts(work, held_end, *given)
        elif switches.joints:
            joints = self._joints.tables
            team.run(lambda *who: solve_shared_jointed_contacts(work, held_end, joints, *given, *who))
        else:
            team.run(lambda *who: solve_shared_contacts(work, held_end, *given, *who))

    def _track_contacts(self) -> None:
        assert self._events is not None
        bodies, colliders = self._bodies.rows, self._colliders.rows
        self._events.track_contacts(bodies, colliders, self._room.solver_bodies, self.constants)

    def _track_triggers(self) -> None:
        assert self._events is not None
        tables = (self._bodies.rows, self._colliders.rows, self._room, self._colliders.geometry.arrays)
        self._events.track_triggers(*tables, wanted=self._switches.triggers)

    def _finish_step(self) -> Array:
        bodies = self._bodies
        count = finish_step(
            bodies.rows,
            bodies.forces,
            self._activity.bodies,
            self._activity.body_count,
            bodies.poses,
            self._room.starts_of_bodies,
            self._room.solver_bodies,
            bodies.faulty_room,
            bodies.report,
            self._room.inertia,
            self.constants,
        )
        return bodies.faulty_room[:count].copy() if count else _NONE

    def _put_to_sleep(self) -> None:
        room = self._room
        self._activity.put_to_sleep(room.parent, room.islands, room.last_asleep, self.constants)

    def _stop_at_impacts(self) -> None:
        room = self._room
        stop_at_impacts(
            self._bodies.rows,
            self._colliders.rows,
            self._contacts.pairs,
            self._contacts.fast,
            self._switches.fast_count,
            room.starts_of_bodies,
            room.fractions,
            self._bodies.poses,
            room.places,
            room.shapes,
            self._colliders.geometry.arrays,
            self.constants,
        )


def _timed(profile: dict[str, float], name: str, stage: Callable[[], Result]) -> Result:
    began = time.perf_counter()
    result = stage()
    profile[name] = time.perf_counter() - began
    return result
