"""Contacts and debug lines of a real simulation, heard by another process, echoed by a third and found in the recording."""

from __future__ import annotations

import asyncio
import json

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus import topics
from elys.bus.messages.commands import SetComponent, StepTicks
from elys.bus.messages.physics import ContactBatch, DebugLines
from elys.sim_node.physics.debug_geometry import LINES
from tests.process.clients import client

pytestmark = pytest.mark.process


def test_contacts_and_lines_are_heard_and_contacts_are_recorded(elys, free_port, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    recording = tmp_path / "stack.mcap"
    run = elys("run", "stack", "--headless", "--paused", "--listen", endpoint, "--record", recording)
    run.wait_for("simulating")
    echo = elys("topic", "echo", "contacts", "--count", "1", "--connect", endpoint)
    batches: list[ContactBatch] = []
    lines: dict[str, DebugLines] = {}

    async def follow() -> None:
        async with client(endpoint) as other:
            other.session.subscribe(topics.CONTACTS, lambda batch, _: batches.append(batch))
            other.session.subscribe(topics.DEBUG_LINES, lambda message, key: lines.update({key: message}))
            cube = next(e.id for e in other.mirror.entities.values() if "RigidBody" in e.components)
            # Time and again a cube is put onto the ground or away from it, until everybody has come and heard of it.
            place = 0
            async with asyncio.timeout(100):
                while not (batches and set(lines) == set(LINES) and echo.lines):
                    place += 1
                    position = (6.0, 0.5 if place % 2 else 60.0, 0.0)
                    put = SetComponent(entity=cube, component="Transform", values={"position": position})
                    assert (await other.ask(put)).accepted
                    assert (await other.ask(StepTicks(count=2))).accepted
                    await asyncio.sleep(0.02)

    asyncio.run(follow())
    assert echo.wait() == 0
    echoed = json.loads(echo.lines[0])
    run.end()
    with recording.open("rb") as file:
        recorded = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages(topics=["contacts"])]
    assert len(recorded[0]["begun"]["entity_a"]) >= 9  # the stack stands on itself from its first tick
    assert echoed in recorded
    heard = [batch.tick for batch in batches]
    assert [batch["tick"] for batch in recorded if heard[0] <= batch["tick"] <= heard[-1]] == heard
    boxes = np.frombuffer(lines["boxes"].positions, "<f4").reshape(-1, 2, 3)
    assert len(boxes) == len(lines["boxes"].colors) == 12 * 11
