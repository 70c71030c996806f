"""Reports of plans: the reasons of scenes, figures that make up the tick, and what is saved by what is off."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.assets.store import AssetStore
from elys.common.components import Collider, Joint, RigidBody, Transform
from elys.common.scene import OpenedScene, expand
from elys.lab.plan_report import AFTER_PHYSICS, REST, PlanReport, advance, forcible, kernels_of, report, table_bytes
from elys.samples.registry import FOLDER, SAMPLES
from elys.sim_node.kernel_needs import needed_kernels
from elys.sim_node.physics.plan import SWITCH_FACTS
from elys.sim_node.physics.settings import SWITCHES, PhysicsSettings
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.simulation import Simulation


def opened(name: str, assets: AssetStore, tmp_path) -> OpenedScene:
    document = SAMPLES[name].build()
    records = expand(document, directory=FOLDER, assets=assets)
    return OpenedScene(name=name, path=tmp_path, settings=document.settings, records=records)


@pytest.fixture
def simulated(tmp_path):
    """A sample's simulation at a moment."""

    def make(name: str, moment: float) -> Simulation:
        assets = AssetStore()
        simulation = Simulation.load(opened(name, assets, tmp_path), assets)
        advance(simulation, moment)
        return simulation

    return make


def reasons(found: PlanReport) -> dict[str, tuple[bool, str]]:
    return {stage.name: (stage.is_on, stage.why) for stage in found.stages}


def test_a_report_says_everything_of_a_moment(simulated):
    found = report(simulated("yard", 1.0), seconds=0.25)
    assert (found.scene, found.moment, found.ticks) == ("yard", 1.0, 15)
    assert [stage.name for stage in found.stages] == list(SWITCHES)
    why = reasons(found)
    assert why["polytopes"] == (False, "no shapes but boxes and balls among 214 colliders")
    assert why["joints"] == (False, "no joints") and why["solver"][0] and why["bounces"][0]
    assert all(
        (stage.saving is not None) == (not stage.is_on) for stage in found.stages if stage.name != "shared_solver"
    )


def test_what_is_off_is_proven_harmless_in_this_scene_too(simulated):
    found = report(simulated("yard", 0.6), seconds=0.25)
    exact = [stage for stage in found.stages if stage.saving is not None and stage.proof == "same bits"]
    assert len(exact) >= 5
    assert all(stage.saving.is_same and stage.saving.difference == 0.0 for stage in exact)
    strong = next(stage for stage in found.stages if stage.name == "strong_solver")
    assert not strong.saving.is_same and strong.saving.difference > 0.0
    code = {stage.name: stage.saving.code for stage in exact}
    # Who is told of contacts and shares the work out is remembered in tables; a kernel without branches needs none.
    tables = {stage.name: stage.saving.tables for stage in exact}
    assert tables["rolling"] == tables["polytopes"] == 0
    assert code["joints"] > code["continuous_collision"] > 0 and code["rolling"] == 0


def test_what_sleeps_is_awake_in_the_world_that_sleepers_are_forced_in(simulated):
    found = report(simulated("stack", 2.0), seconds=0.2)
    sleepers = next(stage for stage in found.stages if stage.name == "sleepers")
    assert (sleepers.is_on, sleepers.why) == (False, "10 of 10 dynamic bodies at rest and not stepped")
    assert not sleepers.saving.is_same and 0.0 < sleepers.saving.difference < 1e-3


def test_the_figures_make_up_the_tick(simulated):
    simulation = simulated("pile", 0.5)
    profiles, step = [], simulation.step

    def recorded():
        step()
        profiles.append(dict(simulation.stage_times))

    simulation.step = recorded
    found = report(simulation, seconds=0.5)
    told = sum(stage.time for stage in found.stages) + sum(found.other_stages.values())
    assert told == pytest.approx(found.tick_time, rel=1e-9)
    assert found.other_stages[REST] >= 0.0  # its clock runs around those of the stages
    # The profile of the same ticks says the same, of the whole and of each stage.
    assert len(profiles) == found.ticks
    mean = {name: sum(profile.get(name, 0.0) for profile in profiles) / found.ticks for name in set().union(*profiles)}
    systems = sum(time for name, time in mean.items() if not name.startswith("physics."))
    assert told - found.other_stages[REST] == pytest.approx(systems, rel=0.1)
    for stage in found.stages:
        own = sum(mean.get(f"physics.{name}", 0.0) for name in SWITCH_FACTS[stage.name].stages)
        assert stage.time == pytest.approx(own, rel=0.1)
    for name in ("physics.update_manifolds", "physics.finish_step", "propagate_transforms"):
        assert found.other_stages[name] == pytest.approx(mean[name], rel=0.1)
    assert found.other_stages[AFTER_PHYSICS] > 0.0 and found.other_stages["physics.update_manifolds"] > 0.0


def test_tables_are_counted_once_however_many_views_there_are():
    world = PhysicsWorld(PhysicsSettings())
    before = table_bytes(world)
    world.extra = np.zeros((100, 3))  # 2400 bytes
    world.views = (world.extra[10:], {"column": world.extra[:, 1]}, [np.zeros(5, np.float32)])
    assert table_bytes(world) - before == 2400 + 20


def test_without_a_sample_nothing_is_measured_and_time_stands_still(simulated):
    simulation = simulated("stack", 0.0)
    assert simulation.tick == 1
    found = report(simulation, seconds=0.0)
    assert (simulation.tick, found.ticks, found.tick_time, found.other_stages) == (1, 0, 0.0, {})
    assert all(stage.saving is None and stage.time == 0.0 for stage in found.stages)


def test_the_plan_follows_the_scene(simulated):
    simulation = simulated("stack", 0.5)
    bodies = simulation.physics.bodies
    first, second = (int(entity) for entity in bodies.entity[bodies.motion == 0][:2])
    assert not reasons(report(simulation, seconds=0.0))["joints"][0]
    simulation.world.add(first, Joint(kind="fixed", other=second))
    zone = simulation.world.spawn([Transform(position=(0.0, 1.0, 0.0)), Collider(is_trigger=True)])
    ball = simulation.world.spawn([Transform(position=(0.0, 40.0, 0.0)), RigidBody(), Collider(shape="capsule")])
    simulation.step()
    plan = reasons(report(simulation, seconds=0.0))
    assert plan["joints"] == (True, "1 joint")
    assert plan["polytopes"][0] and plan["triggers"][0]
    simulation.world.despawn(zone)
    simulation.world.despawn(ball)
    simulation.step()
    plan = reasons(report(simulation, seconds=0.0))
    assert not plan["polytopes"][0] and plan["triggers"] == (False, "no triggers")


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_what_a_sample_needs_from_its_file_is_what_its_plan_has_on(name, simulated, tmp_path):
    simulation = simulated(name, 0.2)
    on = [stage.name for stage in simulation.physics.plan() if stage.is_on]
    needs = needed_kernels(opened(name, AssetStore(), tmp_path))
    assert set(kernels_of(on)) <= set(needs)
    assert not set(forcible(simulation)) & set(on)
