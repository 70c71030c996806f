"""The flight recorder: any kept instant again, exactly, and what is kept within its room."""

from __future__ import annotations

import logging

import msgspec
import pytest

from elys.bus.messages.commands import Command, Despawn, SetComponent, SetSettings, Spawn
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError
from elys.common.scene import EntityRecord
from elys.sim_node import flight_recorder
from elys.sim_node.ecs.world import World
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command
from elys.verbs.scenes import open_scene_or_sample

BOX = EntityRecord(
    name="Late", components={"Transform": {"position": [0.1, 9.0, 0.0]}, "RigidBody": {}, "Collider": {}}
)


class Flight:
    """A simulation with its recorder, and the hash at each instant."""

    def __init__(self, scene: str = "stack", **options: float) -> None:
        assets = AssetStore()
        self.simulation = Simulation.load(open_scene_or_sample(scene, assets), assets)
        self.recorder = FlightRecorder(self.simulation, **options)
        self.hashes = [self.simulation.state_hash()]
        self.seconds = 1.0  # that each beat is said to have taken

    def beat(self, *commands: Command, steps: bool = True) -> list[tuple[int, ...]]:
        made = [apply_command(self.simulation, command) for command in commands]
        self.simulation.step() if steps else self.simulation.settle()
        self.simulation.take_changes(), self.simulation.take_events()
        self.recorder.note(commands, steps=steps, is_told=bool(commands), seconds=self.seconds)
        self.hashes.append(self.simulation.state_hash())
        return made

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.beat()

    def check(self, instant: int) -> None:
        self.recorder.go_to(instant)
        assert self.recorder.position == instant
        assert self.simulation.state_hash() == self.hashes[instant]


def eventful() -> Flight:
    flight = Flight()
    flight.run(70)
    ((late,),) = flight.beat(Spawn(records=(BOX,)), steps=False)
    flight.beat(SetComponent(entity=late, component="RigidBody", values={"mass": 9.0}), steps=False)
    flight.run(65)
    flight.beat(Despawn(entity=late))
    flight.run(30)
    return flight


def test_any_instant_in_any_order():
    flight = eventful()
    assert flight.recorder.keyframe_count == 3  # each second
    for instant in (0, 1, 168, 72, 71, 70, 135, 136, 30, 137, 60, 61, 0, len(flight.hashes) - 1):
        flight.check(instant)
    assert not flight.recorder.is_rewound


def test_going_on_from_the_past_tells_it_again_to_the_end():
    flight = eventful()
    recorder = flight.recorder
    recorder.go_to(69)
    told = []
    while recorder.is_rewound:
        recorder.repeat()
        told.append(recorder.position)
        assert flight.simulation.state_hash() == flight.hashes[recorder.position]
    # Edits made while time stood still come with the tick before them.
    assert told[:3] == [72, 73, 74]
    assert told[-1] == len(flight.hashes) - 1
    flight.beat()
    assert recorder.end == len(flight.hashes) - 1


def test_steps_back_pass_over_edits():
    flight = eventful()
    recorder = flight.recorder
    recorder.go_to(73)
    assert recorder.instant_back(1) == 72
    recorder.go_to(72)
    assert [recorder.instant_back(count) for count in (1, 2, 70, 100, 10**30)] == [69, 68, 0, 0, 0]


def test_instants_by_time_and_tick():
    flight = eventful()
    recorder = flight.recorder
    assert recorder.instant_of_tick(70) == recorder.instant_at(70 / 60) == 72  # with the edits that were made there
    assert recorder.instant_of_tick(69) == recorder.instant_at(69.4 / 60) == 69
    assert recorder.instant_at(-5.0) == recorder.instant_of_tick(0) == 0
    assert recorder.instant_at(1e300) == recorder.end
    with pytest.raises(RequestError, match="tick 5000 is not kept: the flight recorder has ticks 0 to 166"):
        recorder.instant_of_tick(5000)


def test_a_fork_forgets_what_came_after():
    flight = eventful()
    recorder = flight.recorder
    recorder.go_to(100)
    assert recorder.fork() == 167 - 99
    del flight.hashes[101:]
    assert (recorder.end, recorder.is_rewound, recorder.ticks) == (100, False, (0, 98))
    flight.beat(Spawn(records=(BOX,)))
    flight.run(80)
    for instant in (101, 150, 20, 181):
        flight.check(instant)


