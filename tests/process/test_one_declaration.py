"""A component is declared in one place, here, and appears in all five: storage, wire, scene file, inspector, recording."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus import topics
from elys.bus.following import follow_scene
from elys.bus.messages.commands import CommandRequest, SetComponent
from elys.bus.mirror import SceneMirror
from elys.bus.recorder import record_session
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.components import Component, Vec3, about, component, component_from, forget
from elys.common.components.schema import scene_schema
from elys.common.scene import format_scene, open_scene, parse_scene
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation

SCENE = """{
  "elys_scene": 1,
  "name": "kitchen",
  "entities": [
    {
      "name": "Pot",
      "components": {
        "Transform": {},
        "Heat": {"temperature": 99.5, "source": "gas", "flow": [0.1, 0.2, 0.3]}
      }
    }
  ]
}
"""


@pytest.fixture
def heat() -> Iterator[type[Component]]:
    """The one declaration."""

    @component
    class Heat(Component, frozen=True):
        """How hot an entity is."""

        temperature: Annotated[float, about("Above freezing.", unit="C", minimum=-273.0, maximum=5000.0, step=0.5)] = (
            20.0
        )
        source: Annotated[Literal["none", "gas", "sun"], about("What heats it.")] = "none"
        flow: Annotated[Vec3, about("Heat that leaves it.", unit="W/m2")] = (0.0, 0.0, 0.0)
        is_boiling: Annotated[bool, about("Whether it boils.")] = False

    yield Heat
    forget(Heat)


def test_the_scene_file_has_it_with_its_schema(heat, tmp_path):
    document = parse_scene(SCENE)
    assert format_scene(document) == SCENE
    text = json.dumps(scene_schema())
    assert '"Heat"' in text
    assert "What heats it." in text
    assert "-273" in text
    path = tmp_path / "kitchen.scene.json"
    path.write_text(SCENE.replace('"gas"', '"wood"'))
    with pytest.raises(Exception, match=r"entities\[0\].components.Heat.*one of none, gas, sun"):
        open_scene(path, AssetStore())


def test_storage_wire_inspector_and_recording_have_it(heat, tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_NULL_PLATFORM", "1")
    path = tmp_path / "kitchen.scene.json"
    path.write_text(SCENE)
    simulation = Simulation.load(open_scene(path, assets := AssetStore()), assets)

    # Storage: numpy columns of the declared types.
    table = simulation.world.table("Heat")
    assert table.column("temperature").dtype == np.float32
    assert table.column("temperature").tolist() == [99.5]
    assert table.column("source").tolist() == [1]
    assert table.column("flow").shape == (1, 3)

    recording = tmp_path / "kitchen.mcap"
    asyncio.run(edit_it_over_the_bus(simulation, recording, heat))

    # Storage again, after the edit; and the recording as a foreign reader sees it.
    assert simulation.world.get(int(simulation.world.entities()[0]), heat).temperature == 30.25
    with recording.open("rb") as file:
        reader = make_reader(file)
        schemas = [a for a in reader.iter_attachments() if a.name.endswith("components.schema.json")]
        assert "Heat" in json.loads(schemas[0].data)
        told = [json.loads(message.data) for _, channel, message in reader.iter_messages(topics=["delta"])]
    changes = [change for delta in told for change in delta["changes"]]
    assert changes[-1]["component"] == "Heat"
    assert changes[-1]["values"]["temperature"] == 30.25


async def edit_it_over_the_bus(simulation: Simulation, recording, heat: type[Component]) -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="kitchen", kind="simulation", epoch=1)
    node = asyncio.create_task(SimulationNode(simulation, host, playing=False).run())
    guest = await Session.join(broker.connect(), kind="tool")
    stop = asyncio.Event()
    recorder = asyncio.create_task(
        record_session(await Session.join(broker.connect(), kind="recorder"), recording, stop)
    )

    # Wire: the mirror has the value as a component, and an edit comes back as one.
    mirror = SceneMirror()
    await follow_scene(guest, mirror)
    pot = mirror.roots[0]
    assert mirror.entities[pot].components["Heat"] == component_from(
        "Heat", {"temperature": 99.5, "source": "gas", "flow": [0.1, 0.2, 0.3]}
    )
    await show_in_inspector(broker, pot)
    edit = SetComponent(entity=pot, component="Heat", values={"temperature": 30.25})
    reply = await guest.request(topics.COMMAND, CommandRequest(origin="test", command=edit))
    assert reply.accepted
    too_cold = SetComponent(entity=pot, component="Heat", values={"temperature": -300.0})
    reply = await guest.request(topics.COMMAND, CommandRequest(origin="test", command=too_cold))
    assert reply.reason == "Heat.temperature must be at least -273 C, not -300"
    async with asyncio.timeout(10):
        while mirror.entities[pot].components["Heat"].temperature != 30.25:
            await asyncio.sleep(0.01)
    stop.set()
    await recorder
    node.cancel()
    await guest.close()
    await host.close()


async def show_in_inspector(broker: LoopbackBroker, pot: int) -> None:
    """The real editor's inspector draws a widget for each field."""
    from elys.editor_node.node import Editor

    session = await Session.join(broker.connect(), kind="editor")
    with Editor(session, null_platform=True, size=(1600, 900)) as editor:
        editor.ui.landmarks.is_wanted = True
        running = asyncio.create_task(editor.run())
        wanted = {f"inspector/Heat/{name}" for name in ("temperature", "source", "is_boiling")}
        async with asyncio.timeout(30):
            while not wanted <= set(editor.ui.landmarks.rectangles):
                if pot in editor.model.scene.mirror.entities and not editor.model.selection.entities:
                    editor.model.selection.replace([pot])
                editor.application.keep_awake(1.0)
                await asyncio.sleep(0.01)
        editor.application.close()
        await running
    await session.close()
