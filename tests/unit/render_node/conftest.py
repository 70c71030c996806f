"""One OpenGL context for all tests of the renderer, and worlds built from components alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from elys.bus.messages.state_frame import StateFrame
from elys.common.components import Component
from elys.common.errors import DisplayError
from elys.common.scene import SceneSettings
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.quality import FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import SceneTables, tables_of


@pytest.fixture(scope="module")  # not longer: a window that closes ends the display that all share
def context() -> Iterator[Context]:
    """OpenGL offscreen; without it there is nothing to test here."""
    try:
        made = offscreen_context()
    except DisplayError as error:
        pytest.skip(str(error))
    yield made
    made.release()


@pytest.fixture(scope="module")  # not longer: a window that closes ends the display that all share
def renderer(context: Context) -> Renderer:
    """A renderer at full quality."""
    return Renderer(context, quality=FULL)


class Stage:
    """Collects entities and makes tables or a world of them. Ids count from 1."""

    def __init__(self) -> None:
        self.parents: list[int] = []
        self.enabled: list[bool] = []
        self.components: list[Mapping[str, Component]] = []
        self.settings = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0))

    def add(self, *components: Component, parent: int = 0, enabled: bool = True) -> int:
        self.parents.append(parent)
        self.enabled.append(enabled)
        self.components.append({type(value).__name__: value for value in components})
        return len(self.parents)

    def tables(self) -> SceneTables:
        entities = range(1, len(self.parents) + 1)
        return tables_of(entities, self.parents, self.components, enabled=self.enabled, settings=self.settings)

    def world(self, assets: DrawableAssets | None = None) -> RenderWorld:
        world = RenderWorld(assets)
        world.set_scene(self.tables())
        world.place()
        return world


@pytest.fixture
def stage() -> Stage:
    """An empty, black stage."""
    return Stage()


FrameMaker = Callable[..., StateFrame]


@pytest.fixture
def make_frame() -> FrameMaker:
    """Makes state frames from entity -> position, or (position, rotation)."""

    def make(poses: Mapping[int, Any], **header: Any) -> StateFrame:
        rows = [pose if len(pose) == 2 else (pose, (0.0, 0.0, 0.0, 1.0)) for pose in poses.values()]
        count = len(rows)
        values = {
            "epoch": 1,
            "tick": 0,
            "simulation_time": 0.0,
            "published_at": 0,
            "delta_sequence": 0,
            "state_hash": 0,
            "playing": True,
        } | header
        return StateFrame(
            position=np.array([row[0] for row in rows], np.float64).reshape(count, 3),
            rotation=np.array([row[1] for row in rows], np.float32).reshape(count, 4),
            linear_velocity=np.zeros((count, 3), np.float32),
            angular_velocity=np.zeros((count, 3), np.float32),
            entity=np.array(list(poses), np.uint32),
            **values,
        )

    return make
