"""Curves: against scipy's splines, and through columns, snapshots and scene files."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from elys.bus.snapshot_columns import component_columns, unpack_columns
from elys.common.components import Light, check_value, declaration_of
from elys.common.components.columns import StringTable, columns_from, components_from, pack_array
from elys.common.components.curve import MAX_KEYS, Curve, repeated_value_at, value_at
from elys.common.components.schema import component_schema
from elys.common.errors import ComponentError
from elys.common.scene import EntityNode, SceneDocument
from elys.common.scene_reading import parse_scene
from elys.common.scene_writing import format_scene

LIGHT = declaration_of(Light)
FIELD = LIGHT.field("over_time")
PULSE: Curve = ((0.0, 1.0, 0.0, 0.0), (0.5, 3.25, 0.1, -2.0), (2.0, 0.5, 0.0, 0.0))

numbers = st.floats(-100.0, 100.0).map(lambda number: round(number, 3))
values = st.floats(0.0, 1000.0).map(lambda number: round(number, 3))


@st.composite
def curves(draw: st.DrawFn) -> Curve:
    times = sorted(draw(st.sets(st.integers(0, 10_000), max_size=MAX_KEYS)))
    return tuple((time / 100.0, draw(values), draw(numbers), draw(numbers)) for time in times)


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(curve=curves(), share=st.floats(0.0, 1.0))
def test_between_two_keys_it_is_scipys_hermite_spline(curve: Curve, share: float) -> None:
    for (start, first, _, leaving), (end, second, arriving, _) in itertools.pairwise(curve):
        time = start + share * (end - start)
        spline = CubicHermiteSpline([start, end], [first, second], [leaving, arriving])
        assert value_at(curve, time) == pytest.approx(float(spline(time)), rel=1e-9, abs=1e-6)
    if curve:
        assert value_at(curve, -1.0) == value_at(curve, curve[0][0]) == curve[0][1]
        assert value_at(curve, 1e6) == curve[-1][1]


def test_it_begins_anew_after_its_last_key() -> None:
    for time in np.linspace(0.0, 1.99, 40):
        assert repeated_value_at(PULSE, float(time) + 6.0) == pytest.approx(value_at(PULSE, float(time)), abs=1e-9)
    assert repeated_value_at((), 3.0) == 0.0
    assert repeated_value_at(((0.0, 4.0, 0.0, 0.0),), 3.0) == 4.0


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(st.lists(curves(), max_size=2))
def test_columns_and_snapshots_give_it_back(several: list[Curve]) -> None:
    lights, strings = [Light(over_time=curve) for curve in several], StringTable()
    columns = columns_from(LIGHT, lights, strings)
    assert components_from(LIGHT, columns, strings) == lights
    entities = np.arange(1, len(lights) + 1, dtype=np.uint32)
    _, unpacked = unpack_columns(component_columns(LIGHT, entities, columns), strings)
    assert components_from(LIGHT, unpacked, strings) == lights


def test_a_scene_file_gives_it_back() -> None:
    lamp = EntityNode(name="Lamp", components={"Light": {"over_time": [list(key) for key in PULSE]}})
    text = format_scene(SceneDocument(name="Lamps", entities=[lamp]))
    written = json.loads(text)["entities"][0]["components"]["Light"]["over_time"]
    assert tuple(map(tuple, written)) == PULSE
    assert format_scene(parse_scene(text)) == text
    schema = component_schema("Light")["properties"]["over_time"]
    assert schema["maxItems"] == MAX_KEYS and schema["items"]["minItems"] == 4 and schema["default"] == []


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (3.0, "must be a list of keys"),
        ([[0.0, 1.0]], "keys of time, value, slope before and slope after"),
        ([[0.0, 1.0, 0.0, "steep"]], "must be a number"),
        ([[-0.5, 1.0, 0.0, 0.0]], "begins at 0 s at the earliest"),
        ([[1.0, 1.0, 0.0, 0.0], [1.0, 2.0, 0.0, 0.0]], "times rise"),
        ([[1.0, 1.0, 0.0, 0.0], [1.0 + 1e-12, 2.0, 0.0, 0.0]], "times rise"),
        ([[0.0, -1.0, 0.0, 0.0]], "at least 0"),
        ([[float(n), 1.0, 0.0, 0.0] for n in range(MAX_KEYS + 1)], "may have 16 keys, not 17"),
        ([[0.0, 1.0, float("nan"), 0.0]], "finite"),
        ([[0.0, 1.0, 1e12, 0.0]], "up to 1e"),
    ],
)
def test_what_is_no_curve_is_refused(value: object, words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        check_value(LIGHT, FIELD, value)


def test_stored_numbers_that_are_no_curve_are_refused() -> None:
    good = columns_from(LIGHT, [Light(over_time=PULSE)], StringTable())["over_time"]
    for place, number in ((4, 0.0), (0, np.nan), (0, -1.0), (1, -3.0), (14, np.inf)):
        bad = good.copy()
        bad[0, place] = number
        with pytest.raises(ComponentError, match="array of curves"):
            pack_array(LIGHT, FIELD, bad, 1, StringTable())
