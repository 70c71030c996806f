"""A simulation whose entities carry scripts that a test writes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from elys.common import trust
from elys.common.assets.scripts import read_script
from elys.common.assets.store import AssetStore
from elys.common.components import Script, Transform
from elys.common.ids import Entity
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.simulation import Simulation

HEAD = "from typing import Annotated, NamedTuple\nfrom elys.script import *\n"


class Playground:
    """Files in a trusted folder and a simulation."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.assets = AssetStore()
        self.simulation = Simulation(assets=self.assets)

    def write(self, name: str, text: str) -> str:
        """Writes a script's file; its source for components."""
        (self.folder / name).write_text(HEAD + textwrap.dedent(text))
        return self.source(name)

    def source(self, name: str, behaviour: str = "") -> str:
        return read_script(self.folder / name, behaviour, self.assets)

    def spawn(self, source: str, name: str = "Thing", *components: Any, **values: Any) -> Entity:
        parts = (Transform(), Script(source=source, values=values))
        given = {type(part) for part in components}
        return self.simulation.world.spawn([*(p for p in parts if type(p) not in given), *components], name=name)

    def run(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.simulation.step()

    def on(self, entity: Entity) -> Any:
        """The behaviour of an entity."""
        scripts = self.simulation.scripts
        return next(one for one in scripts.behaviours_of(Behaviour) if one.entity.id == entity)

    def failure(self, entity: Entity) -> str:
        events = [event for event in self.simulation.take_events() if event.kind == "script" and event.entity == entity]
        return events[0].values["text"] if events else ""


@pytest.fixture
def play(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Playground]:
    monkeypatch.setattr(trust, "_here", {*trust._here, tmp_path.resolve()})
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    yield Playground(tmp_path)
