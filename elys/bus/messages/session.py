"""Who is there, how the session runs, and what it has to say."""

from __future__ import annotations

from typing import Any, Literal

import msgspec

LogLevel = Literal["debug", "info", "warning", "error"]


class Hello(msgspec.Struct, frozen=True, kw_only=True):
    """A node introduces itself to the host, before anything else."""

    protocol: int
    kind: str  # what it is: simulation, replay, render, editor, recorder or tool
    node: str  # its id, unique in the session
    version: str  # of ELYS


class Welcome(msgspec.Struct, frozen=True, kw_only=True):
    """The host's answer; `refusal` is a sentence when the two cannot talk."""

    protocol: int
    version: str
    session: str
    epoch: int
    refusal: str = ""
    machine: str = ""  # names the machine of the host, as long as it runs; "" where its system does not tell


class ClockRequest(msgspec.Struct, frozen=True, kw_only=True):
    """What does the host's clock say?"""


class ClockReply(msgspec.Struct, frozen=True, kw_only=True):
    """What the clock of this run of the host said when the question came, the one that state frames are stamped by."""

    epoch: int
    wall_clock: int  # [ns] since 1970


class SessionStatus(msgspec.Struct, frozen=True, kw_only=True):
    """How the session runs: sent by the host at every change and four times a second."""

    epoch: int
    kind: Literal["simulation", "replay"]
    scene: str
    tick: int
    simulation_time: float  # [s]
    playing: bool
    tick_rate: float  # [Hz]
    rate: float = 1.0  # simulated seconds per second asked for; 0: as fast as it can
    realtime_factor: float = 1.0  # simulated seconds per second measured
    loop: bool = False
    start_time: float = 0.0  # [s] of a replay, or of the oldest that a simulation's flight recorder keeps
    end_time: float = 0.0  # [s] of a replay, or of the newest
    is_rewound: bool = False  # whether a simulation is before the newest: going on tells again what is kept
    entity_count: int = 0
    body_count: int = 0
    recording: str = ""  # the file of a replay, on the machine of who plays it
    changes: int = 0  # how many commands have changed the simulation, see CommandRecord.number


class LogLine(msgspec.Struct, frozen=True, kw_only=True):
    """One line for the console."""

    node: str
    level: LogLevel
    text: str
    time: float  # [s] since 1970
    tick: int = -1


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """Something that happened in the simulation."""

    kind: str
    entity: int = 0
    other: int = 0
    values: dict[str, Any] = {}


class EventBatch(msgspec.Struct, frozen=True, kw_only=True):
    """All events of one tick, in the order in which they happened."""

    epoch: int
    tick: int
    events: tuple[Event, ...]


class TickProfile(msgspec.Struct, frozen=True, kw_only=True):
    """What one tick cost, stage by stage [ms]."""

    tick: int
    total: float  # [ms]
    stages: dict[str, float]  # [ms]
    counts: dict[str, int] = {}
    late: float = 0.0  # [ms] by which the tick started after its time
