"""A simulation of a few pieces, and what they tell."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from elys.bus.messages.session import Event
from elys.common.assets.store import AssetStore
from elys.common.components import RigidBody, Transform
from elys.common.ids import Entity
from elys.common.scene import EntityNode, OpenedScene, SceneDocument, SceneSettings, expand
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State


class Stage:
    """A scene that runs.

    Attributes:
        told: all events, each with the tick in which it was heard.
    """

    def __init__(self, nodes: list[EntityNode], folder: Path, settings: SceneSettings) -> None:
        self.assets = AssetStore()
        records = expand(SceneDocument(entities=nodes), directory=folder, assets=self.assets)
        opened = OpenedScene(name="Stage", path=folder / "stage.scene.json", settings=settings, records=records)
        self.simulation = Simulation.load(opened, self.assets)
        self.told: list[tuple[int, Event]] = []

    def run(self, seconds: float) -> None:
        for _ in range(round(60 * seconds)):
            self.simulation.step()
            self.told += [(self.simulation.tick, event) for event in self.simulation.take_events()]
        failures = [event.values["text"] for _, event in self.told if event.kind == "script"]
        assert failures == []

    def id(self, path: str) -> Entity:
        return self.simulation.world.hierarchy.find(path)

    def position(self, path: str) -> tuple[float, float, float]:
        return self.simulation.world.transforms.world_pose(self.id(path))[0]

    def velocity(self, path: str) -> tuple[float, float, float]:
        return self.simulation.world.get(self.id(path), RigidBody).linear_velocity

    def place(self, path: str, *position: float) -> None:
        self.simulation.world.set_fields(self.id(path), Transform, {"position": position})

    def on(self, path: str) -> Any:
        entity = self.id(path)
        return next(one for one in self.simulation.scripts.behaviours_of(Behaviour) if one.entity.id == entity)

    def kinds(self) -> list[str]:
        """The events that were told, without signals, in order."""
        return [event.kind for _, event in self.told if event.kind != "signal"]

    def events(self, kind: str) -> list[tuple[int, dict[str, Any]]]:
        return [(tick, event.values) for tick, event in self.told if event.kind == kind]

    def goes_on_the_same(self, seconds: float) -> None:
        """Winds back through bytes and runs on again: bit for bit the same, and the same is told."""
        state = self.simulation.capture()
        seen, told = [], self.told
        for _ in range(2):
            self.told = []
            self.run(seconds)
            hashes = self.simulation.state_hash()
            seen.append((hashes, [(tick, e.kind, e.entity, e.values) for tick, e in self.told]))
            self.simulation.restore(State.from_bytes(state.to_bytes()))
        assert seen[0] == seen[1]
        self.told = told


def piece(
    name: str, prefab: str, *position: float, values: dict[str, Any] | None = None, **components: Any
) -> EntityNode:
    """An instance of a piece's prefab, with some fields of its script."""
    laid: dict[str, Any] = {"Transform": {"position": list(position or (0.0, 0.0, 0.0))}, **components}
    if values is not None:
        laid["Script"] = {"values": values}
    return EntityNode(name=name, prefab=f"elys:{prefab}.prefab.json", components=laid)


def ball(
    name: str, *position: float, mass: float = 1.0, velocity: tuple[float, ...] = (0.0, 0.0, 0.0), **body: Any
) -> EntityNode:
    return EntityNode(
        name=name,
        components={
            "Transform": {"position": list(position or (0.0, 0.0, 0.0))},
            "RigidBody": {"mass": mass, "linear_velocity": list(velocity), **body},
            "Collider": {"shape": "sphere", "radius": 0.25},
        },
    )


def box(name: str, *position: float, mass: float = 1.0, size: float = 0.4, friction: float = 0.6) -> EntityNode:
    return EntityNode(
        name=name,
        components={
            "Transform": {"position": list(position), "scale": [size] * 3},
            "RigidBody": {"mass": mass},
            "Collider": {"friction": friction},
        },
    )


def ground(**collider: Any) -> EntityNode:
    size = {"Transform": {"position": [0, -0.5, 0], "scale": [200, 1, 200]}, "Collider": collider}
    return EntityNode(name="Ground", components=size)


MakeStage = Callable[..., Stage]


@pytest.fixture
def make_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MakeStage:
    monkeypatch.delenv("ELYS_TRUST_SCRIPTS", raising=False)
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))

    def make(*nodes: EntityNode, gravity: tuple[float, float, float] = (0.0, -9.81, 0.0)) -> Stage:
        return Stage(list(nodes), tmp_path, SceneSettings(gravity=gravity))

    return make
