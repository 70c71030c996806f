"""Streams of state for viewers behind a network: asking for one, saying what matters, telling how it does."""

from __future__ import annotations

from typing import Annotated, Final

import msgspec

from elys.bus.messages.views import ViewCamera

MOST_CAMERAS: Final = 8  # that a sender takes into account
MOST_NAMED: Final = 1024  # entities, likewise
StreamName = Annotated[str, msgspec.Meta(pattern="^[A-Za-z0-9_.-]{1,200}$")]


class StreamRequest(msgspec.Struct, frozen=True, kw_only=True):
    """A viewer would like a stream of its own; it acknowledges under the name `stream` from now on."""

    node: str
    stream: StreamName


class StreamOffer(msgspec.Struct, frozen=True, kw_only=True):
    """The host has somebody who sends it; `starting` where he is not there yet: knock again."""

    starting: bool = False


class StreamInterest(msgspec.Struct, frozen=True, kw_only=True):
    """What matters to a viewer. Of more than a sender takes into account the first count."""

    cameras: tuple[ViewCamera, ...] = ()
    aspect: float = 16.0 / 9.0  # width of its pictures by their height
    chosen: tuple[int, ...] = ()  # entities that are selected
    open: tuple[int, ...] = ()  # those whose values or children are unfolded in a tree


class StreamReport(msgspec.Struct, frozen=True, kw_only=True):
    """How a stream does, told by its viewer, which alone knows what has come."""

    node: str
    stream: str
    tick: int = -1
    age: float = 0.0  # [s] of the newest state, half a round trip included
    age_p95: float = 0.0  # [s] over the last seconds
    round_trip: float = 0.0  # [s] of the fastest of the last frames
    rate: float = 0.0  # [B/s] that came
    allowed: float = 0.0  # [B/s] that the link is taken to carry
    frames: float = 0.0  # [1/s]
    loss: float = 0.0  # share of frames that never came, or after a later one
    position_error: float = 0.0  # [m] that no body is shown farther from where it was at the frame's tick
    rotation_error: float = 0.0  # [rad] likewise
    known: int = 0  # bodies that were told at least once
    bodies: int = 0
    waiting: int = 0  # bodies that are less exact than they should be
    step: float = 0.0  # [m] of the coarsest precision in use
    lanes: int = 0  # connections in use
    restarts: int = 0  # how often it had to begin anew
