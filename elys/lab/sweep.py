"""Many runs of a scene, each a row of observables."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from elys.common.assets.store import AssetStore, replace_file
from elys.common.errors import ElysError
from elys.common.scene import OpenedScene
from elys.lab.jobs import completed
from elys.lab.motion import Job, run_job
from elys.lab.observables import is_resting, settling_time
from elys.lab.pareto import physical, sample_rate
from elys.lab.variation import Value, varied

Row = dict[str, Any]
SUFFIXES = (".parquet", ".csv", ".json")


class SweepJob(NamedTuple):
    """A run that is asked for, by what it varies."""

    scene: OpenedScene
    assets: AssetStore
    values: dict[str, Value]
    duration: float  # [s]
    jitter: float  # [m]


def rows(
    scene: OpenedScene,
    assets: AssetStore,
    combinations: Sequence[dict[str, Value]],
    *,
    duration: float,
    jitter: float,
    processes: int = 0,
    cluster: str = "",
) -> Iterator[tuple[int, Row]]:
    """Each run's place and row, as they end. A run that cannot be has its reason in the column `problem`."""
    kept = physical(assets)
    jobs = [SweepJob(scene, kept, values, duration, jitter) for values in combinations]
    return completed(run_row, jobs, processes=processes, cluster=cluster)


def run_row(job: SweepJob) -> Row:
    """Simulates and measures what needs no other run to compare with."""
    try:
        scene = varied(job.scene, job.values, jitter=job.jitter)
        rate = sample_rate(scene.settings.tick_rate)
        motion = run_job(Job(scene, job.assets, job.duration, rate, is_timed=False))
    except ElysError as error:
        return {**job.values, "problem": str(error)}
    resting = is_resting(motion)[-1]
    settled, _ = settling_time(motion)
    mass = float(motion.mass.sum())
    centre = np.average(motion.position[-1], axis=0, weights=motion.mass)
    energy = motion.energy
    return {
        **job.values,
        "energy_start": float(energy[0]),  # [J]
        "energy_end": float(energy[-1]),
        "energy_gain": float((energy - np.minimum.accumulate(energy)).max()),
        "momentum_end": float(np.linalg.norm(motion.momentum[-1])),  # [kg m/s]
        "overlap": float(motion.overlap[1:].max(initial=0.0)),  # [m]
        "joint_violation": float(motion.joint_error.max()),  # [m]
        "settled": settled if resting.all() else math.inf,  # [s]
        "resting": int(resting.sum()),  # bodies
        "bodies": len(resting),
        "mass": mass,  # [kg]
        **{f"centre_{axis}": float(centre[n]) for n, axis in enumerate("xyz")},  # [m]
        "fastest": float(np.linalg.norm(motion.linear_velocity, axis=2).max()),  # [m/s]
        "state_hash": f"{motion.state_hash:016x}",
        "cost": 1000.0 * motion.cost / motion.duration,  # [ms/s]
        "problem": "" if motion.is_finite else "it did not stay in numbers",
    }


def write_rows(path: Path, found: Sequence[Row]) -> None:
    """Writes rows as a table: Parquet, CSV or JSON, by the suffix.

    Raises:
        ElysError: the suffix is none of these, the file cannot be written, or pyarrow is not installed.
    """
    columns = list(dict.fromkeys(name for row in found for name in row))
    try:
        replace_file(path, _ENCODERS[require_table(path)](columns, found))
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror}") from error


def require_table(path: Path) -> str:
    """The suffix of a table's file; raises ElysError where it cannot be one."""
    if path.suffix not in SUFFIXES:
        raise ElysError(f"{path} is no table: give it the suffix {', '.join(SUFFIXES)}")
    if not path.absolute().parent.is_dir():
        raise ElysError(f"{path} cannot be written: there is no folder {path.parent}")
    return path.suffix


def _parquet(columns: Sequence[str], found: Sequence[Row]) -> bytes:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ElysError("Parquet needs pyarrow: pip install 'elys[lab]', or write .csv or .json") from error
    table = pyarrow.table({name: [row.get(name) for row in found] for name in columns})
    sink = io.BytesIO()
    pyarrow.parquet.write_table(table, sink)
    return sink.getvalue()


def _csv(columns: Sequence[str], found: Sequence[Row]) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(found)
    return text.getvalue().encode()


def _json(columns: Sequence[str], found: Sequence[Row]) -> bytes:
    return msgspec.json.format(msgspec.json.encode(found), indent=1)


_ENCODERS = {".parquet": _parquet, ".csv": _csv, ".json": _json}
