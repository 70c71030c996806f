"""The tick as a tuple of systems: what it does in which order, and what it says it took."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.components import Collider, RigidBody, Transform, declaration_of
from elys.common.errors import EntityError
from elys.common.scene import SceneSettings
from elys.sim_node.ecs.world import World
from elys.sim_node.physics.kernels.tables import BOX, DYNAMIC, KINEMATIC, SPHERE, STATIC
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems import simulate_physics
from elys.sim_node.timing import StageTimes


@pytest.fixture
def simulation() -> Simulation:
    return Simulation(settings=SceneSettings(gravity=(0.0, -10.0, 0.0), tick_rate=50, substeps=1))


def test_a_tick_is_its_systems_in_order_each_timed(simulation):
    simulation.world.spawn([Transform(position=(0.0, 5.0, 0.0)), RigidBody(), Collider()])
    simulation.step()
    own = [name for name in simulation.stage_times if not name.startswith("physics.")]
    moving = ["follow_changes", "play_animations", "move_characters", "simulate_physics", "aim_cameras"]
    assert own == ["run_scripts", *moving, "propagate_transforms", "update_scripts"]
    parts = sum(time for name, time in simulation.stage_times.items() if name.startswith("physics."))
    assert 0.0 < parts <= simulation.stage_times["simulate_physics"]
    # What is new is looked at once, for whether it was put into something and who holds on to it; nobody does to what falls.
    once = {"physics.find_deep_overlaps", "physics.build_islands", "physics.colour_contacts"}
    names = [name for name in simulation.stage_times if name not in once]
    simulation.step()
    assert (simulation.tick, simulation.time) == (2, pytest.approx(0.04))
    assert list(simulation.stage_times) == names


def test_what_a_system_in_front_records_falls_in_the_same_tick(simulation):
    def rain(world: World) -> None:
        world.commands.spawn([Transform(position=(0.0, 9.0, 0.0)), RigidBody(), Collider()], name="Drop")
        assert not len(world.query(RigidBody))

    simulation.systems = (rain, *simulation.systems)
    simulation.step()
    simulation.systems = simulation.systems[1:]
    drop = simulation.world.hierarchy.find("Drop")
    fallen = 9.0 - 0.5 * 10.0 * 0.02**2
    assert simulation.moving_bodies().entity.tolist() == [drop]
    np.testing.assert_allclose(simulation.moving_bodies().position, [(0.0, fallen, 0.0)], rtol=1e-12)
    assert simulation.world.transforms.world_pose(drop)[0] == pytest.approx((0.0, fallen, 0.0))
    assert [change.spawned for change in simulation.take_changes()] == [(drop,)]


def test_a_system_behind_physics_sees_where_bodies_came_to_be(simulation):
    seen = []

    def look(world: World) -> None:
        seen.append(world.query(Transform, RigidBody).values(Transform, "position")[0, 1])

    simulation.world.spawn([Transform(position=(0.0, 1.0, 0.0)), RigidBody(linear_velocity=(0.0, 5.0, 0.0))])
    simulation.systems = (*simulation.systems, look)
    for _ in range(3):
        simulation.step()
    times = np.array([1, 2, 3]) * 0.02
    np.testing.assert_allclose(seen, 1.0 + 5.0 * times - 5.0 * times**2, rtol=1e-6)


def test_a_system_that_asks_for_the_impossible_is_told(simulation):
    def confused(world: World) -> None:
        world.commands.set_parent(world.spawn(), parent=77)

    simulation.systems = (confused, *simulation.systems)
    with pytest.raises(EntityError, match="77"):
        simulation.step()
    assert simulation.tick == 0 and not len(simulation.world.commands)


def test_settling_follows_edits_and_lets_no_time_pass(simulation):
    body = simulation.world.spawn([Transform(position=(0.0, 1.0, 0.0)), RigidBody(), Collider()])
    simulation.settle()
    assert simulation.tick == 0
    assert simulation.moving_bodies().position.tolist() == [[0.0, 1.0, 0.0]]
    simulation.world.set(body, Transform(position=(3.0, 1.0, 0.0)))
    simulation.settle()
    assert simulation.moving_bodies().position.tolist() == [[3.0, 1.0, 0.0]]


def test_numbers_that_physics_takes_are_the_places_of_the_choices():
    motions, shapes = (
        declaration_of(component).field(name).choices
        for component, name in ((RigidBody, "motion"), (Collider, "shape"))
    )
    assert (motions[DYNAMIC], motions[KINEMATIC], motions[STATIC]) == ("dynamic", "kinematic", "static")
    assert (shapes[BOX], shapes[SPHERE]) == ("box", "sphere") and simulate_physics.STATIC == STATIC


def test_stages_timed_elsewhere_count_and_are_not_counted_twice():
    stages = StageTimes()
    stages.done("before")
    stages.include({"elsewhere": 1000.0})
    stages.done("after")
    assert list(stages.times) == ["before", "elsewhere", "after"]
    assert stages.times["elsewhere"] == 1000.0 and stages.times["before"] + stages.times["after"] <= stages.total
