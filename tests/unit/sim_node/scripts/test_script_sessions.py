"""Sessions with scripts that wait and are told events by others: recorded, verified, wound back and forked."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

from elys.bus.codec import decode_body
from elys.bus.messages.commands import CommandReply, Rewind, Tell
from elys.bus.messages.session import EventBatch
from elys.bus.recording import Recording
from elys.bus.topics import EVENTS
from elys.sim_node.verification import verify
from elys.verbs.fork import opened_at
from tests.recorded_sessions import Stage, recorded
from tests.unit.sim_node.scripts.conftest import HEAD
from tests.unit.verbs.test_fork_verb import forked, frames_of

SCRIPT = """
import msgspec
class Pushed(msgspec.Struct):
    by: float
    left: tuple[int, ...] = ()

class Wanders(Behaviour):
    async def start(self):
        self.begin(self.listen())
        side, goal = 1.0, self.entity.position
        for lap in range(100):
            goal = goal + (side * (1.0 + self.random.random()), 0, 0)
            await self.entity.move_to(goal, duration=0.4)
            await seconds(0.15)
            side = -side

    async def listen(self):
        number = 0
        while True:
            told = await event(Pushed)
            number += 1
            self.world.emit("was_pushed", number=number)
            await self.entity.move_to(self.entity.position + (0, told.by, 0), duration=0.3)
"""
ENTITY = {
    "Transform": {},
    "RigidBody": {"motion": "kinematic"},
    "Collider": {},
    "Script": {"source": "wanders.py#Wanders"},
}
BALL = {"Transform": {"position": [0.0, 2.0, 0.0]}, "RigidBody": {}, "Collider": {"shape": "sphere"}}


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("ELYS_TRUST_SCRIPTS", "1")
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "wanders.py").write_text(HEAD + SCRIPT)
    entities = [{"name": "Plate", "components": ENTITY}, {"name": "Ball", "components": BALL}]
    (tmp_path / "w.scene.json").write_text(json.dumps({"elys_scene": 1, "entities": entities}))
    return str(tmp_path / "w.scene.json")


async def pushes(stage: Stage) -> None:
    """Somebody pushes by events, rightly and wrongly, while time goes on, stands, and was wound back."""
    anna = await stage.person("Anna")
    plate = stage.named("Plate")
    await anna.step(40)
    await anna.do(Tell(kind="pushed", values={"by": 0.5}))
    await anna.step(30)
    wrong = await anna.ask(Tell(kind="pushed", values={"by": "far"}))
    assert isinstance(wrong, CommandReply) and not wrong.accepted
    assert wrong.reason == "Pushed.by (event 'pushed'): expected float, got str"
    await anna.do(Tell(kind="pushed", entity=plate, values={"by": -0.25, "left": [1, 2]}))
    await anna.do(Tell(kind="nobody_hears", values={"why": "not"}))
    await anna.step(50)
    await anna.do(Rewind(tick=90))
    past = await anna.ask(Tell(kind="pushed", values={"by": 1.0}))
    assert isinstance(past, CommandReply) and not past.accepted and "this is the past" in past.reason
    await anna.step(60)


def record(folder: Path, scene: str) -> tuple[Path, Path]:
    async def session() -> Stage:
        async with recorded(folder, scene) as stage:
            await pushes(stage)
        return stage

    stage = asyncio.run(session())
    return stage.beside, stage.outside


def test_what_scripts_are_told_is_recorded_and_comes_out_equal(tmp_path: Path, scene: str) -> None:
    for path in record(tmp_path, scene):
        verdict = verify(path)
        assert (verdict.cause, verdict.difference, verdict.notes) == ("equal", None, []), verdict
        assert verdict.ticks > 100
    with Recording(tmp_path / "beside.mcap") as recording:
        told = events_of(recording)
    assert told.count("pushed") == 2 and told.count("was_pushed") == 2 and told.count("nobody_hears") == 1


def events_of(recording: Recording) -> list[str]:
    messages = recording.reader.messages([EVENTS.name])
    batches = [decode_body(message.body, EventBatch, EVENTS.encoding) for message in messages]
    return [event.kind for batch in batches for event in batch.events]


@pytest.mark.parametrize("at", [0.3, 0.9, 1.25])
def test_a_fork_goes_on_in_the_middle_of_what_is_awaited(tmp_path: Path, scene: str, at: float) -> None:
    source, _ = record(tmp_path, scene)
    simulation, _ = opened_at(source, at)
    waiting = [task for task in simulation.scripts.tasks() if task.wait is not None]
    assert len(waiting) == 2  # one walks, one listens
    target = forked(source, tmp_path / "g.mcap", at)
    assert verify(target).cause == "equal"
    with Recording(target) as fork:
        since = float(fork.time[0])
    expected = frames_of(source, since)
    assert len(expected) > 20 and frames_of(target, since) == expected
