"""What a world tells about itself."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray[Any, Any]


class BodyStates(NamedTuple):
    """All bodies in the order of their entities' indices: views, valid until the next change of the world."""

    entity: Array  # (N,) uint32
    motion: Array  # (N,) uint8: 0 dynamic, 1 kinematic, 2 static
    position: Array  # (N, 3) float64, of the entity [m]
    rotation: Array  # (N, 4) float32, x y z w
    linear_velocity: Array  # (N, 3) float32, of the centre of mass [m/s]
    angular_velocity: Array  # (N, 3) float32 [rad/s]


class ContactPoints(NamedTuple):
    """Where bodies touch, after a step: M points."""

    entity_a: Array  # (M,) uint32
    entity_b: Array
    point: Array  # (M, 3) in the middle between the surfaces, in world space [m]
    normal: Array  # (M, 3) from a to b
    depth: Array  # (M,) overlap, negative for a gap [m]
    normal_impulse: Array  # (M,) of the whole step [N s]


class Meetings(NamedTuple):
    """Two colliders each that met or parted: M rows, in the order of the colliders' bodies and then of the colliders."""

    entity_a: Array  # (M,) uint32: the entities that carry the colliders
    entity_b: Array
    body_a: Array  # (M,) uint32: the entities whose bodies they are on
    body_b: Array


class Touches(NamedTuple):
    """The same with where and how hard."""

    entity_a: Array  # (M,) uint32: the entities that carry the colliders
    entity_b: Array
    body_a: Array  # (M,) uint32: the entities whose bodies they are on
    body_b: Array
    point: Array  # (M, 3) the deepest, in the middle between the surfaces [m]
    normal: Array  # (M, 3) from a to b
    depth: Array  # (M,) overlap there after the step, negative for a gap [m]
    normal_impulse: Array  # (M,) of the whole step and all points [N s]
    speed: Array  # (M,) at which the surfaces closed as they first touched; 0 for a contact that goes on [m/s]


class Visits(NamedTuple):
    """Triggers and what they notice: M rows."""

    trigger: Array  # (M,) uint32: the entity that carries the trigger
    entity: Array  # (M,) uint32: the one that carries what is in it
    trigger_body: Array  # (M,) uint32: the entities whose bodies they are on
    body: Array


class ContactEvents(NamedTuple):
    """Contacts, as the last step left them. One that sleeps goes on."""

    begun: Touches
    persisting: Touches
    ended: Meetings


class TriggerEvents(NamedTuple):
    """Visits to triggers, as the last step left them. One that sleeps in a trigger stays."""

    entered: Visits
    stayed: Visits
    exited: Visits


class WorldEvents(NamedTuple):
    """What the last step began, what goes on, and what ended."""

    contacts: ContactEvents
    triggers: TriggerEvents


class EventChanges(NamedTuple):
    """What the last step began and ended."""

    begun: Touches
    ended: Meetings
    entered: Visits
    exited: Visits


class Hits(NamedTuple):
    """What questions met: one row for each of R questions; with `all_hits` a row for every collider met, by question, nearest
    first, and of equally far ones in the order of their bodies."""

    query: Array  # (H,) int64, which of the questions
    entity: Array  # (H,) uint32: the entity that carries the collider, 0 for none
    distance: Array  # (H,) [m], infinity for none
    point: Array  # (H, 3) on the surface that was met [m], not a number for none
    normal: Array  # (H, 3) outward from that surface; 0 for none


class Overlaps(NamedTuple):
    """Which colliders R shapes overlap: H rows, by question and then in the order of the colliders' bodies."""

    query: Array  # (H,) int64, which of the questions
    entity: Array  # (H,) uint32: the entity that carries the collider


class Energy(NamedTuple):
    """Of all dynamic bodies [J]."""

    kinetic: float
    potential: float  # in the world's gravity, 0 at the origin


class Momentum(NamedTuple):
    """Of all dynamic bodies."""

    linear: Array  # (3,) [kg m/s]
    angular: Array  # (3,) about the origin [kg m^2/s]


class StepDiagnostics(NamedTuple):
    """What a step has left in the world. Entities and joints are 0 where there is nothing to name.

    Energy and momentum are of all dynamic bodies, asleep or awake; what concerns contacts and joints, of those that hold
    something awake.
    """

    kinetic: float  # [J]
    potential: float  # in the fields of gravity, 0 at the origin and far from what attracts [J]
    momentum: tuple[float, float, float]  # [kg m/s]
    angular_momentum: tuple[float, float, float]  # about the origin [kg m^2/s]
    deepest_overlap: float  # of two bodies that touch [m]
    deepest: tuple[int, int]  # the entities of these bodies
    residual: float  # fastest approach of surfaces that overlap, which the solver should not have left [m/s]
    restless: tuple[int, int]  # the entities of these bodies
    joint_error: float  # how far a joint's anchors are from where it holds them, at most [m]
    joint_angle_error: float  # how far a joint's frames are turned from where it holds them, at most [rad]
    joint: int  # the one with the largest error
    turned_joint: int  # the one with the largest error of angle
    awake: int  # dynamic bodies
    contacts: int  # pairs of shapes that touch, or may before long
    islands: int  # awake bodies that hold on to one another, and single ones; 0 if bodies came or went since the step


class Problem(NamedTuple):
    """Something that went wrong inside a step, while the world went on."""

    entity: int
    text: str  # who, why, and what to do
    cause: str = ""  # not_finite, too_fast, explosion or deep_overlap
