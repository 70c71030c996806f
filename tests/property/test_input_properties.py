"""Random input by several players, rewound at random: the same bits at every instant, and what is down is what a list says."""

from __future__ import annotations

import random

import numpy as np
import pytest

from elys.bus import codec
from elys.bus.messages.commands import CommandRequest, Input
from elys.bus.topics import Encoding
from elys.common.assets.store import AssetStore
from elys.common.input_names import AXES, MOTIONS
from elys.common.scene import EntityRecord
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from elys.sim_node.systems.apply_edits import apply_again

BOUND = ("k, pad_a", "w", "space, +pad_left_x", "wheel_y", "")
MOVES = ("a/d/s/w", "pad_left dead=0.3 curve=0.7, pointer scale=0.2", "")
KEYS = ("w", "a", "s", "d", "space", "mouse_left", "pad_a")
NODES = ("one", "two", "three")
BALLS = [
    EntityRecord(name="Input", components={"InputMap": {"axes": {"lean": "q/e, a/d, pad_right_y curve=1"}}}),
    EntityRecord(name="Ground", components={"Transform": {"scale": [40, 0.2, 40]}, "Collider": {}}),
    *(
        EntityRecord(
            name=f"Ball {number}",
            components={
                "Transform": {"position": [2.0 * number, 0.7, 0]},
                "RigidBody": {},
                "Collider": {"shape": "sphere"},
            },
        )
        for number in range(3)
    ),
]


def game() -> Simulation:
    """Each of three players pushes a ball with all that input can say."""
    simulation = Simulation(assets=AssetStore())
    _, _, *balls = load_records(simulation.world, BALLS)

    def push(world) -> None:
        for player, ball in enumerate(balls, 1):
            does = simulation.inputs[player]
            force = np.array(
                (
                    20.0 * (does.is_down("d") - does.is_down("a")) + does.moved("pointer_x"),
                    200.0 * does.was_pressed("space") - 10.0 * does.was_released("space") + does.moved("wheel_y"),
                    20.0 * does.axis("pad_left_x") + 3.0 * len(does.text) + 5.0 * len(does.held),
                )
            )
            jump, (right, ahead) = does.action("jump"), does.vector("move")
            force += (9.0 * right, 70.0 * jump.was_pressed - 7.0 * jump.was_released, -9.0 * ahead)
            force[1] += 2.0 * jump.is_down + does.axis("lean") + 0.01 * does.vector("look").y
            if force.any():
                simulation.physics.apply_force([int(ball)], force)

    simulation.systems = (push, *simulation.systems)
    simulation.settle()
    return simulation


def some_input(choose: random.Random) -> Input:
    return Input(
        player=choose.randint(1, 3),
        source=choose.choice(NODES),
        lets_go=choose.random() < 0.1,
        changes=tuple((choose.choice(KEYS), choose.random() < 0.6) for _ in range(choose.randint(0, 5))),
        moved={name: choose.uniform(-9, 9) for name in sorted(MOTIONS) if choose.random() < 0.3},
        axes={name: choose.choice((0.0, choose.uniform(-1, 1))) for name in sorted(AXES) if choose.random() < 0.2},
        bindings=choose.choice((None,) * 6 + ({}, {"jump": choose.choice(BOUND), "move": choose.choice(MOVES)})),
        text="x" * choose.choice((0, 0, 0, 3)),
    )


class Keyboard:
    """What should be down, kept as a set for each device: an own and much simpler account."""

    def __init__(self) -> None:
        self.held: dict[tuple[int, str], set[str]] = {}

    def take(self, command: Input) -> None:
        held = self.held.setdefault((command.player, command.source), set())
        if command.lets_go:
            held.clear()
        for name, is_down in command.changes:
            (held.add if is_down else held.discard)(name)

    def of(self, player: int) -> set[str]:
        return set().union(*(held for (whose, _), held in self.held.items() if whose == player))


@pytest.mark.parametrize("seed", range(5))
def test_random_input_comes_out_the_same_after_every_rewind(seed: int) -> None:
    choose = random.Random(seed)
    simulation = game()
    recorder, keyboard = FlightRecorder(simulation), Keyboard()
    hashes, helds = [simulation.state_hash()], [[set(), set(), set()]]
    for _ in range(200):
        done = [some_input(choose) for _ in range(choose.choice((0, 0, 1, 2, 4)))]
        for command in done:
            request = CommandRequest(origin=command.source, command=command)
            heard = codec.decode(codec.encode(request, Encoding.JSON), CommandRequest, Encoding.JSON).command
            assert heard == command
            apply_again(simulation, heard)
            keyboard.take(command)
        if choose.random() < 0.9:
            simulation.step()
            recorder.note(done, steps=True, is_told=False, seconds=0.001)
        elif done:  # while time stands: what was pressed waits for the next tick
            simulation.settle()
            recorder.note(done, steps=False, is_told=False, seconds=0.001)
        else:
            continue
        hashes.append(simulation.state_hash())
        helds.append([keyboard.of(player) for player in (1, 2, 3)])
    assert len(set(hashes)) > 100
    for _ in range(25):
        instant = choose.randrange(recorder.end + 1)
        recorder.go_to(instant)
        assert simulation.state_hash() == hashes[instant]
        assert [set(simulation.inputs[player].held) for player in (1, 2, 3)] == helds[instant]
        if choose.random() < 0.3:  # in another process, from bytes
            other = game()
            other.restore(State.from_bytes(simulation.capture().to_bytes()))
            assert other.inputs._devices == simulation.inputs._devices
            assert other.inputs.actions.saved() == simulation.inputs.actions.saved()
