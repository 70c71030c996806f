"""Many edits in one command against the same edits one by one: one world comes of it, and the way back leads to the first."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.bus.messages.commands import Despawn, Edit, Rename, Reparent, SetComponent, Spawn
from elys.bus.messages.scene import SceneDelta
from elys.bus.mirror import SceneMirror
from elys.common.errors import ElysError
from elys.common.scene import EntityRecord, SceneSettings
from elys.sim_node.scene.delta import scene_changes
from elys.sim_node.scene.loading import load_records, records_of
from elys.sim_node.scene.sibling_rows import BLOCK, SiblingRow
from elys.sim_node.scene.snapshot import take_snapshot
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_edits import apply_edits

COUNT = 60
KINDS = ("despawn", "spawn", "come back", "reparent", "reorder", "set")


def forest(chance: random.Random) -> Simulation:
    """Entities under one another at random, one in three a body, some joined to others; places of former ones rest."""
    simulation = Simulation(settings=SceneSettings())
    records = []
    for number in range(COUNT):
        components: dict[str, dict[str, object]] = {}
        if chance.random() < 0.9:
            place = [round(chance.uniform(-50.0, 50.0), 2) for _ in range(3)]
            turn = chance.choice(([0.0, 0.0, 0.0, 1.0], [0.0, 0.6, 0.0, 0.8]))
            scale = chance.choice(([1.0, 1.0, 1.0], [2.0, 1.0, -0.5], [0.0, 1.0, 1.0]))
            components["Transform"] = {"position": place, "rotation": turn, "scale": scale}
        if chance.random() < 0.3:
            components |= {"RigidBody": {"mass": 2.0}, "Collider": {"shape": "sphere"}}
        parent = chance.randrange(-1, number) if chance.random() < 0.6 else -1
        references = {}
        if chance.random() < 0.2:
            components["Joint"] = {"kind": "ball", "fit": False}  # fitting is what physics writes
            references = {"Joint.other": chance.randrange(COUNT)}
        records.append(
            EntityRecord(
                name=f"E {number}",
                parent=parent,
                enabled=chance.random() < 0.9,
                components=components,
                prefab="house" if chance.random() < 0.1 else "",
                references=references,
            )
        )
    load_records(simulation.world, records)
    for entity in chance.sample(simulation.world.entities().tolist(), 4):
        if simulation.world.is_alive(entity):
            simulation.world.despawn(entity)
    simulation.settle()
    simulation.take_changes()
    return simulation


def edits_at_random(chance: random.Random, simulation: Simulation) -> list[Edit]:
    """Some runs; an edit of one may be about what another has ended."""
    world = simulation.world
    everyone = world.entities().tolist()
    edits: list[Edit] = []
    for _ in range(chance.randrange(1, 4)):
        some = chance.sample(everyone, min(len(everyone), chance.randrange(1, 9)))
        match chance.choice(KINDS):
            case "despawn":
                edits += [Despawn(entity=entity) for entity in some]
            case "come back":
                roots = [entity for entity in some if not world.hierarchy.parent_of(entity)]
                done = apply_edits(simulation, tuple(Despawn(entity=entity) for entity in roots))
                apply_edits(simulation, done.inverse)
                edits += [Despawn(entity=entity) for entity in roots] + list(done.inverse)
            case "spawn":
                for entity in some:
                    count = chance.randrange(1, 4)
                    records = tuple(
                        EntityRecord(name=f"N {n}", parent=chance.randrange(-1, n), components={"Transform": {}})
                        for n in range(count)
                    )
                    parent = chance.choice((0, entity))
                    edits.append(Spawn(records=records, parent=parent, index=chance.choice((-1, 0, 2, 500))))
            case "reparent":
                target = chance.choice((0, *everyone))
                keeps = chance.random() < 0.7
                edits += [
                    Reparent(entity=entity, parent=target, index=chance.choice((-1, 0, 3)), keep_world_pose=keeps)
                    for entity in some
                ]
            case "reorder":
                edits += [
                    Reparent(entity=entity, parent=world.hierarchy.parent_of(entity), index=chance.randrange(12))
                    for entity in some
                ]
            case "set":
                edits += [
                    SetComponent(entity=e, component="Transform", values={"position": [float(n), 2.5, 0.1]})
                    for n, e in enumerate(some)
                    if world.has(e, "Transform")
                ]
    return edits


def state(simulation: Simulation) -> tuple[object, ...]:
    simulation.settle()
    world = simulation.world
    return (
        world.entities().tolist(),
        records_of(world),
        world.transforms.world_affines(world.entities()).tobytes(),
        world.allocator.free_ids().tolist(),
    )


def one_by_one(simulation: Simulation, edits: list[Edit]) -> tuple[list[int], list[Edit]]:
    entities: list[int] = []
    back: list[Edit] = []
    for edit in edits:
        done = apply_edits(simulation, (edit,))
        entities += done.entities
        back[:0] = done.inverse
    return entities, back


@pytest.mark.parametrize("part", range(6))
def test_runs_do_what_their_edits_do_one_by_one(part: int) -> None:
    made = 0
    for seed in range(40):
        chance = random.Random(1000 * part + seed)
        simulation, other = forest(random.Random(seed)), forest(random.Random(seed))
        edits = edits_at_random(chance, simulation)
        # What "come back" has tried out is done in both: the places of who ended rest in the order of their ends.
        other.restore(simulation.capture())
        before = state(simulation)
        try:
            entities, back = one_by_one(other, edits)
        except ElysError as refused:
            with pytest.raises(type(refused)) as told:
                apply_edits(simulation, tuple(edits))
            assert str(told.value) == str(refused)
            assert state(simulation) == before
            continue
        made += 1
        mirror = SceneMirror()
        mirror.apply_snapshot(snapshot_of(simulation))
        done = apply_edits(simulation, tuple(edits))
        assert list(done.entities) == entities
        after = state(simulation)
        assert after == state(other)
        follow(mirror, simulation)
        apply_edits(simulation, done.inverse)
        assert state(simulation)[:3] == before[:3]
        one_by_one(other, back)
        assert state(other)[:3] == before[:3]
    assert made > 10


def snapshot_of(simulation: Simulation, *, sequence: int = 0):  # type: ignore[no-untyped-def]
    return take_snapshot(
        simulation.world,
        epoch=1,
        tick=0,
        simulation_time=0.0,
        sequence=sequence,
        scene="",
        settings=simulation.settings,
    )


def follow(mirror: SceneMirror, simulation: Simulation) -> None:
    """Who only hears of the changes has the same tree."""
    changes = scene_changes(simulation.world, simulation.take_changes())
    mirror.apply_delta(SceneDelta(epoch=1, sequence=1, tick=0, changes=changes))
    fresh = SceneMirror()
    fresh.apply_snapshot(snapshot_of(simulation, sequence=1))
    told = [(e.id, e.name, e.parent, e.enabled, e.components) for e in mirror.in_order()]
    assert told == [(e.id, e.name, e.parent, e.enabled, e.components) for e in fresh.in_order()]


@given(
    count=st.integers(0, 3 * BLOCK),
    steps=st.lists(st.tuples(st.integers(0, 10_000), st.integers(-1, 4 * BLOCK)), max_size=60),
    growth=st.integers(0, 3 * BLOCK),
)
def test_a_row_is_a_list(count: int, steps: list[tuple[int, int]], growth: int) -> None:
    row, plain = SiblingRow(range(count)), list(range(count))
    put: Callable[[int, int], None] = lambda place, index: plain.insert(len(plain) if index < 0 else index, place)  # noqa: E731
    for new in range(growth):
        row.put(100_000 + new, 1)
        put(100_000 + new, 1)
    for which, index in steps:
        if plain:
            place = plain[which % len(plain)]
            assert row.take(place) == plain.index(place)
            plain.remove(place)
            put(place, index)
            assert row.put(place, index) == plain.index(place)
    assert row.places() == plain


def test_what_names_nobody_is_refused_in_a_run_as_alone() -> None:
    simulation = forest(random.Random(3))
    good = simulation.world.entities()[:8].tolist()
    before = state(simulation)
    for wrong in (0, -1, 2**31 + 7, 2**32, 10**30, good[3] ^ (1 << 26)):
        for make in (
            lambda entity: Despawn(entity=entity),
            lambda entity: Reparent(entity=entity, parent=0),
            lambda entity: SetComponent(entity=entity, component="Transform", values={"position": [0.0, 0.0, 0.0]}),
            lambda entity: Spawn(records=(EntityRecord(name="x"),), parent=entity),
        ):
            if wrong == 0 and isinstance(make(0), Spawn):
                continue
            roots = [e for e in good if simulation.world.has(e, "Transform")]
            edits = [make(entity) for entity in (*roots, wrong)]
            with pytest.raises(ElysError):
                apply_edits(simulation, (*edits, Rename(entity=good[0], name="y")))
            assert state(simulation) == before
    assert np.array_equal(simulation.world.entities()[:8], good)
