"""Columns over time: what is kept is what was put in, gaps stay gaps, and a CSV is read back by others."""

from __future__ import annotations

import math
import random

import numpy as np

from elys.editor_node.plot_series import AXES, SeriesTable, thinned


def test_the_newest_rows_are_those_of_a_plain_list():
    rng = random.Random(1)
    table, plain = SeriesTable(capacity=37), []
    a, b = table.add("a", "m"), table.add("b", "m")
    for tick in range(500):
        row = (tick, tick / 60.0, rng.random(), rng.random())
        table.append(row[0], row[1], row[2:])
        plain.append(row)
        kept = plain[-37:]
        if tick % 13 == 0:
            assert table.ticks.tolist() == [row[0] for row in kept]
            assert table.times.tolist() == [row[1] for row in kept]
            assert table.values(a).tolist() == [row[2] for row in kept]
            assert table.values(b).tolist() == [row[3] for row in kept]


def test_a_leap_in_time_leaves_a_gap():
    table = SeriesTable()
    series = table.add("a", "")
    for tick in (0, 1, 2, 200, 201, 50, 51):  # a seek forwards, then backwards
        table.append(tick, tick / 60.0, [float(tick)])
    values = table.values(series)
    assert [None if math.isnan(v) else v for v in values] == [0.0, 1.0, 2.0, None, 200.0, 201.0, None, 50.0, 51.0]


def test_the_same_tick_again_replaces_its_row():
    table = SeriesTable()
    series = table.add("a", "")
    table.append(1, 0.1, [1.0])
    table.append(1, 0.1, [2.0])
    assert table.values(series).tolist() == [2.0]


def test_what_comes_late_is_written_into_its_own_row():
    table = SeriesTable(capacity=10)
    first, late = table.add("a", "m"), table.add("b", "J")
    for tick in range(25):
        table.append(tick, tick / 60.0, [float(tick), math.nan])
        if tick:
            assert table.set_late(tick - 1, late, 10.0 * (tick - 1))
    assert not table.set_late(3, late, 1.0)  # long gone
    assert table.values(late)[:-1].tolist() == [10.0 * tick for tick in range(15, 24)]
    assert math.isnan(table.values(late)[-1])
    assert table.values(first).tolist() == [float(tick) for tick in range(15, 25)]


def test_a_series_that_comes_later_has_no_past_and_one_that_goes_takes_its_own():
    table = SeriesTable()
    a = table.add("a", "m")
    table.append(0, 0.0, [1.0])
    b = table.add("b", "J")
    assert table.add("a", "m") is a
    table.append(1, 0.1, [2.0, 3.0])
    assert np.isnan(table.values(b)[0])
    table.remove(a)
    assert table.values(b)[1] == 3.0
    table.remove(b)
    assert len(table) == 0
    c = table.add("c", "")
    table.append(0, 0.0, [5.0])
    assert table.values(c).tolist() == [5.0]


def test_axes_go_by_units():
    table = SeriesTable()
    axes = [
        table.add(name, unit).axis for name, unit in zip("abcdef", ("m", "m/s", "m", "J", "kg", "m/s"), strict=True)
    ]
    assert axes == [0, 1, 0, 2, AXES - 1, 1]


def test_a_csv_is_read_back_by_numpy(tmp_path):
    table = SeriesTable()
    table.add('Box "3", upper.Transform.position.y', "m")
    table.add("world.contacts", "")
    rng = random.Random(2)
    rows = [(tick, tick / 60.0, rng.uniform(-1e9, 1e-9), float(tick)) for tick in range(20)]
    rows[7] = (*rows[7][:2], math.nan, 7.0)
    for tick, time, *values in rows:
        table.append(tick, time, values)
    path = tmp_path / "x.csv"
    table.write_csv(path)
    read = np.genfromtxt(path, delimiter=",", skip_header=1)
    assert np.array_equal(read, np.array(rows), equal_nan=True)  # every bit of them
    import csv

    with path.open(newline="", encoding="utf-8") as file:
        header = next(csv.reader(file))
    assert header == ["tick", "time [s]", 'Box "3", upper.Transform.position.y [m]', "world.contacts"]


def test_thinned_curves_keep_every_extreme_and_every_gap():
    rng = np.random.default_rng(3)
    times = np.arange(30_000) / 60.0
    values = rng.normal(size=30_000)
    values[12_345], values[20_000] = 99.0, -99.0
    values[7000:7200] = np.nan
    thin_times, thin = thinned(times, values)
    assert len(thin) <= 2001
    assert (np.diff(thin_times) > 0.0).all()
    assert (np.nanmax(thin), np.nanmin(thin)) == (99.0, -99.0)
    assert np.isnan(thin).any()
    where = np.searchsorted(times, thin_times)
    assert np.array_equal(values[where], thin, equal_nan=True)
    # Nothing of what was drawn at any moment is higher or lower than what is drawn now.
    for low in range(0, 30_000, 3000):
        part, kept = values[low : low + 3000], thin[(where >= low) & (where < low + 3000)]
        assert np.nanmax(part) == np.nanmax(kept)


def test_few_points_stay_as_they_are():
    times, values = np.arange(5.0), np.array([1.0, np.nan, 2.0, 3.0, 4.0])
    assert thinned(times, values) == (times, values)