def test_whether_the_scene_has_to_be_told_anew():
    flight = eventful()
    recorder = flight.recorder
    assert not recorder.go_to(150)
    assert recorder.go_to(100)  # over the end of an entity
    assert not recorder.go_to(80)
    assert recorder.go_to(60)
    assert not recorder.go_to(10)
    assert recorder.go_to(168)


def test_another_tick_rate_in_between():
    flight = Flight()
    flight.run(60)
    settings = msgspec.structs.replace(flight.simulation.settings, tick_rate=120.0)
    flight.beat(SetSettings(settings=settings))
    flight.run(130)
    for instant in (190, 50, 61, 60, 100):
        flight.check(instant)
    assert flight.recorder.instant_at(1.0) == 60
    assert flight.recorder.instant_at(1.5) == 60 + 60


def test_old_ones_go_and_what_is_left_is_exact():
    flight = Flight(seconds=2.0)
    flight.run(400)
    recorder = flight.recorder
    assert 400 / 60 - 2.0 - 2.0 * flight_recorder.SHORTEST <= recorder.start_time <= 400 / 60 - 2.0
    oldest = recorder.instant_of_tick(recorder.ticks[0])
    flight.check(oldest)
    flight.check(oldest + 30)


def test_keyframes_are_thinned_and_the_oldest_go_where_room_is_short():
    wide = Flight()
    wide.run(900)
    alone = wide.simulation.capture().size
    room = alone + (wide.recorder.size - alone) // 2
    narrow = Flight(room=room)
    narrow.run(900)
    recorder = narrow.recorder
    assert recorder.size <= room
    assert 2 <= recorder.keyframe_count < wide.recorder.keyframe_count
    assert recorder.start_time < 10.0
    for instant in (900, recorder.end - 200, recorder.instant_at(recorder.start_time)):
        narrow.check(instant)
    tiny = Flight(room=1)
    tiny.run(200)
    assert tiny.recorder.keyframe_count == 1
    tiny.check(200)


def test_keyframes_wait_where_they_would_cost_too_much(monkeypatch):
    monkeypatch.setattr(flight_recorder, "SHARE", 0.0)
    flight = Flight()
    flight.seconds = 1e-4
    flight.run(int(60 * flight_recorder.LONGEST) + 10)
    assert flight.recorder.keyframe_count == 2
    flight.seconds = 0.02  # to do more than 4 s again would be long to wait
    flight.run(int(flight_recorder.MOST_WORK / 0.02) + 10)
    assert flight.recorder.keyframe_count == 3


def test_where_somebody_looks_keyframes_are_added_if_there_is_room(monkeypatch):
    monkeypatch.setattr(flight_recorder, "SHARE", 0.0)
    flight = Flight()
    flight.seconds = 1e-4
    flight.run(200)
    assert flight.recorder.keyframe_count == 1
    flight.check(150)
    assert [keyframe.instant for keyframe in flight.recorder._keyframes] == [0, 30, 60, 90, 120, 150]
    flight.check(149), flight.check(200), flight.check(61)
    flight.recorder.fork()
    assert [keyframe.instant for keyframe in flight.recorder._keyframes] == [0, 30, 60]
    full = Flight(room=flight.simulation.capture().size)
    full.seconds = 1e-4
    full.run(200)
    full.check(150)
    assert full.recorder.keyframe_count == 1


def test_a_system_that_remembers_is_found_out_and_what_was_kept_counts(caplog):
    flight = Flight()
    pushes = iter(range(10**6))

    def push(world: World) -> None:
        entity = flight.simulation.moving_bodies().entity[:1]
        if len(entity):
            flight.simulation.physics.apply_force(entity, [0.01 * next(pushes), 0.0, 0.0])

    flight.simulation.systems = (push, *flight.simulation.systems)
    flight.run(130)
    with caplog.at_level(logging.WARNING):
        flight.recorder.go_to(0)
        while flight.recorder.position < 65:
            flight.recorder.repeat()
    assert "did not come out as it did" in caplog.text
    flight.recorder.go_to(120)
    flight.check(120)
