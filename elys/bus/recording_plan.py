"""How a session is to be recorded: how exactly, in how many files, how much at most, and which topics."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import msgspec

from elys.bus import topics
from elys.common.errors import RecordingError

ALWAYS: Final = (
    topics.STATE.name,
    topics.SNAPSHOT.name,
    topics.DELTA.name,
)  # channels without which nothing can be shown
_BYTES: Final = {"kb": 10**3, "mb": 10**6, "gb": 10**9, "tb": 10**12}
_SECONDS: Final = {"s": 1.0, "min": 60.0, "h": 3600.0}
_QUANTITY: Final = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([a-z]+)\s*\Z", re.IGNORECASE)
_LEAST_RATE: Final = 10_000  # [bytes/s]: below it little else than what is never left out would fit
_LEAST_SIZE: Final = 1_000_000  # [bytes] of a file: its schemas alone are a tenth of that


class RecordingPlan(msgspec.Struct, frozen=True, kw_only=True):
    """What whoever records is told. Zeros and nothing mean: without end."""

    compact: bool = False  # states in small steps, see `elys.bus.state_packing.compact`
    rotate_bytes: int = 0  # after which the next file begins
    rotate_seconds: float = 0.0  # [s] of wall clock
    keep_files: int = 0  # the newest so many, and no others
    limit_bytes: int = 0  # in all files that are kept
    limit_rate: int = 0  # [bytes/s] of wall clock, see `elys.bus.rate_budget`
    topics: tuple[str, ...] = ()  # beside state and scene; none: all
    overwrites: bool = False  # what has the name already; files with numbers go on after those that are there

    @property
    def rotates(self) -> bool:
        """Whether there are files with numbers instead of one."""
        return bool(self.rotate_bytes or self.rotate_seconds)

    def takes(self, channel: str) -> bool:
        """Whether messages of a channel are recorded."""
        return not self.topics or channel in ALWAYS or channel in self.topics


PLAIN: Final = RecordingPlan()


def recording_plan(
    *,
    compact: bool = False,
    rotate: str = "",
    keep_files: int = 0,
    limit: str = "",
    limit_rate: str = "",
    topic_names: str = "",
    overwrites: bool = False,
) -> RecordingPlan:
    """A plan out of what a person writes: "512MB" or "10min", "2GB", "events,commands".

    Raises:
        RecordingError: it is no size or time, too small, or names no topic.
    """
    rotate_bytes, rotate_seconds = _size_or_time(rotate) if rotate else (0, 0.0)
    if keep_files and not rotate:
        raise RecordingError("files are deleted only where there are several: say --rotate SIZE or TIME as well")
    limit_bytes, seconds = _size_or_time(limit) if limit else (0, 0.0)
    if seconds:
        raise RecordingError(f"'{limit}' is no size to end at: write for instance 2GB")
    return RecordingPlan(
        compact=compact,
        rotate_bytes=rotate_bytes,
        rotate_seconds=rotate_seconds,
        keep_files=keep_files,
        limit_bytes=limit_bytes,
        limit_rate=_rate(limit_rate) if limit_rate else 0,
        topics=_recorded_topics(topic_names),
        overwrites=overwrites,
    )


def to_json(plan: RecordingPlan) -> str:
    """A plan as it is handed to another process."""
    return msgspec.json.encode(plan).decode()


def from_json(text: str) -> RecordingPlan:
    """The plan again; RecordingError if it is none."""
    try:
        return msgspec.json.decode(text, type=RecordingPlan)
    except msgspec.DecodeError as error:
        raise RecordingError(f"'{text}' is no plan of a recording: {error}") from error


def files_of(path: Path) -> list[Path]:
    """The numbered files of a recording that rotates, oldest first."""
    numbered = re.compile(re.escape(path.stem) + r"\.(\d{3,})" + re.escape(path.suffix) + r"\Z")
    try:
        found = [(int(match[1]), file) for file in path.parent.iterdir() if (match := numbered.match(file.name))]
    except OSError:
        return []
    return [file for _, file in sorted(found)]


def numbered_file(path: Path, number: int) -> Path:
    """run.mcap as run.000.mcap and so on."""
    return path.with_name(f"{path.stem}.{number:03}{path.suffix}")


def _size_or_time(text: str) -> tuple[int, float]:
    match = _QUANTITY.match(text)
    unit = match[2].lower() if match else ""
    if match is None or unit not in {**_BYTES, **_SECONDS}:
        raise RecordingError(f"'{text}' is neither a size nor a time: write for instance 512MB, 2GB, 30s or 10min")
    if unit in _SECONDS:
        seconds = float(match[1]) * _SECONDS[unit]
        if seconds < 1.0:
            raise RecordingError(f"'{text}' is too short for a recording: at least 1s")
        return 0, seconds
    size = int(float(match[1]) * _BYTES[unit])
    if size < _LEAST_SIZE:
        raise RecordingError(f"'{text}' is too small for a recording: at least 1MB")
    return size, 0.0


def _rate(text: str) -> int:
    """Bytes a second in 5MB/s."""
    size, slash, unit = text.strip().lower().rpartition("/")
    match = _QUANTITY.match(size)
    if not slash or unit.strip() != "s" or match is None or match[2] not in _BYTES:
        raise RecordingError(f"'{text}' is no rate: write for instance 5MB/s or 200kB/s")
    rate = int(float(match[1]) * _BYTES[match[2]])
    if rate < _LEAST_RATE:
        raise RecordingError(f"'{text}' is too slow for a recording: at least {_LEAST_RATE // 1000}kB/s")
    return rate


def _recorded_topics(names: str) -> tuple[str, ...]:
    chosen = tuple(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
    known = [topic.name for topic in topics.TOPICS if topic.recorded]
    for name in chosen:
        if name not in known:
            raise RecordingError(f"'{name}' is no topic that is recorded; there are {', '.join(known)}")
    return chosen and tuple(dict.fromkeys((*ALWAYS, *chosen)))
