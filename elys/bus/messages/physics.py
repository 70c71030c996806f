"""What happens between bodies, in columns: a busy tick has thousands of contacts, and one message."""

from __future__ import annotations

import msgspec

from elys.common.components import Vec3


class Meetings(msgspec.Struct, frozen=True, kw_only=True):
    """Two colliders in each row: the entities that carry them, and those whose bodies they are on."""

    entity_a: tuple[int, ...] = ()
    entity_b: tuple[int, ...] = ()
    body_a: tuple[int, ...] = ()
    body_b: tuple[int, ...] = ()


class Touches(Meetings, frozen=True, kw_only=True):
    """The same with the deepest point, as contacts began."""

    point: tuple[Vec3, ...] = ()  # [m] world
    normal: tuple[Vec3, ...] = ()  # from a to b
    depth: tuple[float, ...] = ()  # [m] overlap after the tick, negative for a gap
    normal_impulse: tuple[float, ...] = ()  # [N s] of the whole tick
    speed: tuple[float, ...] = ()  # [m/s] at which the surfaces closed


class Visits(msgspec.Struct, frozen=True, kw_only=True):
    """A trigger and what is in it in each row: the entities that carry the colliders, and those whose bodies they are on."""

    trigger: tuple[int, ...] = ()
    entity: tuple[int, ...] = ()
    trigger_body: tuple[int, ...] = ()
    body: tuple[int, ...] = ()


class ContactBatch(msgspec.Struct, frozen=True, kw_only=True):
    """What one tick began and ended. What is not said to end goes on, asleep or awake."""

    epoch: int
    tick: int
    begun: Touches = Touches()
    ended: Meetings = Meetings()
    entered: Visits = Visits()
    exited: Visits = Visits()


class TouchingRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks the host what touches: batches tell only what begins and ends."""


class Touching(msgspec.Struct, frozen=True, kw_only=True):
    """All contacts that go on after a tick, asleep or awake."""

    epoch: int
    tick: int
    contacts: Meetings


class Diagnostics(msgspec.Struct, frozen=True, kw_only=True):
    """What a tick has left in the physics. Entities are 0 where there is nothing to name; a joint is named by who carries it.

    Energy and momentum are of all dynamic bodies; overlap and residual the worst of the last ticks in which every contact of
    what is awake was looked at, at most 128.
    """

    tick: int
    kinetic: float  # [J]
    potential: float  # in the fields of gravity, 0 at the origin and far from what attracts [J]
    momentum: Vec3  # [kg m/s]
    angular_momentum: Vec3  # about the origin [kg m^2/s]
    deepest_overlap: float  # [m]
    deepest: tuple[int, int]  # the bodies that overlap so
    residual: float  # fastest approach of surfaces that overlap, which the solver should not have left [m/s]
    restless: tuple[int, int]  # the bodies that approach so
    joint_error: float  # how far a joint's anchors are from where it holds them [m]
    joint_angle_error: float  # how far a joint's frames are turned from where it holds them [rad]
    joint: int  # the one with the largest error
    turned_joint: int  # the one with the largest error of angle
    bodies: int
    awake: int  # dynamic bodies
    contacts: int
    islands: int


class DebugLines(msgspec.Struct, frozen=True, kw_only=True):
    """Lines that show how physics sees the world, of the kind that the key names: raw little-endian rows.

    `positions` are (L, 2, 3) f32, both ends of each line in world space [m]; `colors` (L,) u8 say which lines belong together;
    `values` (L,) f32 what each line measures, where its kind measures anything, else empty; `entities` (L, 2) u32 whose it is, 0
    for nobody, or empty where that is not said.
    """

    epoch: int
    tick: int
    positions: bytes
    colors: bytes
    values: bytes = b""
    entities: bytes = b""
