"""An editor that never stops: real edits at a real session, several entities at a time, until somebody kills it.

    python restless_editor.py ENDPOINT SEED

Each edit sets the mass of ten boxes to one number, so that a scene in which they differ was edited by half. What the host has
accepted is said on stdout, a line for each edit.
"""

from __future__ import annotations

import asyncio
import random
import sys

from elys.bus.discovery import join_session
from elys.bus.messages.commands import Despawn, SetComponent, SetEnabled, Spawn
from elys.common.scene import EntityRecord
from elys.editor_node.model import EditorModel

COUNT = 10


async def main(endpoint: str, seed: int) -> None:
    chance = random.Random(seed)
    session = await join_session(endpoint, kind="editor", timeout=30)
    model = EditorModel(session)
    running = asyncio.create_task(model.run())
    while not (model.scene.is_known and model.history.is_attached):
        await asyncio.sleep(0.001)
    print("attached", model.history.author, len(model.history.undoable), flush=True)
    while not running.done():
        boxes = sorted(
            entity.id for entity in model.scene.mirror.entities.values() if entity.name.startswith("Restless ")
        )
        outcome = await edit(model, boxes, chance)
        print("did", outcome.label, outcome.accepted, len(model.history.undoable), outcome.refusals, flush=True)


async def edit(model: EditorModel, boxes: list[int], chance: random.Random):
    kind = chance.choice(("mass", "mass", "mass", "enable", "replace", "undo", "redo")) if boxes else "spawn"
    if kind == "undo" and len(model.history.undoable) > 1:
        return await model.history.undo()
    if kind == "redo" and model.history.redo_label:
        return await model.history.redo()
    mass = float(chance.randrange(1, 1_000_000))
    match kind:
        case "spawn":
            edits = (Spawn(records=records(mass)),)
        case "replace":
            edits = (*(Despawn(entity=box) for box in boxes), Spawn(records=records(mass)))
        case "enable":
            enabled = chance.random() < 0.5
            edits = tuple(SetEnabled(entity=box, enabled=enabled) for box in boxes)
        case _:
            edits = tuple(SetComponent(entity=box, component="RigidBody", values={"mass": mass}) for box in boxes)
    return await model.history.perform(f"{kind} {mass:g}", edits)


def records(mass: float) -> tuple[EntityRecord, ...]:
    return tuple(
        EntityRecord(
            name=f"Restless {number}",
            components={"Transform": {"position": [2.0 * number, 50.0, 0.0]}, "RigidBody": {"mass": mass}},
        )
        for number in range(COUNT)
    )


asyncio.run(main(sys.argv[1], int(sys.argv[2])))
