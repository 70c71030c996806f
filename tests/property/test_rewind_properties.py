"""Random commands to a simulation with a flight recorder: every kept instant comes back with the same bits and the same scene."""

from __future__ import annotations

import random

import pytest

from elys.bus import codec
from elys.bus.messages.commands import CommandRequest
from elys.bus.messages.scene import Snapshot
from elys.bus.mirror import SceneMirror
from elys.bus.topics import Encoding
from elys.common.errors import ElysError
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.scene.snapshot import take_snapshot
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from elys.sim_node.systems.apply_commands import apply_command
from tests.property.test_command_fuzz import CommandMaker, load


def everything(simulation: Simulation) -> tuple[int, object, bytes, object]:
    """The hash of what moves, the scene with its settings, and which ids come next.

    Texts by what they say: a command that was refused may have left one in the table of texts, which nobody reads.
    """
    snapshot = snapshot_of(simulation)
    mirror = SceneMirror()
    mirror.apply_snapshot(snapshot)
    return simulation.state_hash(), mirror.in_order(), snapshot.free_entities, snapshot.settings


def snapshot_of(simulation: Simulation) -> Snapshot:
    return take_snapshot(
        simulation.world,
        epoch=1,
        tick=simulation.tick,
        simulation_time=simulation.time,
        sequence=0,
        scene="",
        settings=simulation.settings,
    )


def mirror_of(simulation: Simulation) -> SceneMirror:
    mirror = SceneMirror()
    mirror.apply_snapshot(snapshot_of(simulation))
    return mirror


@pytest.mark.parametrize("seed", range(6))
def test_every_instant_comes_back(seed: int) -> None:
    maker, choose = CommandMaker(seed), random.Random(seed)
    simulation = load("stack")
    recorder = FlightRecorder(simulation)
    seen = [everything(simulation)]
    for _ in range(90):
        done = []
        for command in maker.burst(mirror_of(simulation)) if choose.random() < 0.4 else ():
            try:
                # As it comes from the bus: what cannot be written or read there never reaches a simulation.
                body = codec.encode_body(CommandRequest(origin="", command=command), Encoding.JSON)
                command = codec.decode_body(body, CommandRequest, Encoding.JSON).command
                apply_command(simulation, command)
            except (ElysError, OverflowError, UnicodeEncodeError):
                continue
            done.append(command)
        steps = choose.random() < 0.8
        simulation.step() if steps else simulation.settle()
        simulation.take_changes(), simulation.take_events()
        recorder.note(done, steps=steps, is_told=bool(done), seconds=1.0)
        if len(seen) < recorder.end + 1:
            seen.append(everything(simulation))
    instants = list(range(recorder.end + 1))
    choose.shuffle(instants)
    for instant in [*instants[:25], recorder.end]:
        recorder.go_to(instant)
        assert everything(simulation) == seen[instant], instant
    # And from bytes, in another simulation.
    recorder.go_to(instants[0])
    other = load("stack")
    other.restore(State.from_bytes(simulation.capture().to_bytes()))
    assert everything(other) == seen[instants[0]]
    for _ in range(10):
        simulation.step()
        other.step()
    assert everything(other) == everything(simulation)
