"""The scene's file: what was edited, written so that `elys run` opens it, and read again.

What is saved is the scene as it was edited: where time has moved bodies since, they are where they were put. The running state
can be written to a file of its own.
"""

from __future__ import annotations

import logging
import socket
from collections.abc import Sequence
from pathlib import Path

import msgspec

from elys.bus.asset_service import open_asset_cache
from elys.bus.messages.history import HistoryReply
from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError, SceneError
from elys.common.made_contents import keep_made_contents
from elys.common.scene import PREFAB_SUFFIX, SCENE_SUFFIX, EntityRecord, collapse, expand, open_scene, write_scene
from elys.common.scene_naming import take_references
from elys.editor_node.edits import records_of
from elys.editor_node.scene_mirror import EditorScene

_log = logging.getLogger(__name__)


class SceneFile:
    """Where the scene was opened from or saved last, and whether it was edited since."""

    def __init__(self, scene: EditorScene) -> None:
        self.path: Path | None = None
        self.origin = ""  # the file with the machine that it is on, as the host tells; none of what was never a file
        self.saved_content = 0  # what names the content that the file has
        self._scene = scene

    @property
    def is_dirty(self) -> bool:
        """Whether there are edits that no file has; undoing them all makes it clean again."""
        return self._scene.is_known and self._scene.mirror.content != self.saved_content

    def forget(self) -> None:
        """Another scene: where it was saved is known when its host has told."""
        self.path, self.origin, self.saved_content = None, "", self._scene.mirror.content

    def learn(self, told: HistoryReply) -> None:
        """Takes over what the host says of the file; one on another machine cannot be written from here."""
        self.saved_content = told.saved
        self.origin = f"{told.machine}:{told.path}" if told.path else ""
        path = Path(told.path) if told.path and told.machine == socket.gethostname() else None
        # What was opened from a model or a prefab is saved as a scene of its own.
        is_scene = path is not None and path.name.endswith(".json") and not path.name.endswith(PREFAB_SUFFIX)
        self.path = path if is_scene and path is not None and path.is_file() else None

    def save(
        self,
        path: str | Path,
        *,
        name: str = "",
        scene: EditorScene | None = None,
        records: Sequence[EntityRecord] | None = None,
        is_copy: bool = False,
    ) -> Path:
        """Writes a scene, that of the mirror if no other is given; returns the file, whose suffix may have been added.

        What it is drawn from, or does, that no file holds is written beside it (`made_contents.py`).

        `name` is what it calls itself, if not as its file; `records` are those of the scene, where they are known already. A copy
        leaves the scene as dirty as it is, and its file what it was.

        Raises:
            SceneError: the file cannot be written, or could not be opened again; the sentence says why. The file is as it was.
        """
        scene = scene if scene is not None else self._scene
        path = Path(path).expanduser().absolute()
        if not path.name.endswith(".json"):
            path = path.with_name(f"{path.name}{SCENE_SUFFIX}")
        if not scene.is_known:
            raise SceneError("there is no scene to save yet")
        assets = open_asset_cache()
        self._learn_sources(path, assets)
        records = records if records is not None else scene_records(scene)
        keep_made_contents(records, path, assets)
        document = collapse(
            records,
            name=name or path.name.removesuffix(SCENE_SUFFIX),
            settings=scene.settings,
            directory=path.parent,
            assets=assets,
        )
        # What cannot be opened again is lost, however well it was written.
        expand(document, directory=path.parent, assets=AssetStore())
        write_scene(document, path)
        if not is_copy:
            self.path, self.saved_content = path, scene.mirror.content
        return path

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
