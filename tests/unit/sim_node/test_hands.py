"""Hands that hold bodies: the spring they are, what they refuse, and that time goes the same way again with them."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from elys.bus import topics
from elys.bus.messages.commands import CommandRecord, CommandRequest, Despawn, Grab, Release
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import EntityError, RequestError
from elys.common.scene import EntityRecord, SceneSettings
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.node import SimulationNode
from elys.sim_node.physics.force_lines import HAND, WEIGHT
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command
from elys.sim_node.systems.publish_state import debug_lines

RECORDS = [
    EntityRecord(
        name="Ball", components={"Transform": {}, "RigidBody": {"mass": 3.0}, "Collider": {"shape": "sphere"}}
    ),
    EntityRecord(name="Wall", components={"Transform": {"position": [9, 0, 0]}, "Collider": {}}),
    EntityRecord(
        name="Lift",
        components={"Transform": {"position": [0, 9, 0]}, "RigidBody": {"motion": "kinematic"}, "Collider": {}},
    ),
]


def weightless() -> tuple[Simulation, list[int]]:
    simulation = Simulation(settings=SceneSettings(gravity=(0.0, 0.0, 0.0)), assets=AssetStore())
    entities = load_records(simulation.world, RECORDS)
    simulation.settle()
    return simulation, [int(entity) for entity in entities]


def place(simulation: Simulation, entity: int) -> np.ndarray:
    bodies = simulation.physics.bodies
    return bodies.position[bodies.entity == entity][0].copy()


def test_a_body_follows_as_a_critically_damped_spring():
    simulation, (ball, *_) = weightless()
    target, stiffness = np.array((1.0, 0.5, -0.25)), 9.0
    apply_command(
        simulation, Grab(entity=ball, anchor=(0, 0, 0), target=tuple(target), stiffness=stiffness, holder="a")
    )
    for _ in range(60):
        simulation.step()
    solved = solve_ivp(
        lambda _, y: (y[1], stiffness * (1 - y[0]) - 2 * stiffness**0.5 * y[1]), (0, 1), (0, 0), rtol=1e-9
    )
    # The force is held over each tick, which shifts it by half of one.
    assert place(simulation, ball) == pytest.approx(target * solved.y[0, -1], rel=0.03)
    apply_command(simulation, Release(holder="a"))
    before = place(simulation, ball)
    simulation.step()
    first = place(simulation, ball) - before
    assert np.linalg.norm(first) > 1e-3  # thrown: it flies on
    simulation.step()
    assert place(simulation, ball) - before == pytest.approx(2.0 * first, rel=1e-3)


def test_a_stiff_hand_at_a_far_point_holds_it_and_adds_no_energy():
    simulation, (ball, *_) = weightless()
    grab = Grab(entity=ball, anchor=(0.0, 0.5, 0.0), target=(0.6, 0.9, 0.3), stiffness=1e6, holder="a")
    apply_command(simulation, grab)
    energies = []
    for tick in range(600):
        simulation.step()
        bodies = simulation.physics.bodies
        row = int(np.flatnonzero(bodies.entity == ball)[0])
        spin, speed = bodies.angular_velocity[row].astype(float), bodies.linear_velocity[row].astype(float)
        energies.append(3.0 / 2.0 * (speed @ speed + 0.4 * 0.25 * (spin @ spin)))
        point = bodies.position[row] + Rotation.from_quat(bodies.rotation[row]).apply((0.0, 0.5, 0.0))
        if tick >= 60:  # it swings about the hand, which does not turn it
            assert point == pytest.approx(grab.target, abs=0.06)
    assert max(energies[120:]) <= 1.02 * max(energies[60:120])


def test_hands_hold_what_forces_move_and_nothing_else():
    simulation, (ball, wall, lift) = weightless()
    for entity in (wall, lift):
        with pytest.raises(RequestError, match="cannot be dragged by a hand"):
            apply_command(simulation, Grab(entity=entity, anchor=(0, 0, 0), target=(0, 0, 0), holder="a"))
    with pytest.raises(EntityError, match="no entity 999"):
        apply_command(simulation, Grab(entity=999, anchor=(0, 0, 0), target=(0, 0, 0), holder="a"))
    with pytest.raises(RequestError, match="must lie within"):
        apply_command(simulation, Grab(entity=ball, anchor=(0, 0, 0), target=(float("nan"), 0, 0), holder="a"))
    with pytest.raises(RequestError, match="above 0, not -1"):
        apply_command(simulation, Grab(entity=ball, anchor=(0, 0, 0), target=(0, 0, 0), stiffness=-1.0, holder="a"))
    apply_command(simulation, Grab(entity=ball, anchor=(0, 0, 0), target=(1, 0, 0), holder="a"))
    apply_command(simulation, Despawn(entity=ball))
    simulation.step()  # let go, and nothing fails
    assert not simulation.hands.holds("a")


def test_the_flight_recorder_drags_again_as_it_was():
    simulation, (ball, *_) = weightless()
    recorder = FlightRecorder(simulation)
    hashes = [simulation.state_hash()]
    for tick in range(40):
        commands = []
        if tick in (3, 9):
            commands = [Grab(entity=ball, anchor=(0.1, 0, 0), target=(0, tick / 3.0, 1), holder="a")]
        if tick == 20:
            commands = [Release(holder="a")]
        for command in commands:
            apply_command(simulation, command)
        simulation.step()
        simulation.take_changes(), simulation.take_events()
        recorder.note(commands, steps=True, is_told=False, seconds=1.0)
        hashes.append(simulation.state_hash())
    for instant in (5, 39, 12, 21, 2, 40):
        recorder.go_to(instant)
        assert simulation.state_hash() == hashes[instant]


def test_a_hand_lets_go_when_who_holds_is_gone():
    async def scenario() -> None:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
        simulation, (ball, *_) = weightless()
        node = SimulationNode(simulation, host, realtime=False)
        running = asyncio.create_task(node.run())
        editor = await Session.join(broker.connect(), kind="editor")
        records: list[CommandRecord] = []
        host.subscribe(topics.COMMANDS, lambda record, _: records.append(record))
        grab = Grab(entity=ball, anchor=(0, 0, 0), target=(1, 0, 0), holder="somebody else")
        reply = await editor.request(topics.COMMAND, CommandRequest(origin=editor.node.id, command=grab), timeout=30.0)
        assert reply.accepted, reply.reason
        assert simulation.hands.holds(editor.node.id)
        await editor.close()
        async with asyncio.timeout(30.0):
            while simulation.hands.holds(editor.node.id):
                await asyncio.sleep(0.001)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        assert [type(record.command) for record in records] == [Grab, Release]
        assert {record.command.holder for record in records} == {editor.node.id}
        await host.close()

    asyncio.run(scenario())


def test_what_a_hand_pulls_with_is_shown_where_it_holds():
    """A ball that hangs still in a hand is pulled by its weight, at the point that is held; let go, by nothing."""
    simulation = Simulation(settings=SceneSettings(), assets=AssetStore())
    ball = int(load_records(simulation.world, RECORDS[:1])[0])
    simulation.settle()
    apply_command(simulation, Grab(entity=ball, anchor=(0.0, 0.25, 0.0), target=(0.0, 3.0, 0.0), holder="a"))
    for _ in range(300):
        simulation.step()
    hand = shown_forces(simulation, HAND)
    ((start, end),), (strength,) = hand
    np.testing.assert_allclose(start, place(simulation, ball) + np.array((0.0, 0.25, 0.0)), atol=1e-4)
    np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), (0.0, 1.0, 0.0), atol=1e-4)
    assert strength == pytest.approx(3.0 * 9.81, rel=1e-3)
    (_, (weight,)) = shown_forces(simulation, WEIGHT)
    assert weight == pytest.approx(3.0 * 9.81)
    apply_command(simulation, Release(holder="a"))
    simulation.step()
    assert not len(shown_forces(simulation, HAND)[1])


def shown_forces(simulation: Simulation, color: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments (L, 2, 3) and strengths (L,) of a colour, as they go over the bus."""
    lines = debug_lines(simulation, "forces", epoch=1)
    meant = np.frombuffer(lines.colors, np.uint8) == color
    return np.frombuffer(lines.positions, "<f4").reshape(-1, 2, 3)[meant], np.frombuffer(lines.values, "<f4")[meant]
