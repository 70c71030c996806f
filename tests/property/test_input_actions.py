"""Dead zones, curves and clipping against exact arithmetic and polar coordinates; actions against an account of single events."""

from __future__ import annotations

import cmath
import math
import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.bus.messages.commands import Input
from elys.common.input_response import axial, clipped_vector, radial, shaped
from elys.sim_node.inputs import Inputs

zones = st.floats(0.0, 0.95)
curves = st.floats(0.0, 1.0)
places = st.floats(-1.5, 1.5)


@given(st.floats(0.0, 1.5), zones, curves)
def test_a_push_is_shaped_as_exact_fractions_say(push: float, dead: float, curve: float) -> None:
    if push <= dead:
        exact = Fraction(0)
    else:
        s = (min(Fraction(push), 1) - Fraction(dead)) / (1 - Fraction(dead))
        exact = (1 - Fraction(curve)) * s + Fraction(curve) * s**3
    assert math.isclose(shaped(push, dead_zone=dead, curve=curve), exact, rel_tol=1e-9, abs_tol=1e-15)


@given(places, places, zones, curves)
def test_a_stick_keeps_its_direction_and_its_length_is_shaped(x: float, y: float, dead: float, curve: float) -> None:
    got = complex(*radial(x, y, dead_zone=dead, curve=curve))
    length, angle = cmath.polar(complex(x, y))
    if abs(length - dead) < 1e-12:  # where rounding decides
        assert abs(got) < 1e-9
        return
    s = 0.0 if length <= dead else (min(length, 1.0) - dead) / (1.0 - dead)
    assert cmath.isclose(got, cmath.rect(s * (1.0 - curve + curve * s * s), angle), rel_tol=1e-9, abs_tol=1e-12)
    assert abs(got) <= 1.0 + 1e-12


@given(places, zones, curves)
def test_one_axis_is_a_stick_that_goes_straight(x: float, dead: float, curve: float) -> None:
    alone, of_stick = axial(x, dead_zone=dead, curve=curve), radial(x, 0.0, dead_zone=dead, curve=curve)[0]
    assert math.isclose(alone, of_stick, rel_tol=1e-12, abs_tol=1e-15)
    assert alone == -axial(-x, dead_zone=dead, curve=curve)


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_vectors_are_clipped_to_the_disk(x: float, y: float) -> None:
    got = complex(*clipped_vector(x, y))
    length, angle = cmath.polar(complex(x, y))
    assert cmath.isclose(got, cmath.rect(min(length, 1.0), angle), rel_tol=1e-12, abs_tol=1e-15)


@pytest.mark.parametrize("seed", range(6))
def test_actions_are_what_single_events_make_of_them(seed: int) -> None:
    """Of three controls of jump at two nodes: which were down before and after a tick, and what happened between."""
    choose = random.Random(seed)
    inputs, down = Inputs(), set()
    seen = set()
    for _ in range(400):
        before, events = set(down), []
        for _ in range(choose.choice((0, 0, 1, 1, 2, 4))):
            control = choose.choice([("one", "space"), ("one", "pad_a"), ("two", "space")])
            is_down = control not in down
            events.append((control, is_down))
            (down.add if is_down else down.discard)(control)
            inputs.take(Input(player=1, source=control[0], changes=((control[1], is_down),)))
        action = inputs[1].action("jump")
        stays = bool(before & down - {control for control, _ in events})
        assert action.is_down == bool(down)
        assert action.was_pressed == (not stays and any(is_down for _, is_down in events))
        assert action.was_released == (not stays and any(not is_down for _, is_down in events))
        seen.add((action.is_down, action.was_pressed, action.was_released))
        inputs.end_tick()
        assert inputs[1].action("jump").is_down == bool(down)
        assert not inputs[1].action("jump").was_pressed and not inputs[1].action("jump").was_released
    assert len(seen) >= 5
