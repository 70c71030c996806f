"""Edits of the tree that are more than one command: grouping, and what comes from and goes to the clipboard."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import msgspec
import numpy as np

from elys.bus.asset_service import AssetOffer
from elys.bus.messages.commands import Edit, Reparent, Spawn
from elys.bus.messages.session import LogLevel
from elys.common.errors import AssetError, BusError, SceneError
from elys.common.math import matrix
from elys.common.scene import EntityRecord
from elys.editor_node.free_names import free_names
from elys.editor_node.history import History, Outcome
from elys.editor_node.language import tr
from elys.editor_node.operations import Done, Operations
from elys.editor_node.scene_clipboard import Fragment, copy_text, read_fragment
from elys.editor_node.scene_mirror import EditorScene
from elys.editor_node.selection import Selection
from elys.editor_node.sentences import sentence, tr_sentence


class Say(Protocol):
    """Tells the person something."""

    def __call__(self, level: LogLevel, text: str) -> None: ...


class Clipboard(Protocol):
    """Where texts are put for other programs: the system's clipboard."""

    def read(self) -> str:
        """The text on it; empty where there is none."""

    def write(self, text: str) -> None:
        """Puts a text on it."""


@dataclass(slots=True)
class OwnClipboard:
    """One that no other program sees, where there is no window."""

    text: str = ""

    def read(self) -> str:
        """The text on it."""
        return self.text

    def write(self, text: str) -> None:
        """Puts a text on it."""
        self.text = text


class TreeEdits:
    """Works on what is selected. What goes wrong, or gets lost on the way, is told with `say`."""

    def __init__(
        self,
        scene: EditorScene,
        selection: Selection,
        history: History,
        edit: Operations,
        *,
        offer: AssetOffer,
        say: Say,
    ) -> None:
        self.clipboard: Clipboard = OwnClipboard()
        self._scene = scene
        self._selection = selection
        self._history = history
        self._edit = edit
        self._offer = offer
        self._say = say

    # --- groups ----------------------------------------------------------------------------------------------------

    def group(self) -> asyncio.Future[Outcome] | None:
        """Puts what is selected under a new entity amid it, where the first of it stood, and selects that."""
        tops = self._edit.tops(self._selection)
        if not tops:
            return None
        parent, index = self._scene.place_of(tops[0])
        point = np.mean([self._scene.world_pose(entity).position for entity in tops], axis=0)
        if parent:
            local_from_world = matrix.inverse_affine(self._scene.world_from_local(parent))
            point = np.asarray(matrix.transform_points(local_from_world, point), dtype=np.float64)
        position = [round(float(value), 4) for value in point]
        record = EntityRecord(
            name=free_names(self._scene, parent, ["Group"])[0], components={"Transform": {"position": position}}
        )
        what = f"{len(tops)} entities" if len(tops) > 1 else self._scene.name_of(tops[0])
        label = sentence("Group {what}", what=what)
        stroke = object()  # both edits are one entry
        made = self._history.perform(label, (Spawn(records=(record,), parent=parent, index=index),), stroke=stroke)
        made.add_done_callback(lambda done: self._fill_group(done, label, tops, stroke))
        return made

    def _fill_group(self, made: Done, label: str, tops: Sequence[int], stroke: object) -> None:
        if made.cancelled() or not made.result().spawned:
            return
        (group,) = made.result().spawned
        living = [entity for entity in tops if self._scene.exists(entity)]
        commands: tuple[Edit, ...] = tuple(Reparent(entity=entity, parent=group) for entity in living)
        if commands:
            self._history.perform(label, commands, stroke=stroke)
        self._selection.replace((group,))

    # --- clipboard -------------------------------------------------------------------------------------------------

    def copy(self) -> bool:
        """Puts what is selected on the clipboard; whether that was possible."""
        tops = self._edit.tops(self._selection)
        if not tops:
            return False
        try:
            copied = copy_text(self._scene, tops)
        except SceneError as error:
            self._say("error", tr("cannot copy: {error}", error=tr_sentence(str(error))))
            return False
        self.clipboard.write(copied.text)
        for loss in copied.losses:
            self._say("warning", loss)
        self._say("info", tr("Copied {what}", what=described(self._scene, tops)))
        return True

    def cut(self) -> Done | None:
        """Copies what is selected and ends it."""
        return self._edit.delete() if self.copy() else None

    async def paste(self, *, directory: Path) -> Outcome | None:
        """Makes what is on the clipboard beside what is selected, and selects it; None where that cannot be.

        Content that the host lacks is given to it as far as this machine has it; what is missing then is named.
        """
        scene, primary = self._scene, self._selection.primary
        try:
            fragment = read_fragment(self.clipboard.read(), scene, directory=directory)
        except SceneError as error:
            self._say("error", tr("cannot paste: {error}", error=tr_sentence(str(error))))
            return None
        for loss in fragment.losses:
            self._say("warning", loss)
        await self._bring_content(fragment)
        if primary and not scene.exists(primary):
            primary = 0
        parent, index = scene.place_of(primary) if primary else (0, -2)
        records = with_free_names(scene, parent, fragment.records)
        tops = sum(record.parent < 0 for record in records)
        label = sentence("Paste {what}", what=records[0].name if tops == 1 else f"{tops} entities")
        done = self._history.perform(label, (Spawn(records=records, parent=parent, index=index + 1),))
        outcome = await done
        if outcome.spawned:
            self._selection.replace(outcome.spawned)
        return outcome

    async def _bring_content(self, fragment: Fragment) -> None:
        missing = []
        for reference in fragment.content:
            try:
                if not await self._offer.bring(reference, fragment.assets):
                    missing.append(reference)
            except AssetError:
                missing.append(reference)
            except BusError as error:
                self._say(
                    "warning",
                    tr(
                        "whether the simulation has {reference} is not known: {error}", reference=reference, error=error
                    ),
                )
                return
        if missing:
            names = ", ".join(missing[:3]) + (" ..." if len(missing) > 3 else "")
            self._say(
                "warning",
                tr(
                    "{count} assets of what was pasted are missing here, so that is not drawn: {names}; open the scene that it "
                    "comes from on this machine and copy again",
                    count=len(missing),
                    names=names,
                ),
            )


def described(scene: EditorScene, entities: Sequence[int]) -> str:
    """Entities in a word."""
    return f"'{scene.name_of(entities[0])}'" if len(entities) == 1 else tr("{count} entities", count=len(entities))


def with_free_names(scene: EditorScene, parent: int, records: Sequence[EntityRecord]) -> tuple[EntityRecord, ...]:
    """The records, their roots called so that no sibling has the name."""
    names = iter(free_names(scene, parent, [record.name for record in records if record.parent < 0]))
    return tuple(
        msgspec.structs.replace(record, name=next(names)) if record.parent < 0 else record for record in records
    )
