"""Bodies follow components: what leaves physics is told where it stands, and what physics cannot hold is left out and told."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import numpy as np
import pytest

from elys.bus.messages.scene import ComponentSet
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.components import Collider, RigidBody, Transform
from elys.common.ids import Entity
from elys.common.scene import SceneSettings
from elys.sim_node.node import SimulationNode
from elys.sim_node.scene.delta import scene_changes
from elys.sim_node.simulation import Simulation


@pytest.fixture
def simulation() -> Simulation:
    return Simulation()


@pytest.fixture
def box(simulation: Simulation) -> Entity:
    """A box that has fallen for half a second."""
    rig = simulation.world.spawn([Transform()], name="Rig")
    body = [Transform(position=(0.0, 9.0, 0.0)), RigidBody(), Collider()]
    entity = simulation.world.spawn(body, name="Box", parent=rig)
    for _ in range(30):
        simulation.step()
    simulation.take_changes()
    return entity


def told(simulation: Simulation) -> dict[tuple[int, str], dict[str, object]]:
    """The components that the next delta tells, by entity and name."""
    changes = scene_changes(simulation.world, simulation.take_changes())
    return {(c.entity, c.component): c.values for c in changes if isinstance(c, ComponentSet)}


@pytest.mark.parametrize(
    "stop",
    [
        lambda world, box: world.set_enabled(box, False),
        lambda world, box: world.set_enabled(world.hierarchy.parent_of(box), False),
        lambda world, box: world.remove(box, RigidBody),
        lambda world, box: world.set(box, RigidBody(motion="static")),
    ],
    ids=["disabled", "parent disabled", "no body any more", "static"],
)
def test_who_follows_deltas_hears_where_a_body_has_stopped(simulation, box, stop: Callable[..., None]) -> None:
    (fallen,) = simulation.moving_bodies().position.tolist()
    assert fallen[1] < 8.0
    stop(simulation.world, box)
    simulation.step()
    assert len(simulation.moving_bodies().entity) == 0
    assert told(simulation)[box, "Transform"]["position"] == tuple(fallen)


def test_a_body_that_goes_on_is_not_told_again(simulation, box) -> None:
    simulation.world.set(box, Collider(friction=0.1))
    simulation.step()
    assert told(simulation).keys() == {(box, "Collider")}


def test_a_collider_scaled_to_nothing_still_stops_what_falls_on_it(simulation) -> None:
    simulation.world.spawn([Transform(scale=(50.0, 0.0, 50.0)), Collider()], name="Floor")
    simulation.world.spawn([Transform(position=(0.0, 1.0, 0.0)), RigidBody(), Collider()], name="Box")
    for _ in range(120):
        simulation.step()
    assert simulation.moving_bodies().position[0, 1] == pytest.approx(0.5, abs=0.02)
    assert simulation.take_events() == []


@pytest.mark.parametrize(
    ("component", "back", "sentence"),
    [
        (Transform(position=(0.0, 1e12, 0.0)), Transform(position=(0.0, 1.0, 0.0)), "'Box' is left out of physics"),
        (Transform(scale=(1.0, 1e30, 1.0)), Transform(), "'Box' collides with nothing"),
        (Collider(size=(3e38, 1.0, 1.0)), Collider(), "'Box' collides with nothing"),
        (Collider(offset=(3e38, 1.0, 1.0)), Collider(), "'Box' collides with nothing"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_lies_out_of_reach_is_left_out_told_and_taken_in_again(simulation, box, component, back, sentence) -> None:
    simulation.world.set(box, component)
    simulation.step()
    (event,) = simulation.take_events()
    assert (event.kind, event.entity) == ("physics", box)
    assert sentence in event.values["text"]
    for _ in range(5):
        simulation.step()
    assert simulation.take_events() == []  # it is told once
    simulation.world.set(box, back)
    simulation.step()
    assert simulation.take_events() == []
    moving = simulation.moving_bodies()
    assert moving.entity.tolist() == [box]
    assert np.isfinite(moving.position).all()


def test_a_body_without_a_transform_waits_for_one(simulation, box) -> None:
    simulation.world.remove(box, Transform)
    simulation.step()
    assert [event.entity for event in simulation.take_events()] == [box]
    assert len(simulation.moving_bodies().entity) == 0
    simulation.world.add(box, Transform())
    simulation.step()
    assert simulation.moving_bodies().entity.tolist() == [box]


def test_a_velocity_that_32_bits_cannot_tell_stops_the_body(simulation, box) -> None:
    """A component with an infinite velocity would keep every newcomer out: no snapshot that holds one is taken."""
    simulation.world.set(box, RigidBody(linear_velocity=(3.3e38, 0.0, 0.0)))
    other = simulation.world.spawn([Transform(), RigidBody(gravity_scale=3e38), Collider()])
    for _ in range(10):
        simulation.step()
    assert [event.entity for event in simulation.take_events()] == [box, other]
    assert np.isfinite(simulation.world.table(RigidBody).column("linear_velocity")).all()


def test_one_body_whose_numbers_are_none_does_not_spoil_the_ground(simulation) -> None:
    simulation.world.spawn([Transform(scale=(50.0, 1.0, 50.0)), Collider()], name="Floor")
    places = [(3.0 * x, 1.2, 0.0) for x in range(5)]
    boxes = [simulation.world.spawn([Transform(position=place), RigidBody(), Collider()]) for place in places]
    simulation.step()
    simulation.physics._bodies.rows["velocity"][0] = np.nan  # as contacts with a body out of its senses leave it
    for _ in range(60):
        simulation.step()
    moving = simulation.moving_bodies()
    assert moving.entity.tolist() == boxes
    assert moving.position[:, 1] == pytest.approx([1.0] * 5, abs=0.02)


def test_locked_axes_and_rolling_friction_reach_physics(simulation) -> None:
    ground = [Transform(position=(0.0, -0.5, 0.0)), Collider(size=(100.0, 1.0, 100.0))]
    simulation.world.spawn(ground)
    hung = RigidBody(lock_move_y=True, lock_turn_x=True, lock_turn_z=True, angular_velocity=(1.0, 2.0, 3.0))
    ball = RigidBody(linear_velocity=(2.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, -4.0))
    lamp = simulation.world.spawn([Transform(position=(0.0, 5.0, 0.0)), hung, Collider()])
    rolling = Collider(shape="sphere", rolling_friction=0.01)
    rolled = simulation.world.spawn([Transform(position=(9.0, 0.5, 0.0)), ball, rolling])
    for _ in range(60):
        simulation.step()
    assert simulation.world.get(lamp, Transform).position == (0.0, 5.0, 0.0)
    assert simulation.world.get(lamp, RigidBody).angular_velocity == (0.0, 2.0, 0.0)
    slowed = 0.01 * 9.81 / 0.5 * 5.0 / 7.0
    assert simulation.world.get(rolled, RigidBody).linear_velocity[0] == pytest.approx(2.0 - slowed, rel=1e-3)


@pytest.mark.parametrize("choice", ["continue", "pause"])
def test_a_problem_stops_time_if_that_was_chosen(choice) -> None:
    async def run() -> tuple[bool, int]:
        simulation = Simulation(settings=SceneSettings(on_problem=choice))
        simulation.world.spawn([Transform(), Collider()])
        simulation.world.spawn([Transform(position=(0.1, 0.2, 0.0)), RigidBody(), Collider()])
        session = await Session.host(LoopbackBroker().listen(), name="it", kind="simulation", epoch=1)
        node = SimulationNode(simulation, session, playing=True)
        for _ in range(3):
            if node.playing:
                node.tick()
        await session.close()
        return node.playing, node.steps_done

    assert asyncio.run(run()) == ((True, 3) if choice == "continue" else (False, 1))
