"""The whole state of a simulation: kept, put back, and the same bits again."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from elys.bus.messages.commands import Command, Despawn, SetComponent, SetEnabled, SetSettings, Spawn
from elys.common.assets.store import AssetStore
from elys.common.components import Collider, RigidBody, Transform
from elys.common.errors import StateError
from elys.common.scene import EntityRecord
from elys.sim_node.capture import DERIVED, captured
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import Column, State, size_of
from elys.sim_node.systems.apply_commands import apply_command
from elys.verbs.scenes import open_scene_or_sample

BALL = EntityRecord(
    name="Ball",
    components={"Transform": {"position": [0.1, 7.0, 0.2]}, "RigidBody": {}, "Collider": {"shape": "sphere"}},
)


def load(name: str, threads: int = 1) -> Simulation:
    assets = AssetStore()
    return Simulation.load(open_scene_or_sample(name, assets), assets, threads=threads)


def run(simulation: Simulation, ticks: int, edits: dict[int, list[Command]] | None = None) -> list[int]:
    hashes = []
    for tick in range(ticks):
        for command in (edits or {}).get(tick, ()):
            apply_command(simulation, command)
        simulation.step()
        hashes.append(simulation.state_hash())
    return hashes


def edits_of(simulation: Simulation) -> dict[int, list[Command]]:
    """Entities that come, go, change and are switched, and other settings."""
    bodies = simulation.moving_bodies().entity.tolist()
    heavier = simulation.settings
    return {
        3: [Spawn(records=(BALL, BALL))],
        9: [Despawn(entity=bodies[2]), Spawn(records=(BALL,))],
        15: [SetComponent(entity=bodies[1], component="RigidBody", values={"mass": 7.0})],
        20: [SetEnabled(entity=bodies[3], enabled=False)],
        26: [SetSettings(settings=msgspec.structs.replace(heavier, gravity=(1.0, -12.0, 0.0)))],
        31: [SetEnabled(entity=bodies[3], enabled=True)],
    }


@pytest.mark.parametrize("at", [0, 1, 40])
@pytest.mark.parametrize("scene", ["yard", "stack", "bridge"])
def test_what_was_put_back_goes_on_with_the_same_bits(scene, at):
    simulation = load(scene)
    run(simulation, at)
    state = simulation.capture()
    edits = edits_of(simulation)
    first = run(simulation, 50, edits)
    again = []
    for _ in range(2):  # a state can be put back as often as one likes
        simulation.restore(state)
        assert (simulation.tick, simulation.time) == (state.tick, state.time)
        again.append(run(simulation, 50, edits))
    assert again == [first, first]


@pytest.mark.parametrize("scene", ["stack", "bridge"])
def test_another_simulation_with_more_threads_does_the_same_from_bytes(scene):
    simulation = load(scene)
    run(simulation, 30, edits_of(simulation))
    state = State.from_bytes(simulation.capture().to_bytes())
    other = load(scene, threads=2)
    run(other, 7)
    other.restore(state)
    edits = {4: [Spawn(records=(BALL,))]}
    assert run(other, 40, edits) == run(simulation, 40, edits)
    assert other.physics.settings.threads == 2


def test_sleepers_wake_as_they_did():
    simulation = load("stack")
    run(simulation, 240)
    assert (simulation.physics._bodies.rows["asleep"] != 0).any()
    state = simulation.capture()
    edits = {5: [Spawn(records=(BALL,))]}
    first = run(simulation, 120, edits)
    assert len(set(first[:5])) == 1  # all asleep
    simulation.restore(state)
    assert run(simulation, 120, edits) == first


def test_settings_changed_between_ticks_act_in_the_next_one_all_the_same():
    simulation = load("stack")
    run(simulation, 240)
    gravity = msgspec.structs.replace(simulation.settings, gravity=(0.5, -9.81, 0.0))
    apply_command(simulation, SetSettings(settings=gravity))  # wakes all in the next step, and not before
    state = simulation.capture()
    first = run(simulation, 30)
    simulation.restore(State.from_bytes(state.to_bytes()))
    assert run(simulation, 30) == first
    assert len(set(first)) == 30


def test_the_next_entities_get_the_ids_that_they_got():
    simulation = load("yard")
    state = simulation.capture()
    many = Spawn(records=(BALL,) * 40)

    def ids() -> list[int]:
        found = list(apply_command(simulation, many))
        for entity in found[:30]:
            apply_command(simulation, Despawn(entity=entity))
        return found + list(apply_command(simulation, many))

    first = ids()
    texts = simulation.world.strings.texts
    simulation.restore(state)
    assert ids() == first
    assert simulation.world.strings.texts == texts
    with pytest.raises(Exception, match="does not exist"):
        simulation.world.get(first[0], RigidBody)


def test_capturing_changes_nothing_and_what_stays_is_shared():
    one, two = load("stack"), load("stack")
    run(one, 10), run(two, 10)
    first = one.capture()
    one.step(), two.step()
    second = one.capture(first)
    assert run(one, 20) == run(two, 20)
    assert size_of((first, second)) < 0.8 * (first.size + second.size)
    shared = [path for path, value in first.values.items() if type(value) is Column and second.values[path] is value]
    assert "world/hierarchy/parent" in shared
    assert "physics/bodies" not in shared


def test_what_is_in_use_is_not_part_of_a_state():
    simulation = load("stack")
    state = simulation.capture()
    before = {path: value.data for path, value in state.values.items() if type(value) is Column}
    run(simulation, 5, {2: [Spawn(records=(BALL,))]})
    simulation.restore(state)
    run(simulation, 5, {2: [Spawn(records=(BALL,))]})
    assert {path: value.data for path, value in state.values.items() if type(value) is Column} == before


class Odd:
    """Something of which nobody could say how to put it back."""


def test_an_attribute_that_is_new_is_captured_or_refused():
    simulation = load("stack")
    simulation.world.allocator.newcomer = np.arange(3)
    simulation._bodies.another = {1: [2, 3]}
    state = simulation.capture()
    simulation.world.allocator.newcomer[:] = 0
    simulation._bodies.another[1].append(4)
    simulation.restore(state)
    assert simulation.world.allocator.newcomer.tolist() == [0, 1, 2]
    assert simulation._bodies.another == {1: [2, 3]}
    simulation._animations.odd = Odd()
    with pytest.raises(TypeError, match=r"_animations/odd: a .*Odd cannot be part of a state"):
        simulation.capture()


# What the tables of physics hold beside what `PhysicsWorld.snapshot` takes: derived from it, or room that no step reads.
REBUILT = {
    "BodyTable": {"can_lock", "has_fresh", "report", "faulty_room", "_index"},
    "ColliderTable": {"can_bounce", "is_simple", "can_roll"},
    "GeometryStore": set(),
    "ContactStore": {
        *("active_count", "is_changed", "is_outdated", "watched_count", "trigger_count", "active", "fast", "watched"),
        *("triggers", "found", "tree", "_free", "_free_count", "room", "margins", "_sleeping", "_sleeping_count"),
        *("_pairs_found", "_pairs_room", "_entries", "_histogram"),
    },
    "JointTable": {
        *("solver_rows", "broken_room", "unpaired", "links", "_plan", "_is_outdated", "_groups", "_order", "_parts"),
        *("_part_order", "_loads", "_rest", "_turned", "_body_rows"),
    },
    "EventLog": {
        *("_contacts", "_begun", "_ended", "_entered", "_exited"),  # of the last step, which has told them
        *("_begun_room", "_ended_room", "_entered_room", "_exited_room"),
    },
    "Activity": {
        *("_bodies", "_colliders", "_contacts", "is_outdated", "version", "bodies", "body_count", "colliders"),
        *("collider_count", "has_fresh", "moved"),
    },
    "PhysicsWorld": {
        *("named", "_switches", "_room", "_team", "_step", "_measuring", "_query_tree", "_activity"),
    },
}
TAKEN = {
    "BodyTable": {"rows", "poses", "mass", "inertia", "given_inertia", "forces"},
    "ColliderTable": {"rows", "shapes", "proxies", "geometry"},
    "GeometryStore": {"solids", "arrays", "_known"},
    "ContactStore": {"pairs", "manifolds", "touching", "touching_count"},
    "JointTable": {"rows"},
    "EventLog": {"_removed_contacts", "_removed_visits"},
    "Activity": set(),
    "PhysicsWorld": {
        *("_bodies", "_colliders", "_contacts", "_joints", "_events"),
        *("settings", "_step_plan", "_problems", "_broken_joints"),
    },
}


def test_nothing_in_physics_is_forgotten():
    """Whoever gives a table of physics a new attribute says here whether it is state; if so `saved` and `load` take it."""
    physics = load("bridge").physics
    physics.step(1.0 / 60.0)
    tables = (
        physics,
        physics._bodies,
        physics._colliders,
        physics._colliders.geometry,
        physics._contacts,
        physics._joints,
        physics._events,
        physics._activity,
    )
    for table in tables:
        name = type(table).__name__
        assert vars(table).keys() == TAKEN[name] | REBUILT[name], name


def test_what_is_listed_as_derived_is_there():
    simulation = load("bridge")
    world = simulation.world
    moved = (simulation._bodies, simulation._animations, simulation._characters, simulation._cameras)
    parts = (simulation, world, world.hierarchy, world.table(Transform), *moved, simulation._animations.walks)
    assert {type(part).__name__ for part in parts} == set(DERIVED)
    for part in parts:
        assert DERIVED[type(part).__name__] <= vars(part).keys()


def test_an_empty_simulation_and_one_without_the_components_of_another():
    simulation = Simulation()
    state = simulation.capture()
    simulation.world.spawn([Transform(), RigidBody(), Collider()])
    run(simulation, 3)
    simulation.restore(state)
    assert simulation.world.entity_count == 0
    assert simulation.physics.body_count == 0
    assert len(simulation.moving_bodies().entity) == 0
    simulation.step()
    assert simulation.tick == 1


# --- bytes ---------------------------------------------------------------------------------------------------------------


def test_bytes_that_lie_are_refused_with_a_sentence():
    simulation = load("stack")
    data = simulation.capture().to_bytes()
    for wrong, expected in (
        (b"", "does not begin as one"),
        (data[:100], "damaged"),
        (b"x" + data[1:], "does not begin as one"),
        (data[:8] + b"\x09\x00\x00\x00" + data[12:], "version 9"),
        (data[:-1] + bytes([data[-1] ^ 1]), "damaged"),
    ):
        with pytest.raises(StateError, match=expected):
            State.from_bytes(wrong)


def lying(simulation: Simulation, path: str, value: object) -> State:
    values = dict(captured(simulation, {}))
    assert path in values
    values[path] = value
    return State(tick=0, time=0.0, values=values)


def column(state: State, path: str, **fields: object) -> Column:
    array = state.values[path].array()
    for name, value in fields.items():
        (array[name] if array.dtype.names else array)[...] = value
    return Column.of(array)


def test_states_that_contradict_themselves_are_refused_and_nothing_changes():
    simulation = load("bridge")
    run(simulation, 20)
    state = simulation.capture()
    before = simulation.state_hash()
    ids = state.values["world/allocator/ids"]
    for path, value, expected in (
        ("world/allocator/ids", Column.of(ids.array().astype(np.float64)), "laid out otherwise"),
        ("world/allocator/ids", Column.of(ids.array()[:5]), "not equally long"),
        ("world/allocator/count", "many", "is a str, where a int stands"),
        ("world/hierarchy/parent", column(state, "world/hierarchy/parent", all=10**6), "rows that are not there"),
        ("world/_tables/Transform/row_of", column(state, "world/_tables/Transform/row_of", all=99999), "not there"),
        ("physics/colliders", column(state, "physics/colliders", body=-3), "rows that are not there"),
        ("physics/pairs", column(state, "physics/pairs", a=10**6), "rows that are not there"),
        ("physics/bodies", Column.of(np.zeros(3)), "bodies"),
    ):
        with pytest.raises(Exception, match=expected) as caught:
            simulation.restore(lying(simulation, path, value))
        assert type(caught.value).__name__ in ("StateError", "PhysicsError")
        assert simulation.state_hash() == before
    run(simulation, 3)
    lacking = State(tick=0, time=0.0, values={k: v for k, v in state.values.items() if k != "world/allocator/count"})
    with pytest.raises(StateError, match="lacks world/allocator/count"):
        simulation.restore(lacking)
    with pytest.raises(StateError, match="component Teapot"):
        simulation.restore(State(tick=0, time=0.0, values={**state.values, "world/_tables/Teapot/count": 1}))
    with pytest.raises(StateError, match="holds world/novelty"):
        simulation.restore(State(tick=0, time=0.0, values={**state.values, "world/novelty": 1}))
