"""What a person does with scenes as files: open, save, revert, compare, and get back what a crash has left."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final, Protocol

import msgspec

from elys.bus import topics
from elys.bus.access.limits import MAX_MESSAGE_SIZE
from elys.bus.asset_service import AssetClient, lacking_assets, offer_assets, open_asset_cache
from elys.bus.messages.commands import Command, CommandReply, LoadScene, NoteSaved
from elys.bus.messages.scene import SnapshotRequest
from elys.bus.session import Session
from elys.common.assets.store import AssetStore
from elys.common.errors import BusError, ElysError, SceneError
from elys.common.scene import EntityRecord, OpenedScene, open_scene
from elys.editor_node.recovery import Kept, Recovery
from elys.editor_node.scene_diff import DiffLine, scene_diff
from elys.editor_node.scene_file import SceneFile, scene_records
from elys.editor_node.scene_mirror import EditorScene

AUTOSAVE_INTERVAL: Final = 60.0  # [s] of having edits that no file has
SNAPSHOT_TIMEOUT: Final = 20.0  # [s]
LOAD_TIMEOUT: Final = 120.0  # [s] 50,000 entities, and kernels that were never compiled
_log = logging.getLogger(__name__)


class Ask(Protocol):
    """Asks the host for a command."""

    def __call__(self, command: Command, *, timeout: float = 5.0) -> Awaitable[CommandReply]: ...


class SceneDocuments:
    """Of one editor. Where something cannot be done the methods raise ElysError with the sentence to be shown."""

    def __init__(
        self,
        session: Session,
        scene: EditorScene,
        ask: Ask,
        *,
        recovery: Recovery | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Without `recovery` nothing is kept aside."""
        self.file = SceneFile(scene)
        self.recovery = recovery
        self.left_behind: Kept | None = (
            None  # what a crash has left of this scene, until the person said what becomes of it
        )
        self._session = session
        self._scene = scene
        self._ask = ask
        self._clock = clock
        self._dirty_since: float | None = None
        self._kept_content = 0  # what was kept aside last

    # --- saving ------------------------------------------------------------------------------------------------------

    async def save(self, path: str | Path, *, name: str = "") -> Path:
        """Writes the scene as it was edited: time has moved nothing in it."""
        scene = await self._as_edited()
        records = await self._whole(scene)
        saved = self.file.save(path, name=name, scene=scene, records=records)
        self._forget_kept()
        if not self.is_replay:
            await self._tell_saved(str(saved), scene.mirror.content)
        return saved

    async def save_running(self, path: str | Path, *, name: str = "") -> Path:
        """Writes a copy of the scene as it is now, moving bodies where they are now."""
        records = await self._whole(self._scene)
        return self.file.save(path, name=name, records=records, is_copy=True)

    @property
    def is_replay(self) -> bool:
        """Whether the host shows a recording."""
        return any(node.kind == "replay" for node in self._session.nodes.values())

    async def _tell_saved(self, path: str, content: int) -> None:
        """Lets the host know, and so the other editors; that it does not answer makes the file no worse."""
        try:
            await self._ask(NoteSaved(path=path, content=content), timeout=SNAPSHOT_TIMEOUT)
        except BusError as error:
            _log.warning("the session does not know that %s has its edits: %s", path, error)

    # --- opening -----------------------------------------------------------------------------------------------------

    async def open(self, path: str | Path) -> OpenedScene:
        """Puts the scene of a file in the place of the host's."""
        path = Path(path).expanduser()
        assets = AssetStore()
        opened = await asyncio.to_thread(open_scene, path, assets)
        await self._load(opened, assets, path=str(opened.path))
        return opened

    async def revert(self) -> OpenedScene:
        """Opens the scene's file again: all edits since are gone."""
        if self.file.path is None:
            raise SceneError("the scene has no file to go back to; it was never saved here")
        return await self.open(self.file.path)

    async def recover(self, kept: Kept) -> OpenedScene:
        """Puts what a crash has left in the place of the host's scene; it counts as edited, and keeps its file."""
        assets = AssetStore()
        opened = await asyncio.to_thread(open_scene, Path(kept.scene), assets)
        await self._load(opened, assets, path=kept.path)
        self.file.saved_content = -1  # no file has it
        await self._tell_saved(kept.path, -1)
        self._dirty_since = self._clock() - AUTOSAVE_INTERVAL
        await self.keep_if_due()  # a second crash shall not find less than the first
        self.discard(kept)
        return opened

    def discard(self, kept: Kept) -> None:
        """Nobody wants what a crash has left."""
        if self.recovery is not None:
            self.recovery.forget(kept.scene)
        self.left_behind = None

    async def _load(self, opened: OpenedScene, assets: AssetStore, *, path: str) -> None:
        await offer_assets(self._session, assets, opened.records)
        command = LoadScene(name=opened.name, records=tuple(opened.records), settings=opened.settings, path=path)
        _require_sendable(command, opened)
        self._forget_kept()
        reply = await self._ask(command, timeout=LOAD_TIMEOUT)
        if not reply.accepted:
            raise SceneError(f"{opened.path.name} was not opened: {reply.reason}")
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(SNAPSHOT_TIMEOUT):  # until it is what the panels show
                while self._scene.mirror.sequence < reply.sequence:
                    await self._scene.wait_for_change()

    # --- comparing ---------------------------------------------------------------------------------------------------

    async def changes(self) -> list[DiffLine]:
        """What was edited since the file."""
        if self.file.path is None:
            raise SceneError("the scene has no file to be compared with; it was never saved here")
        opened = await asyncio.to_thread(open_scene, self.file.path, AssetStore())
        scene = await self._as_edited()
        return scene_diff(
            opened.records,
            scene_records(scene),
            settings_before=opened.settings,
            settings_after=scene.settings,
        )

    # --- keeping aside -----------------------------------------------------------------------------------------------

    async def keep_aside(self) -> None:
        """Looks every now and then whether edits wait to be saved, and keeps them aside when they have waited a while."""
        while True:
            await asyncio.sleep(AUTOSAVE_INTERVAL / 12.0)
            await self.keep_if_due()

    async def keep_if_due(self) -> bool:
        """Keeps the scene aside if it has had edits for long enough that are not kept yet; whether it did."""
        now, content = self._clock(), self._scene.mirror.content
        if self.recovery is None or not self.file.is_dirty or self.is_replay:
            self._dirty_since = None
            self._forget_kept()
            return False
        if self._dirty_since is None:
            self._dirty_since = now
        if content == self._kept_content or now - self._dirty_since < AUTOSAVE_INTERVAL:
            return False
        self._dirty_since = now
        try:
            scene = await self._as_edited()
            records = await self._whole(scene)
            place = self.recovery.place(self._session.epoch)
            name = scene.mirror.scene
            self.file.save(place, name=name, scene=scene, records=records, is_copy=True)
            self.recovery.note(place, path=self.file.path, name=name, epoch=self._session.epoch)
        except (ElysError, OSError) as error:
            _log.warning("the edits could not be kept aside: %s", error)
            return False
        self._kept_content = content
        return True

    def look_for_left_behind(self) -> None:
        """Asks whether a crash has left edits of this scene; they are in `left_behind` then."""
        if self.recovery is not None and self._scene.is_known and not self.is_replay:
            self.left_behind = self.recovery.left_behind(
                path=self.file.path, name=self._scene.mirror.scene, epoch=self._session.epoch
            )

    def close(self) -> None:
        """The editor ends by the person's will: what is not saved now is not wanted, or is still with the host."""
        self._forget_kept()

    def _forget_kept(self) -> None:
        if self._kept_content and self.recovery is not None:
            self.recovery.drop(self._session.epoch)
        self._kept_content = 0

    async def _whole(self, scene: EditorScene) -> list[EntityRecord]:
        """A scene's records, when what they are made of is in this machine's cache: it may be in no file.

        What cannot be had may not be needed.
        """
        records, cache = scene_records(scene), open_asset_cache()
        client = AssetClient(self._session, cache)
        for reference in lacking_assets(cache, records):
            try:
                await client.fetch(reference)
            except ElysError as error:
                _log.warning("%s cannot be had for the scene's file: %s", reference, error)
        return records

    async def _as_edited(self) -> EditorScene:
        request = SnapshotRequest(as_edited=True)
        snapshot = await self._session.request(topics.SNAPSHOT, request, timeout=SNAPSHOT_TIMEOUT)
        scene = EditorScene(self._session)
        scene.mirror.apply_snapshot(snapshot)
        scene.is_known = True
        return scene


def _require_sendable(command: LoadScene, opened: OpenedScene) -> None:
    size = len(msgspec.json.encode(command))
    if size > MAX_MESSAGE_SIZE - 4096:
        raise SceneError(
            f"{opened.path} has {size >> 20} MiB when it is opened, more than one message may carry; start it with `elys edit`"
        )
