"""Saving: the scene as the host last told of it, written to a file that `elys run` opens."""

from __future__ import annotations

import logging
from pathlib import Path

import msgspec

from elys.bus.asset_service import open_asset_cache
from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError, SceneError
from elys.common.scene import SCENE_SUFFIX, EntityRecord, collapse, expand, open_scene, write_scene
from elys.common.scene_naming import take_references
from elys.editor_node.edits import records_of
from elys.editor_node.history import History
from elys.editor_node.scene_mirror import EditorScene

_log = logging.getLogger(__name__)


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

    def forget(self) -> None:
        """Another scene: it was saved nowhere, and what was edited is not its own."""
        self.path, self._saved_version = None, self._history.version

    def save(self, path: str | Path, *, name: str = "") -> None:
        """Writes the scene as it is now, moving bodies where they are now; `name` is what it calls itself, if not as its file.

        Raises:
            SceneError: the file cannot be written, or could not be opened again; the sentence says why. Nothing was written.
        """
        path = Path(path).expanduser()
        if not path.name.endswith(".json"):
            path = path.with_name(f"{path.name}{SCENE_SUFFIX}")
        if not self._scene.is_known:
            raise SceneError("there is no scene to save yet")
        assets = open_asset_cache()
        self._learn_sources(path, assets)
        document = collapse(
            scene_records(self._scene),
            name=name or path.name.removesuffix(SCENE_SUFFIX),
            settings=self._scene.settings,
            directory=path.parent,
            assets=assets,
        )
        # What cannot be opened again is lost, however well it was written.
        expand(document, directory=path.parent, assets=AssetStore())
        write_scene(document, path)
        self.path, self._saved_version = path, self._history.version

    def _learn_sources(self, path: Path, assets: AssetStore) -> None:
        """Puts into `assets` what the file that is about to be replaced, and the one saved last, have from other files."""
        for known in dict.fromkeys((path, self.path or path)):
            try:
                open_scene(known, assets)
            except ElysError as error:  # often there is none yet; what is missed then is refused by name
                _log.debug("learnt nothing from %s: %s", known, error)


def scene_records(scene: EditorScene) -> list[EntityRecord]:
    """All entities as records, parents first and siblings in order."""
    records: list[EntityRecord] = []
    row_of: dict[int, int] = {}
    for root in scene.children_of(0):
        start = len(records)
        below, entities = records_of(scene, root)
        row_of.update((entity, start + row) for row, entity in enumerate(entities))
        for record in below:
            parent = record.parent + start if record.parent >= 0 else -1
            within = {key: start + row for key, row in record.references.items()}
            records.append(msgspec.structs.replace(record, parent=parent, references=within))
    # Those to what stands under other roots are known only now.
    return [
        msgspec.structs.replace(record, references={**record.references, **take_references(record.components, row_of)})
        for record in records
    ]
