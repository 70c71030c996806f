from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from elys.common.components.decimals import shortest_decimal, shortest_decimals


@given(arrays.arrays(np.float32, arrays.array_shapes(max_dims=2, min_side=0), elements=st.floats(width=32)))
def test_decimals_are_those_that_numpy_prints(values):
    expected = np.array([float(str(value)) for value in values.ravel()]).reshape(values.shape)
    np.testing.assert_array_equal(shortest_decimals(values), expected)


@given(st.integers(0, 2**32 - 1))
def test_every_bit_pattern_survives(bits):
    value = np.array([bits], np.uint32).view(np.float32)
    decimal = shortest_decimals(value)
    if not np.isnan(value[0]):
        assert decimal.astype(np.float32).tobytes() == value.tobytes()
        assert decimal[0] == shortest_decimal(float(value[0]))


@given(st.integers(-999_999, 999_999), st.integers(-30, 30))
def test_six_digits_come_back_as_they_were_written(digits, exponent):
    written = float(f"{digits}e{exponent}")
    assert shortest_decimal(float(np.float32(written))) == written


def test_what_is_not_finite_and_the_sign_of_zero_stay():
    assert math.isnan(shortest_decimal(math.nan))
    assert shortest_decimal(-math.inf) == -math.inf
    assert math.copysign(1.0, shortest_decimal(-0.0)) == -1.0
    assert np.signbit(shortest_decimals(np.array([-0.0], np.float32)))[0]
