"""How fast a session is verified: ten minutes of 1000 bodies with edits, scripts and a player's keys."""

from __future__ import annotations

import asyncio
import logging
import sys
import tempfile
import time
from pathlib import Path

from elys.bus import topics
from elys.bus.messages.commands import Command, Despawn, Grab, Input, Redo, Release, SetComponent, Spawn, Undo
from elys.common.scene import EntityRecord
from elys.common.scene_writing import write_scene
from elys.common.trust import trust_everything
from elys.samples.pile import pile
from elys.sim_node.verification import verify
from tests.recorded_sessions import Person, Stage, recorded

SCRIPTED = 50  # bodies with a script
JUMPS = """
from elys.script import Behaviour, seconds

class Jumps(Behaviour):
    height: float = 1.0

    def start(self):
        self.wander()

    async def wander(self):
        while True:
            await seconds(self.random.uniform(0.5, 3.0))
            self.entity.apply_impulse((0.0, 20.0 * self.height, 0.0))

    def on_input(self, player):
        if self.world.input(player).action("jump").was_pressed:
            self.entity.apply_impulse((0.0, 0.0, 30.0))
"""
RATE = 60
EVERY = 5  # [s] of simulation between two times that somebody does something


async def session(folder: Path, count: int, seconds: int) -> Path:
    """A pile into which somebody throws, which he drags, edits, and winds back, and of which some things jump."""
    scene = folder / "pile.scene.json"
    (folder / "jumps.py").write_text(JUMPS)
    document = pile(count)
    for node in document.entities[-1].children[:SCRIPTED]:
        node.components["Script"] = {"source": "jumps.py#Jumps"}
    write_scene(document, scene)
    async with recorded(folder, str(scene), outside=False) as stage:
        person = await stage.person("Anna")
        for number in range(seconds // EVERY):
            await act(stage, person, number)
            key = Input(player=1, changes=(("space", True), ("space", False)))
            person.session.publish(topics.INPUT, key, key=person.session.node.id)
            await person.step(EVERY * RATE)
    return stage.beside


async def act(stage: Stage, person: Person, number: int) -> None:
    """Something else each time."""
    bodies = stage.simulation.moving_bodies().entity
    body = int(bodies[number * 37 % len(bodies)])
    place = {"position": [0.0, 12.0, 0.0]}
    commands: tuple[Command, ...]
    match number % 4:
        case 0:
            components = {"Transform": place, "RigidBody": {"mass": 30.0, "linear_velocity": [0.0, -20.0, 0.0]}}
            commands = (Spawn(records=(EntityRecord(name="Thrown", components={**components, "Collider": {}}),)),)
        case 1:
            moved = SetComponent(entity=body, component="Transform", values=place)
            commands = (moved, Undo(), Redo())
        case 2:
            commands = (Grab(entity=body, anchor=(0.0, 0.0, 0.0), target=(3.0, 6.0, 0.0)),)
        case _:
            commands = (Release(), Despawn(entity=body))
    await person.do(*commands)


def verifying_rows(folder: Path, *, count: int = 1000, seconds: int = 600) -> list[tuple[str, str]]:
    """Rows about a session of so many bodies and so long [s]. Raises RuntimeError where it does not come out the same."""
    trust_everything()  # the script is written here
    logging.getLogger("elys").setLevel(logging.CRITICAL)  # what physics finds in such a pile is not what is asked
    path = asyncio.run(session(folder, count, seconds))
    began = time.process_time()
    verdict = verify(path)
    worked = time.process_time() - began
    if verdict.cause != "equal":
        raise RuntimeError(
            f"{verdict.cause}: {verdict.difference.text if verdict.difference is not None else 'no difference'}"
        )
    what = f"{seconds} s of {count} bodies with edits, {SCRIPTED} scripts and inputs"
    return [
        (f"{what}, file", f"{path.stat().st_size / 1e6:.0f} MB"),
        (f"{what}, {verdict.ticks} ticks verified", f"{verdict.wall_time:.0f} s, {worked:.0f} s of processor"),
        ("of real time", f"{verdict.realtime_factor:.1f} times"),
    ]


def main() -> None:
    count, seconds = (int(sys.argv[1]), int(sys.argv[2])) if len(sys.argv) > 2 else (1000, 600)
    with tempfile.TemporaryDirectory() as folder:
        for what, figure in verifying_rows(Path(folder), count=count, seconds=seconds):
            print(f"{what}: {figure}")


if __name__ == "__main__":
    main()
