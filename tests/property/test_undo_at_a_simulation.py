"""Random edits of a real simulation, undone to the last one: the state hash comes back, before time has begun and after.

A few sequences in the tests, 500 in `make soak`.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest

from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.components import component_from
from elys.common.scene import EntityRecord, OpenedScene, expand, open_scene, read_scene
from elys.common.scene_writing import format_scene
from elys.editor_node.model import EditorModel
from elys.samples.registry import sample
from elys.sim_node.node import SimulationNode
from elys.sim_node.scene.loading import records_of
from elys.sim_node.simulation import Simulation
from tests.unit.editor_node.random_edits import perform

SEQUENCES, SOAK_SEQUENCES = 8, 500
LENGTH = 14
KINDS = (
    *("rename", "reparent", "place", "enable", "move", "turn", "mass", "add", "remove", "spawn"),
    *("duplicate", "delete", "settings", "undo", "redo", "group", "paste", "lay over", "drop"),
)


@dataclass
class Desk:
    """A simulation and an editor's model in one session, as `perform` takes them."""

    node: SimulationNode
    model: EditorModel

    @property
    def simulation(self) -> Simulation:
        return self.node.simulation

    async def play(self, ticks: int) -> None:
        """Lets time go on so far, and stop again; the editor has heard of it."""
        goal = self.simulation.tick + ticks
        self.model.step(ticks)
        async with asyncio.timeout(60.0):
            while self.simulation.tick < goal or self.model.scene.frame is None or self.model.scene.frame.tick < goal:
                await asyncio.sleep(0.001)

    def state(self) -> tuple[object, ...]:
        """All there is, to the bit and under the same ids."""
        world = self.simulation.world
        return (
            self.simulation.state_hash(),
            world.entities().tolist(),
            [meaning(record) for record in records_of(world)],
            self.simulation.settings,
        )


def meaning(record: EntityRecord) -> tuple[object, ...]:
    components = {name: component_from(name, values) for name, values in record.components.items()}
    return (record.name, record.parent, record.enabled, record.prefab, record.references, components)


def loaded(name: str) -> Simulation:
    assets = AssetStore()
    document = sample(name).build()
    records = expand(document, directory=".", assets=assets)
    opened = OpenedScene(name=name, path=None, settings=document.settings, records=records)  # type: ignore[arg-type]
    return Simulation.load(opened, assets)


@contextlib.asynccontextmanager
async def desk_at(simulation: Simulation) -> AsyncIterator[Desk]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="undo", kind="simulation", epoch=1)
    node = SimulationNode(simulation, host, realtime=False, playing=False)
    serving = asyncio.create_task(node.run())
    await asyncio.sleep(0)
    session = await Session.join(broker.connect(), kind="editor")
    model = EditorModel(session)
    running = asyncio.create_task(model.run())
    try:
        async with asyncio.timeout(20.0):
            while not (model.scene.is_known and model.history.is_attached):
                await asyncio.sleep(0.001)
        yield Desk(node, model)
    finally:
        for task in (running, serving):
            task.cancel()
        await asyncio.gather(running, serving, return_exceptions=True)
        await session.close()
        await host.close()


async def edit_at_random(desk: Desk, chance: random.Random, count: int) -> int:
    """So many edits; how many of them changed something."""
    made = 0
    for _ in range(count):
        action = (chance.choice(KINDS), chance.randrange(1000), chance.randrange(1000), chance.randrange(4))
        done = perform(desk, action)
        if done is not None:
            outcome = await done
            await desk.model.history.settle()  # a group is filled after it was made
            assert outcome is not None and not outcome.refusals, (action, outcome)
            made += 1
    return made


