"""The assets of a project as the browser shows them: what each holds, its thumbnail, and what changes on the disk.

    AssetFolder (thread) ──files──> AssetLibrary ──one file at a time──> read, draw small (thread, render node)
                                        │  changed and in use
                                        └──> AssetPlacing.reload ──> an edit

Reading goes newest wish first: what is to be seen, then, while nothing is, images, so that it is known which of them the scene
uses. Models are read when they are seen or when the scene has instances of them.
"""

from __future__ import annotations

import asyncio
import dataclasses
from collections import OrderedDict
from pathlib import Path
from typing import TYPE_CHECKING, Final

from elys.bus import topics
from elys.bus.messages.views import ThumbnailRequest
from elys.bus.session import Node
from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError, BusError, ConnectionLost
from elys.editor_node.asset_folder import AssetFile, AssetFolder, Listing
from elys.editor_node.asset_pictures import (
    Pixels,
    ThumbnailCache,
    decoded,
    image_thumbnail,
    thumbnail_request,
)
from elys.editor_node.asset_placing import AssetPlacing
from elys.editor_node.asset_reading import AssetContent, read_asset
from elys.editor_node.asset_uses import MissingAsset, Use, missing_assets

if TYPE_CHECKING:
    from elys.editor_node.model import EditorModel

KEPT_PICTURES: Final = 400  # in memory, 64 KiB each; more are read from the disk again
READ_AHEAD: Final = 512 << 20  # [bytes] of images that are read before anybody sees them
LOOK_INTERVAL: Final = 0.5  # [s] between two looks through the whole scene
THUMBNAIL_TIMEOUT: Final = 20.0  # [s]

Version = tuple[Path, int, int]


