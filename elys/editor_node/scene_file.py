"""Saving: the scene as the host last told of it, written to a file that `elys run` opens."""

from __future__ import annotations

from pathlib import Path

import msgspec

from elys.bus.asset_service import open_asset_cache
from elys.common.assets.store import is_reference
from elys.common.errors import SceneError
from elys.common.scene import SCENE_SUFFIX, EntityRecord, collapse, write_scene
from elys.editor_node.edits import records_of
from elys.editor_node.history import History
from elys.editor_node.scene_mirror import EditorScene


class SceneFile:
    """Where the scene was saved last, and whether it was edited since."""

    def __init__(self, scene: EditorScene, history: History) -> None:
        self.path: Path | None = None
        self._scene = scene
        self._history = history
        self._saved_version = 0

    @property
    def is_dirty(self) -> bool:
        """Whether there are edits that no file has."""
        return self._history.version != self._saved_version

    def save(self, path: str | Path) -> int:
        """Writes the scene as it is now, moving bodies where they are now; how many assets the file names by content only.

        Raises:
            SceneError: the file cannot be written; the sentence says why.
        """
        path = Path(path).expanduser()
        if not path.name.endswith(".json"):
            path = path.with_name(f"{path.name}{SCENE_SUFFIX}")
        if not self._scene.is_known:
            raise SceneError("there is no scene to save yet")
        records = scene_records(self._scene)
        document = collapse(
            records,
            name=path.name.removesuffix(SCENE_SUFFIX),
            settings=self._scene.settings,
            directory=path.parent,
            assets=open_asset_cache(),
        )
        write_scene(document, path)
        self.path, self._saved_version = path, self._history.version
        return _reference_count(records)


def scene_records(scene: EditorScene) -> list[EntityRecord]:
    """All entities as records, parents first and siblings in order."""
    records: list[EntityRecord] = []
    for root in scene.children_of(0):
        start = len(records)
        for record in records_of(scene, root)[0]:
            parent = record.parent + start if record.parent >= 0 else -1
            records.append(msgspec.structs.replace(record, parent=parent))
    return records


def _reference_count(records: list[EntityRecord]) -> int:
    """Meshes and images that came from a model's file: other machines find them only where that model was opened."""
    texts = {
        value
        for record in records
        for values in record.components.values()
        for value in values.values()
        if isinstance(value, str) and is_reference(value)
    }
    return len(texts)
