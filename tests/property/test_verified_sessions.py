"""Random commands of two people, sensible and absurd, with undo, hands, rewinds and forks: what was recorded comes out equal.

A few sessions in the tests, many in `make soak`.
"""

from __future__ import annotations

import asyncio
import random
from pathlib import Path

import pytest

from elys.bus.following import follow_scene
from elys.bus.messages.commands import (
    Batch,
    Command,
    Edit,
    Grab,
    LoadScene,
    Redo,
    Release,
    Resume,
    Rewind,
    Seek,
    SetPlaying,
    StepTicks,
    Undo,
)
from elys.bus.mirror import SceneMirror
from elys.sim_node.scene.loading import records_of
from elys.sim_node.verification import verify
from tests.property.test_command_fuzz import CommandMaker
from tests.recorded_sessions import Person, Stage, recorded

SESSIONS, SOAK_SESSIONS = 5, 300
ROUNDS, SOAK_ROUNDS = 40, 120


class Crowd:
    """Two people who do anything."""

    def __init__(self, stage: Stage, people: list[Person], mirror: SceneMirror, seed: int) -> None:
        self.stage, self.people, self.mirror = stage, people, mirror
        self.maker, self.random = CommandMaker(seed), random.Random(seed)

    def commands(self) -> list[Command]:
        """What somebody asks for in one tick."""
        choose, tick = self.random, self.stage.simulation.tick
        burst = self.maker.burst(self.mirror)
        edits = [command for command in burst if isinstance(command, Edit)]
        pick = choose.random()
        if pick < 0.35:
            return burst[:4]
        if pick < 0.45:
            return [Batch(edits=tuple(edits[: choose.randrange(1, 4)])), *burst[:1]]
        if pick < 0.65:
            return [choose.choice((Undo(), Undo(force=True), Redo())) for _ in range(choose.randrange(1, 4))]
        if pick < 0.72:
            return [Rewind(tick=max(0, tick - choose.randrange(60))), *burst[: choose.randrange(2)]]
        if pick < 0.76:
            return [Seek(time=choose.random() * self.stage.simulation.time), Resume(), SetPlaying(playing=False)]
        if pick < 0.80:
            return [StepTicks(count=-choose.randrange(1, 30))]
        if pick < 0.95:
            bodies = self.stage.simulation.moving_bodies().entity
            if not len(bodies) or choose.random() < 0.3:
                return [Release()]
            target = (choose.uniform(-3, 3), choose.uniform(0, 6), 0.0)
            return [Grab(entity=int(choose.choice(bodies)), anchor=(0.0, 0.1, 0.0), target=target)]
        if pick < 0.97:
            records = tuple(records_of(self.stage.simulation.world))
            return [LoadScene(name="again", records=records, settings=self.stage.simulation.settings)]
        return burst

    async def act(self) -> None:
        person = self.random.choice(self.people)
        commands = self.commands()
        if self.random.random() < 0.5:
            await person.together(*commands)
        else:
            for command in commands:
                await person.ask(command)
        await self.stage.stands()
        await person.ask(SetPlaying(playing=False))
        if self.random.random() < 0.7:
            await person.ask(StepTicks(count=self.random.randrange(1, 25)))
            await self.stage.stands()


async def session(folder: Path, seed: int, rounds: int) -> Stage:
    keep = 60.0 if seed % 4 else 0.0
    async with recorded(folder, ("stack", "bridge", "yard")[seed % 3], keep=keep) as stage:
        people = [await stage.person("Anna"), await stage.person("Bert")]
        mirror = SceneMirror()
        await follow_scene(people[0].session, mirror)
        crowd = Crowd(stage, people, mirror, seed)
        for _ in range(rounds):
            await crowd.act()
    return stage


@pytest.mark.timeout(36000)
def test_whatever_people_did_comes_out_equal(tmp_path: Path, soak: bool) -> None:
    ticks = 0
    for seed in range(SOAK_SESSIONS if soak else SESSIONS):
        folder = tmp_path / str(seed)
        folder.mkdir()
        stage = asyncio.run(session(folder, seed, SOAK_ROUNDS if soak else ROUNDS))
        for path in (stage.beside, stage.outside):
            verdict = verify(path)
            assert (verdict.cause, verdict.difference, verdict.notes) == ("equal", None, []), (seed, path)
            ticks += verdict.ticks
        stage.beside.unlink()
        stage.outside.unlink()
    assert ticks > 100 * (SOAK_SESSIONS if soak else SESSIONS)
