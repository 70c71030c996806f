"""What the tests of the editor share: a stage (stage.py) with a small host (scene_host.py), and a person (person.py) at it."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from elys.bus.mirror import SceneMirror
from elys.common.scene import EntityRecord
from tests.unit.editor_node.person import at_the_editor as at_the_editor  # a fixture: to be found here
from tests.unit.editor_node.scene_host import SceneHost as SceneHost
from tests.unit.editor_node.scene_host import tree_of as tree_of
from tests.unit.editor_node.stage import Stage, open_stage
from tests.unit.editor_node.stage import yard_records as yard_records


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows here need none; for these tests alone, as others are about what is said where there is none."""
    monkeypatch.setenv("ELYS_NULL_PLATFORM", "1")


@pytest.fixture
def on_stage() -> Callable[..., None]:
    """Runs `await scenario(stage)` with a host and a model."""

    def play(scenario: Callable[[Stage], Awaitable[None]], records: list[EntityRecord] | None = None) -> None:
        async def main() -> None:
            async with open_stage(records) as stage:
                await scenario(stage)

        asyncio.run(main())

    return play


@pytest.fixture
def scene_tree() -> Callable[[SceneMirror], list[Any]]:
    return tree_of


@pytest.fixture
def screenshot_directory(tmp_path: Path) -> Path:
    """Where pictures of the editor go: kept when ELYS_SCREENSHOTS names a directory."""
    chosen = os.environ.get("ELYS_SCREENSHOTS")
    return Path(chosen) if chosen else tmp_path
