"""cut, merge, recover: recordings made of recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from elys.bus.recording_names import require_free
from elys.common.errors import RecordingError
from elys.verbs.export import selected
from elys.verbs.output import progress_bar, size_text
from elys.verbs.recording_child import require_recordable

_GAPS_TOLD: Final = 20


def cut(recording: Path, output: Path, *, start: str, end: str, overwrites: bool) -> None:
    """Writes a recording of a part of another."""
    from elys.bus.recording_parts import cut as write_part

    selection = selected(start=start, end=end)
    _require_place(output, [recording], overwrites=overwrites)
    with progress_bar(f"Writing {output.name}") as progress:
        made = write_part(recording, output, selection, progress)
    print(f"{output}: {made.ticks} ticks, {made.duration:.2f} s, {size_text(output.stat().st_size)}")


def merge(recordings: Sequence[Path], output: Path, *, overwrites: bool) -> None:
    """Writes one recording of several of the same session."""
    from elys.bus.recording_parts import merge as write_whole

    _require_place(output, recordings, overwrites=overwrites)
    with progress_bar(f"Writing {output.name}") as progress:
        made = write_whole(recordings, output, progress)
    print(f"{output}: {made.ticks} ticks, {made.duration:.2f} s, {size_text(output.stat().st_size)}")
    if made.duplicates:
        print(f"{made.duplicates} messages were in several of them and are there once")
    for before, after in made.gaps:
        print(f"in none of them is anything between tick {before} and tick {after}")


def _require_place(output: Path, sources: Sequence[Path], *, overwrites: bool) -> None:
    """Raises RecordingError unless a recording can be written there; that it is no source is seen when those are read."""
    if not any(source.exists() and output.exists() and source.samefile(output) for source in sources):
        if not overwrites:
            require_free(output)
        require_recordable(output, overwrites=overwrites)


def recover(recording: Path, output: Path | None, *, in_place: bool) -> None:
    """Mends a recording, and says what of it is lost."""
    from elys.bus.recording_recovery import recover as mend

    if output is not None and in_place:
        raise RecordingError("--in-place and -o name two places: give one of them")
    report = mend(recording, output, in_place=in_place)
    if report.is_whole:
        print(f"{recording} is whole: there is nothing to mend")
        return
    size = size_text(report.path.stat().st_size)
    print(f"{report.path}: {report.ticks} ticks, {report.messages} messages, {size}")
    for sentence in report.lost:
        print(f"lost: {sentence}")
    for first, last in report.missing[:_GAPS_TOLD]:
        print(f"missing in it: {f'tick {first}' if first == last else f'ticks {first} to {last}'}")
    if len(report.missing) > _GAPS_TOLD:
        print(f"and {len(report.missing) - _GAPS_TOLD} more places: `elys info {report.path}` counts all")
    if not report.lost:
        print("lost: nothing that had reached the file")
    if report.backup is not None:
        print(f"the damaged file is {report.backup}")
