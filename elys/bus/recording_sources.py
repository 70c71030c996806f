"""Where a recording comes from that was made of others: kept in its metadata, so that it can be told years later."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from elys.bus.recording import Recording
from elys.bus.transports.mcap import METADATA_NAME
from elys.bus.transports.mcap_reading import McapReader

SOURCES_NAME: Final = "elys.sources"
_KEY: Final = "sources"


class Source(msgspec.Struct, frozen=True, kw_only=True):
    """A recording that another was made of, as far as it was used."""

    file: str
    session: str
    started: float  # [s] since 1970
    start: float  # [s] of simulation
    end: float  # [s] of simulation
    first_tick: int
    last_tick: int
    sources: Sources | None = None


class Sources(msgspec.Struct, frozen=True, kw_only=True):
    """How a recording was made of others: "cut", "merge" or "recover"."""

    made_by: str
    of: tuple[Source, ...]
    text: str = ""


def sources_metadata(sources: Sources) -> dict[str, str]:
    """As metadata of a file: one JSON text."""
    return {"made_by": sources.made_by, _KEY: msgspec.json.encode(sources).decode()}


def read_sources(reader: McapReader) -> Sources | None:
    """What a file says of its origin; None if it was recorded as it is, or says nothing that can be read."""
    values = reader.metadata.get(SOURCES_NAME)
    if values is None:
        return None
    try:
        return msgspec.json.decode(values.get(_KEY, ""), type=Sources)
    except (msgspec.DecodeError, RecursionError):
        return None


def source_of(recording: Recording, first: int, last: int) -> Source:
    """A recording of which the frames from `first` to `last` are used."""
    made: dict[str, Any] = recording.reader.metadata.get(METADATA_NAME, {})
    return Source(
        file=recording.path.name,
        session=made.get("session", ""),
        started=seconds_of(made.get("started_ns", "")),
        start=float(recording.time[first]),
        end=float(recording.time[last]),
        first_tick=int(recording.tick[first]),
        last_tick=int(recording.tick[last]),
        sources=read_sources(recording.reader),
    )


def seconds_of(nanoseconds: str) -> float:
    """The seconds in a text of nanoseconds; 0 where it is none."""
    return int(nanoseconds) / 1e9 if nanoseconds.isdecimal() and len(nanoseconds) < 20 else 0.0
