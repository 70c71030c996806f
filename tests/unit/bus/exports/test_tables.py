"""CSV and Parquet against the closed forms that the recording was made of, read by others."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from elys.bus.exports.selection import Selection
from elys.bus.exports.tables import export_csv, export_parquet
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import CARRIER, FALLING, GUEST, TICKS, WHEEL, frame_at, poses, write_told

HEADER = (
    "tick,time [s],entity,name,position_x [m],position_y [m],position_z [m],rotation_x,rotation_y,rotation_z,rotation_w,"
    "linear_velocity_x [m/s],linear_velocity_y [m/s],linear_velocity_z [m/s],angular_velocity_x [rad/s],"
    "angular_velocity_y [rad/s],angular_velocity_z [rad/s]"
)
NAMES = {FALLING: "Falling", CARRIER: "Carrier", WHEEL: "Wheel", GUEST: "Guest"}


@pytest.fixture
def told(tmp_path: Path) -> Path:
    return write_told(tmp_path / "told.mcap")


def test_csv_has_a_row_per_tick_and_body_and_the_same_bits(told: Path, tmp_path: Path) -> None:
    count = export_csv(told, tmp_path / "t.csv")
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines[0] == HEADER
    rows = list(csv.DictReader(lines))
    assert count == len(rows) == sum(len(poses(tick)) for tick in range(TICKS + 1))
    at = iter(rows)
    for tick in range(TICKS + 1):
        frame = frame_at(tick, 0)
        for index, body in enumerate(poses(tick)):
            row = next(at)
            assert (int(row["tick"]), int(row["entity"]), row["name"]) == (tick, body, NAMES[body])
            assert float(row["time [s]"]) == tick / 60
            assert [float(row[f"position_{axis} [m]"]) for axis in "xyz"] == list(poses(tick)[body][0])
            read = np.array([row[f"rotation_{part}"] for part in "xyzw"], np.float32)
            assert read.tobytes() == frame.rotation[index].tobytes()
            assert np.float32(row["linear_velocity_x [m/s]"]) == np.float32(tick / 60)


def test_parquet_has_the_same_rows_with_types_and_units(
    told: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr("elys.bus.exports.tables._ROWS_IN_A_GROUP", 50)
    count = export_parquet(told, tmp_path / "t.parquet")
    table = parquet.read_table(tmp_path / "t.parquet")
    assert count == table.num_rows == sum(len(poses(tick)) for tick in range(TICKS + 1))
    assert parquet.ParquetFile(tmp_path / "t.parquet").num_row_groups > 5
    export_csv(told, tmp_path / "t.csv")
    rows = list(csv.reader((tmp_path / "t.csv").read_text().splitlines()))[1:]
    for number, name in enumerate(table.column_names):
        values = table.column(name).to_pylist()
        if name == "name":
            assert values == [row[number] for row in rows]
        else:
            dtype = table.schema.field(name).type.to_pandas_dtype()
            np.testing.assert_array_equal(values, np.array([row[number] for row in rows], dtype))
    assert table.schema.field("position_x").metadata == {b"unit": b"m"}
    assert str(table.schema.field("position_x").type) == "double"


def test_a_part_in_time_in_rate_and_of_some_entities(told: Path, tmp_path: Path) -> None:
    selection = Selection(start=0.5, end=1.5, rate=20.0, entities=("Carrier", "Gu*"))
    export_csv(told, tmp_path / "t.csv", selection)
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    ticks = sorted({int(row["tick"]) for row in rows})
    assert ticks == list(range(30, 91, 3))
    # With the carrier comes the wheel, which is below it.
    assert {row["name"] for row in rows if int(row["tick"]) < 90} == {"Carrier", "Wheel", "Guest"}
    assert {row["name"] for row in rows if int(row["tick"]) == 90} == {"Carrier", "Wheel"}


def test_a_rate_above_that_of_the_ticks_takes_each_once(told: Path, tmp_path: Path) -> None:
    export_csv(told, tmp_path / "t.csv", Selection(rate=1000.0, entities=("Falling",)))
    assert len((tmp_path / "t.csv").read_text().splitlines()) == TICKS + 2


@pytest.mark.parametrize(
    ("selection", "sentence"),
    [
        (Selection(start=100.0), "has no tick between 100 s and inf s: it goes from 0 s to 2 s"),
        (Selection(entities=("Nobody",)), "has no entity named 'Nobody' in that time; there are 'Ground', 'Falling'"),
        (Selection(end=0.2, entities=("Guest",)), "has no entity named 'Guest' in that time"),
        (Selection(rate=math.inf), "is none"),
    ],
)
def test_what_cannot_be_written_is_said_and_leaves_nothing(
    told: Path, tmp_path: Path, selection: Selection, sentence: str
) -> None:
    (tmp_path / "t.csv").write_text("as it was")
    with pytest.raises(RecordingError) as refused:
        export_csv(told, tmp_path / "t.csv", selection)
    assert sentence in str(refused.value)
    assert (tmp_path / "t.csv").read_text() == "as it was"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t.csv", "told.mcap"]


def test_without_pyarrow_there_is_a_sentence(told: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecordingError, match=r"pip install 'elys\[parquet\]'"):
        export_parquet(told, tmp_path / "t.parquet")
    assert not (tmp_path / "t.parquet").exists()


def test_names_with_commas_and_quotes_stay_one_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.unit.bus import told_recordings

    name = 'a "box", red'
    scene = tuple(
        told_recordings.spawned(FALLING, name, RigidBody={}) if one.entity == FALLING else one
        for one in told_recordings.SCENE
    )
    monkeypatch.setattr(told_recordings, "SCENE", scene)
    export_csv(write_told(tmp_path / "n.mcap", last=3), tmp_path / "n.csv", Selection(entities=(name,)))
    rows = list(csv.DictReader((tmp_path / "n.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == [name] * 4
