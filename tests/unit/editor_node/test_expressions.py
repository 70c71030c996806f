"""What is typed into numbers, against values worked out by hand and by Python itself."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.components import declarations
from elys.editor_node.expressions import MAX_DEPTH, MAX_LENGTH, Entry, ExpressionError, read_entry
from elys.editor_node.units import UNITS, units_of


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("2*pi", "", 2.0 * math.pi),
        ("1/3", "", 1.0 / 3.0),
        ("-2^2", "", -4.0),
        ("2^-1", "", 0.5),
        ("2**3**2", "", 512.0),
        ("1 - 2 - 3", "", -4.0),
        ("12 / 2 / 3", "", 2.0),
        ("2 (", "", None),
        (".5e-1", "", 0.05),
        ("1,5", "m", 1.5),
        ("max(1,5)", "", 5.0),
        ("min(3, 2, 4) + abs(-1)", "", 3.0),
        ("sqrt(2)/2", "", math.sqrt(0.5)),
        ("50%", "", 0.5),
        ("1/2 pi", "", math.pi / 2.0),
        ("− 3 × 2 ÷ 4", "", -1.5),
        ("90deg", "rad", math.pi / 2.0),
        ("90°", "rad", math.pi / 2.0),
        ("90", "rad", 90.0),
        ("0.25 turn", "deg", 90.0),
        ("pi rad", "deg", 180.0),
        ("asin(1)", "deg", 90.0),
        ("sin(30°)", "", 0.5),
        ("sin(30°) m", "m", 0.5),
        ("30 cm", "m", 0.3),
        ("1 + 20 cm", "m", 1.2),
        ("20 cm + 1", "m", 1.2),
        ("1 ft + 6 in", "m", 0.4572),
        ("1/3 m", "m", 1.0 / 3.0),
        ("1/2 in", "m", 0.0127),
        ("sqrt(4 m²)", "m", 2.0),
        ("10 µm", "m", 1e-5),
        ("1.5e3 g", "kg", 1.5),
        ("2 t", "kg", 2000.0),
        ("72 km/h", "m/s", 20.0),
        ("72 km / 2 h", "m/s", 10.0),
        ("60 mph", "m/s", 26.8224),
        ("60 rpm", "rad/s", 2.0 * math.pi),
        ("60 rpm", "rad/s | m/s", 2.0 * math.pi),
        ("36 km/h", "rad/s | m/s", 10.0),
        ("45 deg", "rad | m", math.pi / 4.0),
        ("5 cm", "rad | m", 0.05),
        ("9.81 N/kg", "m/s2", 9.81),
        ("1 g", "m/s2", None),
        ("2 kN m", "N m", 2000.0),
        ("3 kN", "N m | N", 3000.0),
        ("1 g/cm^3", "kg/m^3", 1000.0),
        ("1 kg/l", "kg/m^3", 1000.0),
        ("20 ms", "s", 0.02),
        ("2 kHz", "Hz", 2000.0),
        ("1/(20 ms)", "Hz", 50.0),
        ("3/s", "1/s", 3.0),
        ("100 klx", "lx | cd", 1e5),
        ("800 cd", "lx | cd", 800.0),
        ("1 EV", "EV", 1.0),
        ("4 m / 2 m", "", 2.0),
    ],
)
def test_values_are_worked_out(text, unit, value):
    if value is None:
        with pytest.raises(ExpressionError):
            read_entry(text, unit)
    else:
        entry = read_entry(text, unit)
        assert entry.operation == "="
        assert entry.operand == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit", "own", "value"),
    [
        ("+=0.5", "m", 2.0, 2.5),
        (" += 10 cm", "m", 2.0, 2.1),
        ("-=90°", "rad", math.pi, math.pi / 2.0),
        ("*2", "kg", 3.0, 6.0),
        ("*= 1 + 1", "kg", 3.0, 6.0),
        ("/4", "kg", 3.0, 0.75),
        ("*50%", "kg", 3.0, 1.5),
        ("+2", "m", 7.0, 2.0),
        ("-2", "m", 7.0, -2.0),
    ],
)
def test_what_is_relative_is_done_to_the_own_value(text, unit, own, value):
    assert read_entry(text, unit).applied(own) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("", "m", "nothing was typed"),
        ("+=", "m", "nothing was typed"),
        ("3 kg", "m", "'3 kg' is a mass, and this takes a length [m]"),
        ("3 m", "", "'3 m' is a length, and this takes a plain number"),
        ("3 Hz", "rad/s", "a rate"),
        ("*2 m", "m", "a plain number"),
        ("1 m + 1 s", "m", "a length and a time cannot be put together"),
        ("1 cmm", "m", "no unit or constant 'cmm'; did you mean"),
        ("3 parsecs", "m", "a length takes m, km"),
        ("zebra", "", "this takes no unit"),
        ("2*", "", "ends too early"),
        ("2)", "", "')' is not expected"),
        ("(2", "", "closing parenthesis"),
        ("2 3", "", "'3' is not expected"),
        ("2 # 3", "", "'#' is not expected"),
        ("1/0", "", "divides by zero"),
        ("/0", "", "divided by zero"),
        ("9^9^9", "", "too large"),
        ("1e999", "", "too large"),
        ("sqrt(-1)", "", "no value"),
        ("log(0)", "", "no value"),
        ("sqrt(1, 2)", "", "one value"),
        ("2^(1 m)", "", "an exponent is a plain number"),
        ("exp(1 m)", "", "does not take a length"),
        ("__import__('os')", "", "not expected"),
        ("(" * 30 + "1" + ")" * 30, "", "nested too deeply"),
        ("-" * 150 + "1", "", "nested too deeply"),
        ("1" * (MAX_LENGTH + 1), "", f"at most {MAX_LENGTH}"),
        ("日本", "m", "no unit or constant '日本'"),
        ("🙂", "m", "'🙂' is not expected"),
        ("nan", "", "no unit or constant 'nan'"),
    ],
)
def test_what_is_no_value_is_one_sentence(text, unit, words):
    with pytest.raises(ExpressionError) as refusal:
        read_entry(text, unit)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


NUMBERS = st.floats(0.0, 1e6).map(lambda value: f"{value!r}")


@st.composite
def arithmetic(draw, depth=3):
    if depth == 0 or draw(st.booleans()):
        return draw(NUMBERS)
    left, right = draw(arithmetic(depth=depth - 1)), draw(arithmetic(depth=depth - 1))
    sign = draw(st.sampled_from(["+", "-", "*"]))
    text = f"{left} {sign} {right}"
    return f"({text})" if draw(st.booleans()) else text


@given(arithmetic())
def test_arithmetic_is_that_of_python(text):
    if text.count("(") <= MAX_DEPTH and len(text) <= MAX_LENGTH:
        assert read_entry(text) == Entry("=", eval(text))


@given(st.text(max_size=MAX_LENGTH))
def test_any_text_is_a_finite_number_or_a_sentence(text):
    try:
        entry = read_entry(text, "m/s")
    except ExpressionError as error:
        assert str(error)
    else:
        assert math.isfinite(entry.operand)


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e3, 1e3))
def test_a_unit_of_its_own_field_is_the_number(name, value):
    text = f"{value!r} {name}" if name != "%" else f"{value!r}"
    assert read_entry(text, name if name != "%" else "").operand == pytest.approx(value, rel=1e-9, abs=1e-300)


def test_every_declared_unit_is_known():
    for declaration in declarations().values():
        for field in declaration.fields:
            assert all(unit.size > 0.0 for unit in units_of(field.unit)), f"{declaration.name}.{field.name}"
