"""What stands in a prefab's file, told by the host: of files that the scene is made of, as they are now, and of no others."""

from __future__ import annotations

import asyncio
import json
import os
from pathlib import Path

import pytest

from elys.bus import prefab_service, topics
from elys.bus.messages.scene import PrefabRequest
from elys.bus.prefab_service import serve_prefabs
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError
from elys.common.scene import open_scene
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation


def write_lamp(path: Path, *, height: float = 1.0) -> None:
    bulb = {"name": "Bulb", "components": {"Transform": {"position": [0, height, 0]}, "Light": {}}}
    lamp = {"name": "Lamp", "components": {"Transform": {}}, "children": [bulb]}
    path.write_text(json.dumps({"elys_scene": 1, "entities": [lamp]}), encoding="utf-8")


async def pair(instanced: set[str]) -> tuple[Session, Session]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    serve_prefabs(host, lambda path: path in instanced)
    return host, await Session.join(broker.connect(), kind="editor")


async def test_a_prefab_is_told_once_and_again_when_it_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "lamp.prefab.json"
    write_lamp(file)
    reads: list[str] = []
    read = prefab_service.read_prefab
    monkeypatch.setattr(prefab_service, "read_prefab", lambda path: reads.append(path) or read(path))
    host, joined = await pair({str(file)})
    content = await joined.request(topics.PREFAB, PrefabRequest(path=str(file)))
    assert [(record.name, record.parent) for record in content.records or ()] == [("Lamp", -1), ("Bulb", 0)]
    assert (content.records or ())[1].components["Transform"]["position"] == [0, 1.0, 0]
    same = await joined.request(topics.PREFAB, PrefabRequest(path=str(file), known=content.modified))
    assert same.records is None and len(reads) == 1
    write_lamp(file, height=2.0)
    os.utime(file, (content.modified + 1.0, content.modified + 1.0))
    answers = await asyncio.gather(*(joined.request(topics.PREFAB, PrefabRequest(path=str(file))) for _ in range(5)))
    assert all(answer.records[1].components["Transform"]["position"] == [0, 2.0, 0] for answer in answers)
    assert len(reads) == 2
    await joined.close()
    await host.close()


async def test_what_no_entity_is_an_instance_of_is_not_read(tmp_path: Path) -> None:
    file, broken = tmp_path / "lamp.prefab.json", tmp_path / "broken.prefab.json"
    write_lamp(file)
    broken.write_text("{", encoding="utf-8")
    gone = str(tmp_path / "gone.prefab.json")
    host, joined = await pair({gone, str(broken), "\0", ""})
    for path, why in (
        (str(file), "no entity of the scene is an instance"),
        (gone, "gone.prefab.json"),
        (str(broken), "not JSON"),
        ("\0", "is not a path"),
        ("", "no entity of the scene"),
    ):
        with pytest.raises(RequestError, match=why) as refused:
            await joined.request(topics.PREFAB, PrefabRequest(path=path))
        assert "\n" not in str(refused.value)
    await joined.close()
    await host.close()


async def test_a_simulation_tells_of_the_prefabs_of_its_scene(tmp_path: Path) -> None:
    write_lamp(tmp_path / "lamp.prefab.json")
    scene = {"elys_scene": 1, "entities": [{"name": "Desk lamp", "prefab": "lamp.prefab.json"}]}
    (tmp_path / "room.scene.json").write_text(json.dumps(scene), encoding="utf-8")
    assets = AssetStore()
    simulation = Simulation.load(open_scene(tmp_path / "room.scene.json", assets), assets)
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    serving = asyncio.create_task(SimulationNode(simulation, host, realtime=False, playing=False).run())
    await asyncio.sleep(0)
    joined = await Session.join(broker.connect(), kind="editor")
    path = (tmp_path / "lamp.prefab.json").as_posix()
    content = await joined.request(topics.PREFAB, PrefabRequest(path=path))
    assert [record.name for record in content.records or ()] == ["Lamp", "Bulb"]
    with pytest.raises(RequestError):
        await joined.request(topics.PREFAB, PrefabRequest(path=(tmp_path / "room.scene.json").as_posix()))
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)
    await joined.close()
    await host.close()