async def undo_all(desk: Desk) -> None:
    while desk.model.history.undo_label:
        outcome = await desk.model.history.undo()
        assert not outcome.refusals, outcome


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("played", [0, 45], ids=["before time began", "after bodies fell"])
def test_undoing_random_edits_gives_the_state_hash_back(played: int, soak: bool) -> None:
    async def campaign() -> None:
        made = 0
        for seed in range(SOAK_SEQUENCES if soak else SEQUENCES):
            chance = random.Random(seed)
            async with desk_at(loaded(chance.choice(("stack", "yard", "bridge")))) as desk:
                if played:
                    await desk.play(played)
                before = desk.state()
                made += await edit_at_random(desk, chance, chance.randrange(1, LENGTH))
                edited = desk.state()
                await undo_all(desk)
                assert desk.state() == before, seed
                while desk.model.history.redo_label:
                    assert (await desk.model.history.redo()).accepted
                redone = desk.state()
                await undo_all(desk)
                assert desk.state() == before, seed
                assert desk.model.file.is_dirty is False
                # What a sequence has undone itself is redone as well; then both ends differ.
                assert redone == edited or "Undo" in str([line.text for line in desk.model.console])
        assert made > 3 * (SOAK_SEQUENCES if soak else SEQUENCES)

    asyncio.run(campaign())


def test_what_was_edited_live_saved_and_opened_again_is_the_same_scene(tmp_path: Path) -> None:
    async def scenario(seed: int) -> None:
        chance = random.Random(seed)
        path = tmp_path / f"{seed}.scene.json"
        async with desk_at(loaded("yard")) as desk:
            await edit_at_random(desk, chance, 10)
            edited = [meaning(record) for record in records_of(desk.simulation.world)]
            fresh = of_records(desk.simulation, records_of(desk.simulation.world))
            await desk.play(30)  # what moves meanwhile is no edit
            await desk.model.save(str(path))
            assets = AssetStore()
            opened = open_scene(path, assets)
            assert [meaning(record) for record in opened.records] == edited
            again = Simulation.load(opened, assets)
            assert again.settings == desk.simulation.settings
            assert again.state_hash() == fresh.state_hash()
            for _ in range(20):
                again.step()
                fresh.step()
            assert again.state_hash() == fresh.state_hash()
            # And into the running session: the same again, under other ids.
            await desk.model.documents.open(path)
            assert [meaning(record) for record in records_of(desk.simulation.world)] == edited
            # What is saved of that is the same document to the last letter, whatever its name.
            again_path = tmp_path / f"{seed}-again.scene.json"
            await desk.model.save(str(again_path))
            first, second = (read_scene(file) for file in (path, again_path))
            assert format_scene(msgspec.structs.replace(second, name=first.name)) == format_scene(first)

    for seed in range(4):
        asyncio.run(scenario(seed))


def of_records(simulation: Simulation, records: list[EntityRecord]) -> Simulation:
    opened = OpenedScene(name="fresh", path=None, settings=simulation.settings, records=records)  # type: ignore[arg-type]
    return Simulation.load(opened, simulation.assets)


def test_a_batch_of_which_one_edit_is_wrong_changes_nothing() -> None:
    """Also not which ids come next, and not what time makes of the scene."""
    from elys.bus.messages.commands import Despawn, Rename, Reparent, SetComponent, SetSettings, Spawn
    from elys.common.errors import ElysError
    from elys.sim_node.systems.apply_edits import apply_edits

    chance = random.Random(5)
    for _ in range(30):
        simulation, untouched = loaded("stack"), loaded("stack")
        for _ in range(chance.choice((0, 20))):
            simulation.step()
            untouched.step()
        world = simulation.world
        everyone = world.entities().tolist()
        box = EntityRecord(name="New", components={"Transform": {"position": [0, 9, 0]}, "RigidBody": {}})
        good = [
            Spawn(records=(box, box), index=1),
            Despawn(entity=chance.choice(everyone)),
            SetSettings(settings=untouched.settings.__class__(tick_rate=90)),
            Reparent(entity=everyone[-1], parent=everyone[0]),
            SetComponent(entity=everyone[-1], component="Transform", values={"position": [3.0, 4.0, 5.0]}),
        ]
        chance.shuffle(good)
        wrong = Rename(entity=2**31 + 5, name="nobody")
        with pytest.raises(ElysError):
            apply_edits(simulation, (*good[: chance.randrange(1, 6)], wrong, *good))
        simulation.settle()
        assert simulation.state_hash() == untouched.state_hash()
        assert simulation.tick == untouched.tick and simulation.settings == untouched.settings
        assert np.array_equal(world.entities(), untouched.world.entities())
        assert list(map(meaning, records_of(world))) == list(map(meaning, records_of(untouched.world)))
        next_ids = [each.world.spawn(name="next") for each in (simulation, untouched)]
        assert next_ids[0] == next_ids[1]
