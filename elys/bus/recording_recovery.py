"""Recovering a recording that a kill, a full disk or a bad disk has left: what can be read of it becomes a whole file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from elys.bus.exports.files import whole_file
from elys.bus.recording import Recording
from elys.bus.recording_parts import gaps_in
from elys.bus.recording_sources import SOURCES_NAME, Sources, source_of, sources_metadata
from elys.bus.transports.mcap import open_alone
from elys.bus.transports.mcap_mending import mend, needs_mending
from elys.common.errors import RecordingError

BACKUP_SUFFIX = ".bak"


class RecoveryReport(NamedTuple):
    """What became of a recording."""

    is_whole: bool  # it was whole before: nothing was written
    path: Path  # where the whole file is
    messages: int = 0
    ticks: int = 0
    lost: tuple[str, ...] = ()  # sentences
    backup: Path | None = None  # what the damaged file is called now
    missing: tuple[tuple[int, int], ...] = ()  # the first and the last of ticks that are not in the whole file


def recover(source: Path, target: Path | None = None, *, in_place: bool = False) -> RecoveryReport:
    """Writes a whole recording of what can be read of `source`: to `target`, by default beside it, or in its place.

    In its place, the damaged file is kept with `.bak` behind its name. Nothing that exists is overwritten.

    Raises:
        RecordingError: nothing can be read of it, it is being recorded, or the target is there already or cannot be written.
    """
    place = source if in_place else target or source.with_name(f"{source.stem}.recovered{source.suffix}")
    backup = source.with_name(source.name + BACKUP_SUFFIX) if in_place else None
    with Recording(source) as recording:
        if not needs_mending(recording.reader):
            return RecoveryReport(True, source)
        taken = backup if backup is not None else place
        if taken.exists():
            raise RecordingError(f"{taken} is there already: move it away, or name another file with -o")
        if in_place:
            os.close(open_alone(source))
        sources = Sources(made_by="recover", of=(source_of(recording, 0, len(recording) - 1),))
        # In its place: the damaged file takes its other name only when the whole one is written.
        with whole_file(place if backup is None else source.with_name(f".{source.name}.whole")) as part:
            mending = mend(recording.reader, part, {SOURCES_NAME: sources_metadata(sources)})
            ticks, missing = _ticks_in(part, source)
    if backup is not None:
        try:
            source.rename(backup)
            source.with_name(f".{source.name}.whole").rename(source)
        except OSError as error:
            raise RecordingError(f"{source} cannot be replaced: {error.strerror}") from error
    lost = list(mending.lost)
    if mending.beyond:
        lost.append(f"the last {mending.beyond} bytes, where it was cut off")
    return RecoveryReport(False, place, mending.messages, ticks, tuple(lost), backup, missing)


def _ticks_in(part: Path, source: Path) -> tuple[int, tuple[tuple[int, int], ...]]:
    """How many ticks the whole file has, and which it lacks; RecordingError where what was read is not enough for any."""
    try:
        with Recording(part) as mended:
            mended.mirror_at(0)
            ticks = np.unique(mended.tick)
            return len(ticks), tuple((before + 1, after - 1) for before, after in gaps_in(ticks.tolist()))
    except RecordingError as error:
        raise RecordingError(
            f"{source} cannot be recovered: {str(error).replace(str(part), 'what is left')}"
        ) from error
