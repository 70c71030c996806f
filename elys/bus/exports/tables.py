"""Motion as a table, one row per tick and body, written as it is read: a recording of any length takes the same memory."""

from __future__ import annotations

import csv
import dataclasses
import functools
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from elys.bus.exports.files import whole_file
from elys.bus.exports.selection import (
    EVERYTHING,
    NamedEntities,
    Progress,
    Selection,
    no_progress,
    selected_positions,
    selected_scenes,
)
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.common.errors import RecordingError


class Measure(NamedTuple):
    """One quantity of a body: its column of a state frame, its parts, unit and type."""

    column: str
    parts: str
    unit: str
    dtype: str


MEASURES: Final = (
    Measure("position", "xyz", "m", "f8"),
    Measure("rotation", "xyzw", "", "f4"),
    Measure("linear_velocity", "xyz", "m/s", "f4"),
    Measure("angular_velocity", "xyz", "rad/s", "f4"),
)
_FRAME_COLUMNS: Final = ("entity", *(measure.column for measure in MEASURES))
_ROWS_IN_A_GROUP: Final = 1 << 16  # of Parquet: enough to pack well, few enough to hold
_EXACT: Final = {"f8": "%r", "f4": "%.9g"}  # as many digits as bring the same bits back


def export_csv(source: Path, target: Path, selection: Selection = EVERYTHING, progress: Progress = no_progress) -> int:
    """Writes a line per tick and body, below a header that names columns with their units; returns the lines.

    Raises:
        RecordingError: the source is no recording, holds nothing of what is selected, or the target cannot be written.
    """
    count = 0
    with (
        Recording(source, checked=True) as recording,
        whole_file(target) as part,
        part.open("w", encoding="utf-8", newline="") as file,
    ):
        csv.writer(file, lineterminator="\n").writerow(_header())
        for block in _blocks(recording, selection, progress):
            _write_lines(file, block)
            count += len(block.frame.entity)
    return count


def export_parquet(
    source: Path, target: Path, selection: Selection = EVERYTHING, progress: Progress = no_progress
) -> int:
    """Writes the same rows as Parquet: names as a dictionary, units in the metadata of fields; returns the rows.

    Raises:
        RecordingError: as `export_csv`, or pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise RecordingError("Parquet needs pyarrow: pip install 'elys[parquet]', or write .csv or .npz") from error
    schema = _schema(pyarrow)
    count = 0
    with (
        Recording(source, checked=True) as recording,
        whole_file(target) as part,
        pyarrow.parquet.ParquetWriter(part, schema, compression="zstd") as writer,
    ):
        for columns in _groups(_blocks(recording, selection, progress)):
            arrays = [pyarrow.array(columns[field.name], field.type) for field in schema]
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))
            count += len(columns["tick"])
    return count


class _Block(NamedTuple):
    """The chosen bodies of one tick, and what they are called."""

    frame: StateFrame
    names: list[str]


def _blocks(recording: Recording, selection: Selection, progress: Progress) -> Iterator[_Block]:
    named = NamedEntities(selection)
    rows: NDArray[np.intp] | slice = slice(None)
    names: list[str] = []
    told = b""  # whom the frame before told of
    for mirror, frame, changed in selected_scenes(recording, selected_positions(recording, selection), progress):
        bodies = frame.entity.tobytes()
        if changed:
            named.look(mirror)
        if changed or bodies != told:
            told = bodies
            rows = named.rows(frame)
            names = [_name(mirror, body) for body in frame.entity[rows].tolist()]
        columns = {column: getattr(frame, column)[rows] for column in _FRAME_COLUMNS}
        yield _Block(dataclasses.replace(frame, **columns), names)
    named.check(recording.path)


def _name(mirror: SceneMirror, body: int) -> str:
    return mirror.entities[body].name if body in mirror.entities else ""


def _header() -> list[str]:
    """Names of the columns with their units."""
    parts = [f"{name} [{unit}]" if unit else name for name, unit, _ in _measured()]
    return ["tick", "time [s]", "entity", "name", *parts]


def _measured() -> Iterator[tuple[str, str, str]]:
    """Name, unit and type of every column of numbers."""
    for measure in MEASURES:
        for part in measure.parts:
            yield f"{measure.column}_{part}", measure.unit, measure.dtype


def _write_lines(file: TextIO, block: _Block) -> None:
    if not block.names:
        return
    line = ",".join(_EXACT[dtype] for _, _, dtype in _measured()) + "\n"
    head = f"{block.frame.tick},{block.frame.simulation_time!r},"
    numbers = [column.tolist() for column in _columns(block.frame)]
    who = zip(block.frame.entity.tolist(), block.names, zip(*numbers, strict=True), strict=True)
    file.writelines(f"{head}{body},{_quoted(name)},{line % values}" for body, name, values in who)


def _columns(frame: StateFrame) -> list[NDArray[Any]]:
    """A column [N] of numbers for each of `_measured`."""
    return [getattr(frame, m.column)[:, index] for m in MEASURES for index in range(len(m.parts))]


@functools.lru_cache(maxsize=1 << 16)
def _quoted(name: str) -> str:
    """A name as a cell of CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([name])
    return "" if not name else text.getvalue()


# --- Parquet -------------------------------------------------------------------------------------------------------


def _schema(pyarrow: Any) -> Any:
    types = {"f8": pyarrow.float64(), "f4": pyarrow.float32()}
    fields = [
        pyarrow.field("tick", pyarrow.uint64()),
        pyarrow.field("time", pyarrow.float64(), metadata={"unit": "s"}),
        pyarrow.field("entity", pyarrow.uint32()),
        pyarrow.field("name", pyarrow.dictionary(pyarrow.int32(), pyarrow.string())),
    ]
    for name, unit, dtype in _measured():
        fields.append(pyarrow.field(name, types[dtype], metadata={"unit": unit} if unit else None))
    return pyarrow.schema(fields)


def _groups(blocks: Iterator[_Block]) -> Iterator[dict[str, Any]]:
    """Columns of many ticks together."""
    waiting: list[_Block] = []
    count = 0
    for block in blocks:
        waiting.append(block)
        count += len(block.names)
        if count >= _ROWS_IN_A_GROUP:
            yield _group(waiting)
            waiting, count = [], 0
    if waiting:
        yield _group(waiting)


def _group(blocks: list[_Block]) -> dict[str, Any]:
    counts = [len(block.names) for block in blocks]
    numbers = [np.concatenate(parts) for parts in zip(*(_columns(block.frame) for block in blocks), strict=True)]
    return {
        "tick": np.repeat(np.array([block.frame.tick for block in blocks], np.uint64), counts),
        "time": np.repeat(np.array([block.frame.simulation_time for block in blocks]), counts),
        "entity": np.concatenate([block.frame.entity for block in blocks]),
        "name": [name for block in blocks for name in block.names],
        **dict(zip((name for name, _, _ in _measured()), numbers, strict=True)),
    }
