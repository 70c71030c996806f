"""What a sweep varies, and the table that comes of it."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError
from elys.common.scene import open_scene, write_scene
from elys.lab.sweep import SweepJob, require_table, run_row, write_rows
from elys.lab.variation import combinations, parse_variation, varied
from elys.samples.stack import stack


@pytest.fixture
def scene(tmp_path):
    write_scene(stack(3), tmp_path / "stack.scene.json")
    return open_scene(tmp_path / "stack.scene.json", AssetStore())


@pytest.mark.parametrize(
    "text, values",
    [
        ("seed=0..3", (0, 1, 2, 3)),
        ("gravity=1.62, 9.81", (1.62, 9.81)),
        ("A.RigidBody.mass=1..2:5", (1.0, 1.25, 1.5, 1.75, 2.0)),
        ("A.Collider.shape=box,sphere", ("box", "sphere")),
        ("A.Collider.is_trigger=true,false", (True, False)),
        ("x=-2..-1", (-2, -1)),
    ],
)
def test_values_are_read(text, values):
    assert parse_variation(text).values == values


@pytest.mark.parametrize("text", ["seed", "seed=", "=1", "a=1..x:3", "a=0.5..2", "a=3..1", "a=0..99999999", "a=1..2:0"])
def test_what_varies_nothing_is_one_sentence(text):
    with pytest.raises(ElysError) as told:
        parse_variation(text)
    assert "\n" not in str(told.value)


def test_every_combination_comes_once():
    asked = combinations([parse_variation("seed=0..1"), parse_variation("gravity=1,2,3")])
    assert len(asked) == 6 and len({tuple(values.items()) for values in asked}) == 6
    with pytest.raises(ElysError, match="twice"):
        combinations([parse_variation("seed=0..1"), parse_variation("seed=2")])
    with pytest.raises(ElysError, match="runs"):
        combinations([parse_variation("seed=0..9999"), parse_variation("gravity=0..9999")])


def test_values_land_where_their_names_say(scene):
    changed = varied(scene, {"gravity": 1.62, "tick_rate": 30, "Cube 2.RigidBody.mass": 7.0}, jitter=0.0)
    assert changed.settings.gravity == (0.0, -1.62, 0.0) and changed.settings.tick_rate == 30
    masses = {record.name: record.components.get("RigidBody", {}).get("mass") for record in changed.records}
    assert masses["Cube 2"] == 7.0 and masses["Cube 1"] != 7.0
    moved = varied(scene, {"Cube 1.Transform.position.x": 2.5}, jitter=0.0)
    before = next(record for record in scene.records if record.name == "Cube 1").components["Transform"]["position"]
    after = next(record for record in moved.records if record.name == "Cube 1").components["Transform"]["position"]
    assert list(after) == [2.5, *before[1:]]


def test_a_seed_moves_bodies_by_no_more_than_asked_and_always_alike(scene):
    positions = {}
    for seed in (1, 1, 2):
        moved = varied(scene, {"seed": seed}, jitter=0.01)
        pairs = [
            (record.components["Transform"]["position"], old.components["Transform"]["position"])
            for record, old in zip(moved.records, scene.records, strict=True)
            if "RigidBody" in record.components
        ]
        offsets = np.array([np.subtract(new, old) for new, old in pairs])
        assert 0.0 < np.abs(offsets).max() <= 0.01
        assert np.array_equal(positions.setdefault(seed, offsets), offsets)
    assert not np.array_equal(positions[1], positions[2])


@pytest.mark.parametrize(
    "values, said",
    [
        ({"tick_rat": 1}, "cannot be varied"),
        ({"Cub 1.RigidBody.mass": 1}, "did you mean 'Cube 1'"),
        ({"Cube 1.RigidBdy.mass": 1}, "has no RigidBdy"),
        ({"Cube 1.RigidBody.mas": 1}, "no field mas"),
        ({"Cube 1.Transform.position.q": 1}, "no axis"),
        ({"substeps": 0}, "substeps"),
        ({"seed": -1}, "whole number"),
    ],
)
def test_a_name_that_is_none_is_told(scene, values, said):
    with pytest.raises(ElysError, match=said):
        varied(scene, values, jitter=0.0)


def test_a_row_says_what_happened_and_a_run_that_cannot_be_says_why(scene):
    row = run_row(SweepJob(scene, AssetStore(), {"gravity": 5.0}, 1.0, 0.0))
    assert row["problem"] == "" and row["bodies"] == 3 and row["resting"] == 3
    assert row["energy_start"] == pytest.approx(row["mass"] * 5.0 * 1.5)
    wrong = run_row(SweepJob(scene, AssetStore(), {"Cube 1.RigidBody.mass": -1.0}, 1.0, 0.0))
    assert "mass" in wrong["problem"]


def test_tables_hold_all_rows(tmp_path):
    found = [{"seed": 0, "overlap": 1e-3, "problem": ""}, {"seed": 1, "problem": "no"}]
    for name in ("rows.csv", "rows.json", "rows.parquet"):
        write_rows(tmp_path / name, found)
    assert json.loads((tmp_path / "rows.json").read_text()) == found
    assert [row["seed"] for row in csv.DictReader((tmp_path / "rows.csv").open())] == ["0", "1"]
    parquet = pytest.importorskip("pyarrow.parquet")
    assert parquet.read_table(tmp_path / "rows.parquet").to_pydict()["overlap"] == [1e-3, None]


def test_a_file_that_is_no_table_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(ElysError, match="parquet"):
        require_table(tmp_path / "rows.txt")
    with pytest.raises(ElysError, match="no folder"):
        require_table(tmp_path / "nowhere" / "rows.csv")
