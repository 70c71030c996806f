"""A recording for other programs: arrays of every body's motion. More kinds of files are in `elys.bus.exports`."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus import codec, topics
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
from elys.bus.messages.physics import Diagnostics
from elys.bus.rate_budget import THINNED
from elys.bus.recording import Recording
from elys.bus.topics import Encoding
from elys.common.errors import MessageError, RecordingError

_COLUMNS: Final = {
    "position": (3, "f8"),
    "rotation": (4, "f4"),
    "linear_velocity": (3, "f4"),
    "angular_velocity": (3, "f4"),
}
_log = logging.getLogger(__name__)


def export_npz(
    source: Path, target: Path, selection: Selection = EVERYTHING, progress: Progress = no_progress
) -> dict[str, tuple[int, ...]]:
    """Writes every body's motion as arrays; returns their shapes.

    time [T] s, tick [T], name [N], entity [N], position [T, N, 3] m, rotation [T, N, 4] x y z w, linear_velocity [T, N, 3]
    m/s and angular_velocity [T, N, 3] rad/s. N are all bodies there ever were; NaN where one was not there. Where diagnostics
    were recorded: energy [T] J, momentum [T, 3] kg m/s, angular_momentum [T, 3] kg m^2/s, overlap [T] m, joint_error [T] m
    and residual [T] m/s.

    Raises:
        RecordingError: the source is no recording, or the target cannot be written.
    """
    with Recording(source, checked=True) as recording:
        arrays = motion_arrays(recording, selection, progress)
    with whole_file(target) as part, part.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return {name: array.shape for name, array in arrays.items()}


def motion_arrays(
    recording: Recording, selection: Selection = EVERYTHING, progress: Progress = no_progress
) -> dict[str, NDArray[Any]]:
    """The arrays that `export_npz` writes; of several frames of one tick the last."""
    chosen = selected_positions(recording, selection)
    positions = chosen.tolist()
    entities, names = _bodies(recording, chosen, selection)
    shape = (len(positions), len(entities))
    try:
        arrays: dict[str, NDArray[Any]] = {
            name: np.full((*shape, width), np.nan, dtype) for name, (width, dtype) in _COLUMNS.items()
        }
    except MemoryError as error:
        raise RecordingError(f"{shape[0]} ticks of {shape[1]} bodies do not fit into the memory as arrays") from error
    for row, index in enumerate(positions):
        frame = recording.frame(index)
        known = np.isin(frame.entity, entities)
        bodies = np.searchsorted(entities, frame.entity[known])
        for name, array in arrays.items():
            array[row, bodies] = getattr(frame, name)[known]
        progress(row + 1, len(positions))
    return {
        "time": recording.time[positions],
        "tick": recording.tick[positions],
        "name": np.array(names),
        "entity": entities,
        **arrays,
        **_diagnostics(recording, recording.tick[positions]),
    }


def _bodies(
    recording: Recording, positions: NDArray[np.intp], selection: Selection
) -> tuple[NDArray[np.uint32], list[str]]:
    """All bodies that are selected at any of the frames [N], and what each was called when it was last there."""
    named = NamedEntities(selection)
    names: dict[int, str] = {}
    told = b""
    for mirror, frame, changed in selected_scenes(recording, positions):
        if changed:
            named.look(mirror)
        if changed or frame.entity.tobytes() != told:
            told = frame.entity.tobytes()
            there = frame.entity[named.rows(frame)].tolist()
            known = mirror.entities
            names.update((body, known[body].name if body in known else names.get(body, "")) for body in there)
    named.check(recording.path)
    entities = np.array(sorted(names), np.uint32)
    return entities, [names[entity] for entity in entities.tolist()]


def _diagnostics(recording: Recording, ticks: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """What was measured in each tick [T], NaN where nothing was, or was kept for a limit of the rate; no arrays for nothing."""
    found: dict[int, Diagnostics] = {}
    for message in recording.reader.messages((topics.DIAGNOSTICS.name,)):
        if not recording.is_within(message):
            continue
        try:
            measured = codec.decode_body(message.body, Diagnostics, Encoding.JSON)
        except MessageError as error:
            _log.warning("diagnostics in %s are left out: %s", recording.path, error)
            continue
        found[measured.tick] = measured
    if not found:
        return {}
    if THINNED in recording.reader.metadata:
        rows = [found.get(tick) for tick in ticks.tolist()]
    else:  # what is not told is as it was
        told = sorted(found)
        places = np.searchsorted(told, ticks, side="right").tolist()
        rows = [found[told[place - 1]] if place else None for place in places]
    nothing = (np.nan,) * 3
    return {
        "energy": np.array([np.nan if row is None else row.kinetic + row.potential for row in rows]),
        "momentum": np.array([nothing if row is None else row.momentum for row in rows]),
        "angular_momentum": np.array([nothing if row is None else row.angular_momentum for row in rows]),
        "overlap": np.array([np.nan if row is None else row.deepest_overlap for row in rows]),
        "joint_error": np.array([np.nan if row is None else row.joint_error for row in rows]),
        "residual": np.array([np.nan if row is None else row.residual for row in rows]),
    }
