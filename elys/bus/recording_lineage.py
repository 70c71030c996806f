"""Where a recording comes from that was made of others: kept in its metadata, so that it can be told years later."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from elys.bus.recording import Recording
from elys.bus.transports.mcap import METADATA_NAME
from elys.bus.transports.mcap_reading import McapReader

LINEAGE_NAME: Final = "elys/lineage"
FORK_NAME: Final = "elys.lineage"  # metadata of a session that went on from another's recording
_KEY: Final = "lineage"


class Ancestor(msgspec.Struct, frozen=True, kw_only=True):
    """A recording that another was made of, as far as it was used."""

    file: str
    session: str
    started: float  # [s] since 1970
    start: float  # [s] of simulation
    end: float  # [s] of simulation
    first_tick: int
    last_tick: int
    lineage: Lineage | None = None


class Lineage(msgspec.Struct, frozen=True, kw_only=True):
    """How a recording was made of others: "cut", "merge" or "recover"."""

    made_by: str
    of: tuple[Ancestor, ...]
    text: str = ""


def lineage_metadata(lineage: Lineage) -> dict[str, str]:
    """As metadata of a file: one JSON text."""
    return {"made_by": lineage.made_by, _KEY: msgspec.json.encode(lineage).decode()}


def read_lineage(reader: McapReader) -> Lineage | None:
    """What a file says of its origin; None if it was recorded as it is, or says nothing that can be read."""
    values = reader.metadata.get(LINEAGE_NAME)
    if values is None:
        return None
    try:
        return msgspec.json.decode(values.get(_KEY, ""), type=Lineage)
    except (msgspec.DecodeError, RecursionError):
        return None


def ancestor_of(recording: Recording, first: int, last: int) -> Ancestor:
    """A recording of which the frames from `first` to `last` are used."""
    made: dict[str, Any] = recording.reader.metadata.get(METADATA_NAME, {})
    return Ancestor(
        file=recording.path.name,
        session=made.get("session", ""),
        started=seconds_of(made.get("started_ns", "")),
        start=float(recording.time[first]),
        end=float(recording.time[last]),
        first_tick=int(recording.tick[first]),
        last_tick=int(recording.tick[last]),
        lineage=read_lineage(recording.reader),
    )


def seconds_of(nanoseconds: str) -> float:
    """The seconds in a text of nanoseconds; 0 where it is none."""
    return int(nanoseconds) / 1e9 if nanoseconds.isdecimal() and len(nanoseconds) < 20 else 0.0
