"""The bench of rigid bodies: engines get the scene they were told, and its verdicts are strict."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from elys.lab.peers.mujoco import MuJoCo
from elys.lab.peers.rapier import Rapier
from elys.samples.rigid_cases import BOX, DYNAMIC, RIGID_CASES, SPHERE, STATIC, RigidScene
from elys.samples.rigid_cases.scene import bodies, turn_about_z
from tests.benchmarks import rigid_bodies
from tests.benchmarks.rigid_accuracy import AccuracyRow
from tests.benchmarks.rigid_engines import Elys, record
from tests.benchmarks.rigid_services import ServiceRow, growth
from tests.benchmarks.rigid_speed import SpeedRow, step_in_turns


@pytest.fixture(params=[Elys, Rapier])
def engine(request):
    if request.param is Rapier:
        pytest.importorskip("rapier3d", reason="the peers are an extra")
    return request.param


@pytest.fixture(params=[Elys, Rapier, MuJoCo])
def any_engine(request):
    packages = {Rapier: "rapier3d", MuJoCo: "mujoco"}
    if request.param in packages:
        pytest.importorskip(packages[request.param], reason="the peers are an extra")
    return request.param


def spinning_pair(**changes):
    """Two bodies in weightlessness, each column with a value of its own."""
    columns = {
        "shape": [BOX, SPHERE],
        "size": (1.0, 2.0, 3.0),
        "rotation": [turn_about_z(0.3), (0.0, 0.0, 0.0, 1.0)],
        "linear_velocity": [(1.0, 2.0, 3.0), (-1.0, 0.5, 0.0)],
        "angular_velocity": [(0.0, 0.0, 0.6), (0.4, 0.5, 0.6)],
        "mass": [2.0, 5.0],
    } | changes
    return RigidScene(bodies([(0.0, 5.0, 0.0), (10.0, 0.0, 1.0)], **columns), (0.0, 0.0, 0.0))


def test_an_engine_starts_as_it_was_told(any_engine):
    scene = spinning_pair()
    frame = any_engine(scene).frame()
    for name in frame._fields:
        np.testing.assert_allclose(getattr(frame, name), getattr(scene.bodies, name), atol=1e-6)


def test_an_engine_steps_by_a_sixtieth(any_engine):
    scene = spinning_pair()
    trajectory, times = record(any_engine(scene), 60, stride=20)
    np.testing.assert_allclose(trajectory.time, [0.0, 1 / 3, 2 / 3, 1.0])
    assert times.shape == (60,)
    assert (times > 0.0).all()
    start, velocity = scene.bodies.position, scene.bodies.linear_velocity
    np.testing.assert_allclose(trajectory.position[-1], start + velocity, atol=1e-4)
    np.testing.assert_allclose(trajectory.rotation[-1, 0], turn_about_z(0.9), atol=1e-3)


def test_an_engine_gives_bodies_the_mass_and_bounce_they_have(engine):
    """A ball of 3 kg against one of 1 kg at rest, e = 1: v1 = (m1 - m2) / (m1 + m2) v, v2 = 2 m1 / (m1 + m2) v."""
    scene = spinning_pair(
        shape=SPHERE, angular_velocity=0.0, linear_velocity=[(1, 0, 0), (0, 0, 0)], mass=[3, 1], restitution=1.0
    )
    position = np.array([[0.0, 0.0, 0.0], [1.5, 0.0, 0.0]])
    scene = scene._replace(bodies=scene.bodies._replace(position=position))
    trajectory, _ = record(engine(scene), 60)
    np.testing.assert_allclose(trajectory.linear_velocity[-1, :, 0], [0.5, 1.5], atol=0.02)


def test_static_bodies_stay_and_bodies_come_and_go(engine):
    scene = spinning_pair(motion=[STATIC, DYNAMIC], linear_velocity=0.0, angular_velocity=0.0)
    world = engine(scene._replace(gravity=(0.0, -10.0, 0.0)))
    world.add(bodies([(30.0, 0.0, 0.0), (40.0, 0.0, 0.0)]))
    for _ in range(30):
        world.step()
    height = world.frame().position[:, 1]
    np.testing.assert_allclose(height, [5.0, -1.25, -1.25, -1.25], atol=0.1)
    world.remove_last(2)
    world.step()
    assert world.frame().position.shape == (2, 3)


def test_rays_are_counted_where_they_hit(engine):
    world = engine(spinning_pair(rotation=(0.0, 0.0, 0.0, 1.0)))
    world.step()
    origins = np.array([[0.0, 20.0, 0.0], [10.0, 20.0, 1.0], [4.0, 20.0, 0.0]])
    assert world.cast_rays(origins, np.tile([0.0, -1.0, 0.0], (3, 1))) == 2


def test_every_step_is_taken_though_the_last_turn_is_short(engine):
    times = step_in_turns([engine(spinning_pair())], 13)
    assert times[engine.label].shape == (13, 2)


def speed_row(step, quiet, *, crowd="pile-1000"):
    step_ms, quiet_ms = ({"ELYS": ours, "Rapier": theirs} for ours, theirs in (step, quiet))
    nothing = {"ELYS": 0.0, "Rapier": 0.0}
    return SpeedRow(crowd, crowd, "settled", 0.5, step_ms, quiet_ms, nothing, nothing, {"ELYS": 0, "Rapier": 0}, {})


@pytest.mark.parametrize(
    ("step", "quiet", "is_met"),
    [((1.0, 2.0), (0.9, 1.8), True), ((1.0, 2.0), (0.9, 1.7), False), ((1.1, 2.0), (0.9, 1.8), False)],
)
def test_speed_is_reached_in_the_median_and_when_it_is_quiet(step, quiet, is_met):
    assert speed_row(step, quiet).is_met is is_met


def test_growth_is_taken_a_body():
    rows = [speed_row((9, 9), (1.0, 2.0)), speed_row((9, 9), (12.0, 15.0), crowd="pile-10000")]
    (row,) = growth(rows)
    assert row.figures == pytest.approx({"ELYS": 1.2, "Rapier": 0.75})
    assert row.is_met


@pytest.mark.parametrize("error", [math.nan, math.inf, 0.02])
def test_what_is_not_a_number_is_a_miss(error):
    assert not AccuracyRow("case", "measure", "m", 0.01, {"ELYS": error}, {"ELYS": 1.0}).is_met
    assert not ServiceRow("rays", "million", {"ELYS": -error}, 2.0, more_is_better=True).is_met
    assert not ServiceRow("rays", "million", {}, 2.0, more_is_better=True).is_met


def test_one_case_is_measured_shown_and_written(tmp_path, capsys):
    path = tmp_path / "figures.json"
    rigid_bodies.main(["--case", "bullet-wall", "--quick", "--json", str(path)])
    assert "| bullet-wall | passed [of 16] |" in capsys.readouterr().out
    facts = json.loads(path.read_text())
    assert facts["quick"] is True
    assert [row["case"] for row in facts["accuracy"]] == ["bullet-wall"]
    assert set(facts["versions"]) >= {"elys"}


def test_a_case_that_is_none_is_refused_by_name(capsys):
    with pytest.raises(SystemExit):
        rigid_bodies.main(["--case", "stack-31"])
    assert "stack-31" in capsys.readouterr().err


def test_names_of_cases_and_crowds_differ():
    names = [*RIGID_CASES, *rigid_bodies.CROWDS, *rigid_bodies.SERVICES]
    assert len(set(names)) == len(names)
