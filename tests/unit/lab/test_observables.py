"""Errors of motions that are made by hand, so that each is known beforehand."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from elys.common.errors import ElysError
from elys.lab.motion import Motion
from elys.lab.observables import divergence_time, errors_of, require_observables, scales_of
from elys.lab.pareto import Judge, _beside
from elys.lab.peers.running import PACKAGES
from elys.lab.reference import Reference
from elys.lab.setting import Setting

TIMES = np.arange(0.0, 4.001, 0.1)
UP = np.array([0.0, 1.0, 0.0])


def motion_of(position, velocity=None, **changes) -> Motion:
    """Bodies of 2 kg and 0.5 m along positions (T, N, 3), in gravity."""
    moments, count = position.shape[:2]
    velocity = np.zeros_like(position) if velocity is None else velocity
    values = {
        "setting": Setting(60, 8, 5),
        "gravity": 9.81,
        "names": tuple(f"Body {n}" for n in range(count)),
        "mass": np.full(count, 2.0),
        "size": np.full(count, 0.5),
        "time": TIMES[:moments],
        "position": position,
        "rotation": np.tile([0.0, 0.0, 0.0, 1.0], (moments, count, 1)),
        "linear_velocity": velocity,
        "angular_velocity": np.zeros_like(position),
        "kinetic": (velocity**2).sum((1, 2)),
        "potential": 2.0 * 9.81 * position[:, :, 1].sum(1),
        "momentum": 2.0 * velocity.sum(1),
        "overlap": np.zeros(moments),
        "overlap_between": ("",) * moments,
        "joint_error": np.zeros(moments),
        "joint": ("",) * moments,
        "first_contacts": {},
        "state_hash": 0,
        "cost": 0.1,
    }
    return Motion(**{**values, **changes})


def standing(count: int = 2) -> np.ndarray:
    return np.tile(np.arange(count)[:, None] * UP, (len(TIMES), 1, 1))


def errors(motion: Motion, reference: Motion) -> dict:
    return {error.name: error for error in errors_of(motion, reference, scales_of(reference))}


def test_a_motion_has_no_error_against_itself():
    motion = motion_of(standing())
    assert all(error.value == 0.0 for error in errors(motion, motion).values())
    assert divergence_time(motion, motion, scales_of(motion)) == math.inf


def test_what_is_typical_of_bodies_at_rest_is_what_lifts_them_by_their_size():
    scales = scales_of(motion_of(standing()))
    assert scales.length == 0.5
    assert scales.energy == pytest.approx(4.0 * 9.81 * 0.5)
    assert scales.momentum == pytest.approx(4.0 * math.sqrt(9.81 * 0.5))
    assert scales.time == pytest.approx(4.0)


def test_a_body_that_sank_is_a_rest_pose_and_an_energy():
    sunk = standing()
    sunk[5:, 1, 1] -= 0.01
    found = errors(motion_of(sunk), motion_of(standing()))
    assert found["rest pose"].value == pytest.approx(0.01)
    assert found["rest pose"].relative == pytest.approx(0.02)
    assert found["rest pose"].culprit == "Body 1"
    assert found["energy"].value == pytest.approx(2.0 * 9.81 * 0.01)
    assert found["energy gain"].value == 0.0


def test_energy_out_of_nothing_is_told_and_what_motors_give_is_not():
    lifted = standing()
    lifted[20:, 0, 1] += 0.1
    found = errors(motion_of(lifted), motion_of(standing()))
    assert found["energy gain"].value == pytest.approx(2.0 * 9.81 * 0.1)
    assert found["energy gain"].time == pytest.approx(2.0)
    assert errors(motion_of(lifted), motion_of(lifted))["energy gain"].value == 0.0


def test_creeping_is_drift_in_the_last_second_alone():
    creeping = standing()
    creeping[:, 0, 0] += 0.002 * TIMES
    found = errors(motion_of(creeping), motion_of(standing()))
    assert found["drift at rest"].value == pytest.approx(0.002, rel=0.11)
    assert found["drift at rest"].culprit == "Body 0"


def test_sliding_where_the_reference_stands_is_a_slip():
    velocity = np.zeros((len(TIMES), 2, 3))
    velocity[:, 1, 0] = 1.0
    found = errors(motion_of(standing(), velocity), motion_of(standing()))
    assert found["stick or slip"].value == 0.5
    assert found["stick or slip"].culprit == "Body 1"
    assert found["settling"].value == pytest.approx(4.0)


def test_overlap_as_it_was_built_is_no_error_and_later_is():
    overlap = np.zeros(len(TIMES))
    overlap[0], overlap[7] = 0.3, 0.004
    between = tuple("A on B" if depth else "" for depth in overlap)
    found = errors(motion_of(standing(), overlap=overlap, overlap_between=between), motion_of(standing()))
    assert (found["overlap"].value, found["overlap"].time) == (0.004, pytest.approx(0.7))
    assert found["overlap"].culprit == "A on B"


def test_a_contact_is_in_time_within_its_tick_and_late_beyond():
    coarse, fine = Setting(10, 8, 5), Setting(1000, 8, 5)
    reference = motion_of(standing(), setting=fine, first_contacts={("A", "B"): 0.301})
    for told, error in ((0.4, 0.0), (0.5, 0.099), (0.2, 0.1)):
        motion = motion_of(standing(), setting=coarse, first_contacts={("A", "B"): told})
        assert errors(motion, reference)["contact timing"].value == pytest.approx(error, abs=2e-3)


def test_contact_timing_of_a_motion_that_tells_no_contacts_is_unknown_and_does_not_count(monkeypatch):
    reference = motion_of(standing(), first_contacts={("A", "B"): 0.3})
    silent = motion_of(standing(), first_contacts=None)
    found = errors(silent, reference)
    assert [name for name, error in found.items() if not error.is_known] == ["contact timing"]
    assert math.isnan(found["contact timing"].value) and not found["contact timing"].is_finite
    assert msgspec.json.decode(msgspec.json.encode(found["contact timing"]))["value"] is None
    judge = Judge(Reference(reference, {}, True), scales_of(reference))
    outcome = judge.outcome(silent)
    assert outcome.unknown == ("contact timing",) and outcome.dominant != "contact timing" and outcome.error == 0.0
    monkeypatch.setitem(PACKAGES, "numpy", "numpy")  # an installed package in the place of an engine
    asked = Judge(judge.reference, judge.scales, only=("contact timing",))
    assert _beside(asked, "numpy", 60, silent).reason == "tells nothing of contact timing"
    beside = _beside(judge, "numpy", 60, silent).outcome
    assert beside is not None and beside.dominant == outcome.dominant


def test_trajectories_part_at_a_twentieth_of_a_body():
    parting = standing()
    parting[:, 1, 2] += 0.02 * TIMES
    reference = motion_of(standing())
    assert divergence_time(motion_of(parting), reference, scales_of(reference)) == pytest.approx(1.3)


def test_a_heap_that_parted_is_judged_by_its_height():
    other = standing()
    other[10:, 0, 0] += 3.0
    other[10:, 1, 1] += 0.02
    found = errors(motion_of(other), motion_of(standing()))
    assert found["rest pose"].value == pytest.approx(0.01)


def test_what_left_the_numbers_is_infinitely_wrong():
    lost = standing()
    lost[30:, 0, 1] = np.nan
    assert all(math.isinf(error.relative) for error in errors(motion_of(lost), motion_of(standing())).values())


def test_an_observable_that_is_none_is_named_with_a_near_one():
    require_observables(["overlap", "rest pose"])
    with pytest.raises(ElysError, match="'overlapp'; did you mean 'overlap'"):
        require_observables(["overlapp"])
