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


class DebugLines(msgspec.Struct, frozen=True, kw_only=True):
    """Lines that show how physics sees the world, of the kind that the key names: raw little-endian rows.

    `positions` are (L, 2, 3) f32, both ends of each line in world space [m]; `colors` (L,) u8 say which lines belong together.
    """

    epoch: int
    tick: int
    positions: bytes
    colors: bytes
