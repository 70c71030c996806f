"""How nodes do on the network: what each sent and heard, and what a host carries."""

from __future__ import annotations

import msgspec


class VitalsRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks a node how it does."""


class Stream(msgspec.Struct, frozen=True, kw_only=True):
    """One topic at one node, since it began to send it or to listen."""

    messages: int
    size: int  # [bytes] of all of them
    missed: int = 0  # that were sent and did not come, where that can be told
    skipped: int = 0  # that came faster than the node took them
    age_p50: float = -1.0  # [ms] from sent to here by the clocks of both, of the last ones; below 0: nothing tells
    age_p99: float = -1.0


class HostFacts(msgspec.Struct, frozen=True, kw_only=True):
    """What a host carries."""

    scene: str
    started: float  # [s] since 1970
    tick_rate: float = 0.0  # [Hz]
    realtime_factor: float = 1.0  # simulated seconds per second
    load: float = -1.0  # share of a tick's time that a tick takes; below 0: there are no ticks


class Neighbour(msgspec.Struct, frozen=True, kw_only=True):
    """Who is at the other end of a connection."""

    identity: str  # see Vitals.identity
    kind: str  # client or router
    address: str


class Vitals(msgspec.Struct, frozen=True, kw_only=True):
    """How a node does."""

    node: str
    kind: str
    version: str  # of ELYS
    machine: str  # its name for itself
    process: int
    clock: int  # [ns] since 1970, by the node's clock as it answers
    measured_at: float  # [s] by a clock of the node that is never set
    identity: str  # what its neighbours call it
    neighbours: tuple[Neighbour, ...] = ()
    sent: dict[str, Stream] = {}
    heard: dict[str, Stream] = {}
    host: HostFacts | None = None