class AssetLibrary:
    """Works for one editor, on the loop it is made on. `changed` rises when there is something else to be shown."""

    def __init__(self, model: EditorModel, *, cache: ThumbnailCache | None = None, is_watched: bool = True) -> None:
        """`cache` is that of the user where none is given. Nothing is read until `open`."""
        self._model = model
        self._cache = cache
        self._is_watched = is_watched
        self.placing = AssetPlacing(model)
        self.folder: AssetFolder | None = None
        self.changed = 0
        self.reloads = True  # whether the scene follows files that change on the disk
        self.missing: list[MissingAsset] | None = None  # None until it was looked for
        self.missing_error = ""
        self.missing_of = (-1, -1)  # epoch and delta of the scene that it was looked for in
        self._looks_for_missing = False
        self._looks_for_uses = False
        self._contents: dict[Path, AssetContent] = {}
        self._followed: dict[Path, AssetContent] = {}  # the last that could be read: what the scene may show
        self._pictures: OrderedDict[Version, Pixels | None] = OrderedDict()  # None: there is none, an icon does
        self._undrawn: set[Version] = set()  # for lack of a render node
        self._wanted: dict[Version, AssetFile] = {}
        self._read_ahead: list[AssetFile] = []
        self._working: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._at_host: set[Version] = set()
        model.session.on_nodes(self._node_changed)
        model.session.on_link(
            lambda connected: self._at_host.clear()
        )  # another run, or another host, has to be given it anew

    # --- the folder ------------------------------------------------------------------------------------------------

    @property
    def listing(self) -> Listing:
        """What lies in the folder; nothing where none is open."""
        return self.folder.listing if self.folder is not None else Listing(root=Path())

    def open(self, root: Path) -> None:
        """Shows another folder."""
        self.close()
        self._loop = asyncio.get_running_loop()
        self.folder = AssetFolder(root, on_change=self._told, is_watched=self._is_watched)

    def close(self) -> None:
        """Ends the folder's thread, and forgets what was in it."""
        if self.folder is not None:
            self.folder.close()
            self.folder = None
        if self._working is not None:
            self._working.cancel()
            self._working = None
        for kept in (
            self._contents,
            self._followed,
            self._pictures,
            self._undrawn,
            self._wanted,
            self._read_ahead,
            self._at_host,
        ):
            kept.clear()

    # --- what is shown ---------------------------------------------------------------------------------------------

    def begin_frame(self) -> None:
        """Call it before the tiles of a frame ask: what is not asked for any more is not read first."""
        self._wanted.clear()

    def content(self, file: AssetFile) -> AssetContent | None:
        """What a file holds; None while it is not known, then it will be."""
        known = self._contents.get(file.path)
        if known is not None and known.file.version == file.version:
            return known
        self._want(file)
        return None

    def picture(self, file: AssetFile) -> Pixels | None:
        """The thumbnail, RGBA (H, W, 4); None while there is none."""
        if file.version in self._pictures:
            self._pictures.move_to_end(file.version)
            return self._pictures[file.version]
        if file.version not in self._undrawn:
            self._want(file)
        return None

    def is_waiting(self, file: AssetFile) -> bool:
        """Whether its thumbnail is still to come."""
        return file.version in self._wanted

    def uses(self, content: AssetContent) -> list[Use]:
        """Who in the scene uses what a file holds, or is an instance of it; of a scene that changes, a moment ago."""
        index = self.placing.uses
        if not index.is_fresh and not self._looks_for_uses:
            self._looks_for_uses = True
            self._model.session.start(self._look_for_uses())
        return index.known((*content.references, content.file.path.absolute().as_posix()))

    # --- giving ----------------------------------------------------------------------------------------------------

    def is_at_host(self, file: AssetFile) -> bool:
        """Whether a field may name what a file holds: the host has the content."""
        return file.version in self._at_host

    def give(self, file: AssetFile) -> None:
        """Gives the host what a file holds: somebody is about to use it."""
        if file.version not in self._at_host:
            self._model.session.start(self._give(file))

    def look_for_missing(self) -> None:
        """Brings `missing` up to date, at once or, when it was looked for a moment ago, at the next call."""
        if not self._looks_for_missing:
            self._looks_for_missing = True
            self._model.session.start(self._look_for_missing())

    # --- inside ----------------------------------------------------------------------------------------------------

    def _told(self, changed: list[AssetFile]) -> None:
        """On the folder's thread."""
        folder, loop = self.folder, self._loop
        if loop is not None and not loop.is_closed():
            loop.call_soon_threadsafe(self._folder_changed, folder, changed)

    def _folder_changed(self, folder: AssetFolder | None, changed: list[AssetFile]) -> None:
        if self.folder is None or (folder is not None and folder is not self.folder):
            return  # of one that was closed meanwhile
        present = {file.path for file in self.listing.files}
        for path in [path for path in self._contents if path not in present]:
            del self._contents[path]
        self._plan_reading()
        for file in changed:
            before = self._followed.get(file.path)
            if before is not None and self.reloads and not self._model.is_replay:
                self._model.session.start(self._reload(before, file))
        self._show()
        self._work()

    def _plan_reading(self) -> None:
        instances = {entity.prefab for entity in self._model.scene.mirror.entities.values() if entity.prefab}
        budget = READ_AHEAD
        self._read_ahead.clear()
        for file in self.listing.files:
            known = self._contents.get(file.path)
            if known is not None:  # one that changed is read by `_reload`, or when it is seen
                continue
            if file.type in ("image", "light") and file.size <= budget:
                budget -= file.size
            elif file.path.absolute().as_posix() not in instances:
                continue
            self._read_ahead.append(file)
        self._read_ahead.reverse()  # taken from the end

    def _want(self, file: AssetFile) -> None:
        self._wanted.setdefault(file.version, file)
        self._work()

    def _work(self) -> None:
        if self._loop is not None and (self._working is None or self._working.done()):
            self._working = self._loop.create_task(self._work_off())

    async def _work_off(self) -> None:
        while self._wanted or self._read_ahead:
            if self._wanted:
                version = next(iter(self._wanted))
                file = self._wanted.pop(version)
                await self._picture_of(file)
                self._show()
            else:
                file = self._read_ahead.pop()
                if file.path not in self._contents:
                    self._learn((await asyncio.to_thread(read_asset, file, AssetStore()))[0])

    async def _picture_of(self, file: AssetFile) -> None:
        """Reads a file and makes its thumbnail, or finds out that there is none."""
        cache = self._cache if self._cache is not None else await asyncio.to_thread(ThumbnailCache)
        self._cache = cache
        content, drawn = await asyncio.to_thread(_read_and_draw, file, cache)
        if isinstance(drawn, str):
            self._keep(file, None)
            content = dataclasses.replace(content, note=drawn)
        self._learn(content)
        if isinstance(drawn, str):
            return
        if isinstance(drawn, ThumbnailRequest):
            await self._ask_for(file, content, drawn, cache)
        else:
            self._keep(file, drawn)

    async def _ask_for(
        self, file: AssetFile, content: AssetContent, request: ThumbnailRequest, cache: ThumbnailCache
    ) -> None:
        nodes = self._model.session.nodes_of("render")
        if not nodes:
            self._undrawn.add(file.version)
            return
        try:
            reply = await self._model.session.request(
                topics.THUMBNAIL, request, key=nodes[-1].id, timeout=THUMBNAIL_TIMEOUT
            )
            pixels = await asyncio.to_thread(decoded, reply.jpeg)
        except ConnectionLost:
            self._undrawn.add(file.version)
        except (BusError, AssetError) as error:
            self._keep(file, None)
            self._learn(dataclasses.replace(content, note=str(error)))
        else:
            self._keep(file, pixels)
            await asyncio.to_thread(cache.put, content.key, pixels)

    def _learn(self, content: AssetContent) -> None:
        self._contents[content.file.path] = content
        if not content.error:
            self._followed.setdefault(content.file.path, content)

    def _keep(self, file: AssetFile, pixels: Pixels | None) -> None:
        self._pictures[file.version] = pixels
        while len(self._pictures) > KEPT_PICTURES:
            self._pictures.popitem(last=False)

    async def _give(self, file: AssetFile) -> None:
        store = AssetStore()
        content, _ = await asyncio.to_thread(read_asset, file, store)
        if not content.error and await self.placing.bring(content.references, store, file.name):
            self._at_host.add(file.version)
            self._show()

    async def _reload(self, before: AssetContent, file: AssetFile) -> None:
        content, _ = await self.placing.reload(before, file)
        self._contents[file.path] = content
        if content.error:  # it is compared with what was there last when it can be read again
            self._model.say("warning", content.error)
        else:
            self._followed[file.path] = content
        self._show()

    async def _look_for_missing(self) -> None:
        mirror = self._model.scene.mirror
        self.missing_of = (mirror.epoch, mirror.sequence)
        try:
            self.missing = await missing_assets(self.placing.uses, self.placing.offer)
            self.missing_error = ""
        except BusError as error:
            self.missing, self.missing_error = None, str(error)
        self._show()
        await asyncio.sleep(LOOK_INTERVAL)
        self._looks_for_missing = False
        self._show()

    async def _look_for_uses(self) -> None:
        await self.placing.uses.fresh()
        self._show()
        await asyncio.sleep(LOOK_INTERVAL)
        self._looks_for_uses = False
        if not self.placing.uses.is_fresh:
            self._show()

    def _node_changed(self, node: Node, alive: bool) -> None:
        if node.kind == "render" and alive and self._undrawn:
            self._undrawn.clear()
            self._show()

    def _show(self) -> None:
        self.changed += 1
        self._model.request_redraw(0.05)


def _read_and_draw(
    file: AssetFile, cache: ThumbnailCache
) -> tuple[AssetContent, Pixels | ThumbnailRequest | str | None]:
    """On a thread: what a file holds, and its thumbnail, or what to ask a render node for, or why there is none."""
    store = AssetStore()
    content, records = read_asset(file, store)
    if content.error or file.type == "heights":
        return content, None
    kept = cache.get(content.key)
    if kept is not None:
        return content, kept
    try:
        if file.type == "image":
            pixels = image_thumbnail(store.get(content.parts[""]))
            cache.put(content.key, pixels)
            return content, pixels
        return content, thumbnail_request(file, records, store)
    except AssetError as error:
        return content, str(error)
