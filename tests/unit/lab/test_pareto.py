"""Studies: the front, what the reference may decide, a closed form that it must come to, and calibration."""

from __future__ import annotations

import json
import math
from concurrent.futures import Executor, Future

import msgspec
import numpy as np
import pytest

from elys.common.assets.store import AssetStore
from elys.common.scene import SceneSettings, open_scene, read_scene, write_scene
from elys.common.scene_document import EntityNode, SceneDocument
from elys.lab.answers import _worst
from elys.lab.calibrate import CalibrationError, calibrated
from elys.lab.observables import ObservableError
from elys.lab.pareto import Outcome, Study, cheapest, study, with_front
from elys.lab.setting import Setting, common_rate, ladder, setting_of
from elys.verbs import calibrate as calibrate_verb


class Here(Executor):
    """Runs a job where it is asked for."""

    def submit(self, function, /, *arguments, **options):
        future: Future = Future()
        try:
            future.set_result(function(*arguments, **options))
        except Exception as error:
            future.set_exception(error)
        return future


def outcome(cost: float, error: float, rate: int = 60) -> Outcome:
    errors = (ObservableError("overlap", error, "m", error, 0.0),)
    return Outcome(Setting(rate, 8, 5), cost, errors, error, "overlap", None)


def test_the_front_is_what_nothing_beats_in_both():
    marked = with_front([outcome(1.0, 0.5), outcome(2.0, 0.7), outcome(3.0, 0.1), outcome(4.0, 0.1)])
    assert [entry.is_best for entry in marked] == [True, False, True, False]


def test_the_cheapest_within_the_budget_is_chosen():
    outcomes = [outcome(1.0, 0.5, 30), outcome(2.0, 0.01, 60), outcome(3.0, 0.001, 120)]
    assert cheapest(outcomes, 0.02) == Setting(60, 8, 5)
    assert cheapest(outcomes, 1e-5) is None


def test_the_ladder_holds_the_scenes_own_setting_and_shares_ticks():
    settings = SceneSettings(tick_rate=50, substeps=3)
    steps = ladder(settings)
    assert setting_of(settings) in steps and len(set(steps)) == len(steps)
    assert all(step.tick_rate % common_rate(steps) == 0 for step in steps)


@pytest.fixture
def falling(tmp_path):
    """A ball that falls and meets nothing."""
    ball = EntityNode(
        name="Ball",
        components={
            "Transform": {"position": [0.0, 100.0, 0.0]},
            "RigidBody": {"mass": 3.0},
            "Collider": {"shape": "sphere"},
        },
    )
    path = tmp_path / "falling.scene.json"
    write_scene(SceneDocument(name="Falling", entities=[ball]), path)
    return path


def test_free_fall_is_as_the_closed_form_says_at_any_tick(falling):
    assets, motions = AssetStore(), []
    scene = open_scene(falling, assets)
    found = study(scene, assets, Here(), duration=0.5, budget=1e-3, motions=motions)
    assert found.is_converged and found.body_count == 1
    for motion in motions:
        assert motion.position[-1, 0, 1] == pytest.approx(100.0 - 0.125 * 9.81, abs=1e-4)
        assert motion.momentum[-1] == pytest.approx([0.0, -1.5 * 9.81, 0.0], rel=1e-4)
        assert np.ptp(motion.energy) < 1e-3 * 3.0 * 9.81 * 1.25
    assert found.chosen is not None and found.outcome_of(found.chosen) is not None
    assert all(entry.error < 1e-3 and entry.horizon is None for entry in found.outcomes)


def test_a_scene_in_which_nothing_moves_is_told(tmp_path):
    from elys.common.errors import SceneError

    write_scene(
        SceneDocument(name="Still", entities=[EntityNode(name="Rock", components={"Collider": {}})]),
        tmp_path / "s.scene.json",
    )
    scene = open_scene(tmp_path / "s.scene.json", AssetStore())
    with pytest.raises(SceneError, match="nothing in Still can move"):
        study(scene, AssetStore(), Here(), duration=1.0, budget=1e-3)


def made_study(**changes) -> Study:
    outcomes = (outcome(0.001, 5e-3, 30), outcome(0.004, 2e-3, 60), outcome(0.008, 1e-4, 120))
    values = {
        "scene": "Made",
        "duration": 2.0,
        "body_count": 1,
        "scales": (1.0, 1.0, 1.0, 1.0),
        "reference": Setting(480, 8, 5),
        "uncertainty": {"overlap": 0.0},
        "is_converged": True,
        "outcomes": outcomes,
        "chosen": Setting(30, 8, 5),
        "budget": 1e-2,
        "own": Setting(60, 8, 5),
        "only": ("overlap",),
    }
    return Study(**{**values, **changes})


def test_a_setting_that_a_stronger_one_moves_alike_did_as_that_one():
    found = made_study()
    assert found.outcome_of(Setting(60, 8, 3)) == found.outcomes[1]
    assert found.outcome_of(Setting(60, 8, 6)) is None
    assert found.outcome_of(Setting(60, 4, 5)) is None


def test_calibrated_settings_carry_their_evidence():
    settings = calibrated(SceneSettings(gravity=(0.0, -1.0, 0.0)), made_study())
    assert (settings.tick_rate, settings.substeps, settings.gravity) == (30, 8, (0.0, -1.0, 0.0))
    evidence = settings.calibration
    assert evidence is not None
    assert (evidence.cost, evidence.cost_before) == (1.0, 4.0)
    assert (evidence.error, evidence.error_before, evidence.budget) == (5e-3, 2e-3, 1e-2)


def test_an_impossible_budget_names_the_most_exact():
    with pytest.raises(CalibrationError, match=r"120 Hz x 8, has 1\.0e-04, which is overlap"):
        calibrated(SceneSettings(), made_study(chosen=None, budget=1e-6))


def test_a_reference_that_does_not_know_promises_nothing():
    unsure = made_study(uncertainty={"overlap": 0.3})
    with pytest.raises(CalibrationError, match=r"does not agree with itself in overlap \(±3e-01\)"):
        calibrated(SceneSettings(), unsure)


def test_calibrate_writes_the_scene_and_keeps_the_rest(falling, capsys):
    before = read_scene(falling)
    calibrate_verb.calibrate(
        str(falling),
        output=None,
        seconds=0.5,
        error=1e-2,
        only=["energy"],
        keep_tick_rate=True,
        json=True,
        jobs=1,
        cluster="",
    )
    after = read_scene(falling)
    told = json.loads(capsys.readouterr().out)
    assert after.entities == before.entities and after.settings.tick_rate == before.settings.tick_rate
    assert after.settings.calibration == msgspec.convert(told["calibration"], type(after.settings.calibration))
    assert math.isfinite(after.settings.calibration.cost)


@pytest.mark.parametrize("errors", [[math.nan, 1.0], [1.0, math.nan]])
def test_an_answer_that_is_no_number_is_as_wrong_as_can_be(errors):
    assert _worst(errors) == math.inf
