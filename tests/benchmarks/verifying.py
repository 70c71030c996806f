"""How fast a session is verified: `python -m tests.benchmarks.verifying` prints it for ten minutes of 1000 bodies with edits."""

from __future__ import annotations

import asyncio
import logging
import sys
import tempfile
import time
from pathlib import Path

from elys.bus.messages.commands import Command, Despawn, Grab, Redo, Release, SetComponent, Spawn, Undo
from elys.common.scene import EntityRecord
from elys.common.scene_writing import write_scene
from elys.samples.pile import pile
from elys.sim_node.verification import verify
from tests.recorded_sessions import Person, Stage, recorded

RATE = 60
EVERY = 5  # [s] of simulation between two times that somebody does something


async def session(folder: Path, count: int, seconds: int) -> Path:
    """A pile into which somebody throws, which he drags, edits, and winds back."""
    scene = folder / "pile.scene.json"
    write_scene(pile(count), scene)
    async with recorded(folder, str(scene), outside=False) as stage:
        person = await stage.person("Anna")
        for number in range(seconds // EVERY):
            await act(stage, person, number)
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


def main() -> None:
    logging.disable(logging.CRITICAL)  # what physics finds in such a pile is not what is asked
    count, seconds = (int(sys.argv[1]), int(sys.argv[2])) if len(sys.argv) > 2 else (1000, 600)
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        path = asyncio.run(session(Path(folder), count, seconds))
        print(
            f"{seconds} s of {count} bodies recorded in {time.perf_counter() - began:.0f} s: {path.stat().st_size / 1e6:.0f} MB",
            flush=True,
        )
        began = time.process_time()
        verdict = verify(path)
        worked = time.process_time() - began
        print(
            f"{verdict.cause}: {verdict.ticks} ticks verified in {verdict.wall_time:.1f} s ({worked:.1f} s of processor), "
            f"{verdict.realtime_factor:.1f} times real time"
        )
        if verdict.difference is not None:
            sys.exit(verdict.difference.text)


if __name__ == "__main__":
    main()
