"""export: a recording for other programs, by the suffix of the file that is to be written."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from elys.bus.exports.selection import Progress, Selection
from elys.common.errors import RecordingError
from elys.verbs.moments import parse_moment
from elys.verbs.output import progress_bar, size_text

FOXGLOVE_SUFFIX: Final = ".foxglove.mcap"
PICTURES: Final = (".mp4", ".mkv", ".mov", ".webm", ".gif", ".png", ".jpg", ".jpeg")
Exporter = Callable[[Path, Path, Selection, Progress], str]


def export(
    recording: Path, output: Path, *, start: str, end: str, rate: float, entities: Sequence[str], foxglove: bool
) -> None:
    """Writes what of a recording is selected, and says what it was."""
    suffix = FOXGLOVE_SUFFIX if foxglove or output.name.endswith(FOXGLOVE_SUFFIX) else output.suffix
    exporter = EXPORTERS.get(suffix)
    if exporter is None and suffix in PICTURES:
        picture = output if suffix == ".png" else output.with_suffix(".mp4")
        raise RecordingError(
            f"{output} would be pictures, which `elys render {recording} -o {picture}` makes; motion is exported as "
            f"{', '.join(EXPORTERS)}"
        )
    if exporter is None:
        raise RecordingError(
            f"{output} is no place for motion: give it the suffix {', '.join(EXPORTERS)}, for instance motion.npz"
        )
    selection = selected(start=start, end=end, rate=rate, entities=entities)
    with progress_bar(f"Writing {output.name}") as progress:
        what = exporter(recording, output, selection, progress)
    print(f"{output}: {what}, {size_text(output.stat().st_size)}")


def selected(*, start: str, end: str, rate: float = 0.0, entities: Sequence[str] = ()) -> Selection:
    """What was asked for, in words; raises ElysError."""
    selection = Selection(
        start=parse_moment(start, otherwise=-math.inf),
        end=parse_moment(end, otherwise=math.inf),
        rate=rate,
        entities=tuple(entities),
    )
    if selection.end < selection.start:
        raise RecordingError(f"--to {end} lies before --from {start}")
    return selection


def _npz(source: Path, target: Path, selection: Selection, progress: Progress) -> str:
    from elys.bus.export import export_npz

    shapes = export_npz(source, target, selection, progress)
    return ", ".join(f"{name} {list(shape)}" for name, shape in shapes.items())


def _csv(source: Path, target: Path, selection: Selection, progress: Progress) -> str:
    from elys.bus.exports.tables import export_csv

    return f"{export_csv(source, target, selection, progress)} rows"


def _parquet(source: Path, target: Path, selection: Selection, progress: Progress) -> str:
    from elys.bus.exports.tables import export_parquet

    return f"{export_parquet(source, target, selection, progress)} rows"


def _glb(source: Path, target: Path, selection: Selection, progress: Progress) -> str:
    from elys.bus.exports.model import export_glb

    made = export_glb(source, target, selection, progress)
    return f"{made.nodes} nodes, {made.channels} channels of motion over {made.duration:.2f} s"


def _foxglove(source: Path, target: Path, selection: Selection, progress: Progress) -> str:
    from elys.bus.exports.foxglove_file import export_foxglove

    if target.suffix != ".mcap":
        raise RecordingError(f"{target} is no place for Foxglove's messages: give it the suffix .mcap")
    made = export_foxglove(source, target, selection, progress)
    return f"{made.frames} frames of {made.entities} entities, {made.messages} messages"


EXPORTERS: Final[dict[str, Exporter]] = {
    ".npz": _npz,
    ".csv": _csv,
    ".parquet": _parquet,
    ".glb": _glb,
    FOXGLOVE_SUFFIX: _foxglove,
}
