"""Assets over the bus: the host answers with the bytes a content hash names; who lacks them asks once and keeps them.

On the bus the key of an asset is the digits of its reference. What arrives is checked against them before anyone sees it.
"""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import msgspec
import platformdirs

from elys.bus import topics
from elys.bus.access.limits import MAX_MESSAGE_SIZE
from elys.bus.session import Session
from elys.bus.transports.transport import Closer
from elys.common.assets.store import PREFIX, AssetKind, AssetStore, is_reference, reference_of, references_in
from elys.common.errors import AssetError, MessageError
from elys.common.scene_document import EntityRecord

ASSET_TIMEOUT: Final = 30.0  # [s] a large mesh over a slow line
CACHE_SIZE: Final = 4 << 30  # [bytes] above which the files used longest ago are thrown away
_HAS: Final = b"has"
_WANTS: Final = b"wants"
_log = logging.getLogger(__name__)


def serve_assets(session: Session, store: AssetStore) -> Closer:
    """Answers every ASSET request from `store`; what is not in it is refused with a sentence.

    What somebody offers is taken into it: who pastes a part of another scene brings along what that needs.
    """

    async def answer(request: bytes, key: str) -> bytes:
        data = store.get(PREFIX + key)
        if len(data) > MAX_MESSAGE_SIZE - 4096:
            raise AssetError(f"asset {PREFIX}{key} has {len(data) >> 20} MiB, more than one message may carry")
        return data

    async def take(data: bytes, key: str) -> bytes:
        if data and not store.has(PREFIX + key):
            if reference_of(data) != PREFIX + key:
                raise MessageError(f"what was offered as {PREFIX + key} is other content ({reference_of(data)})")
            store.put(data, kind="mesh")
        return _HAS if store.has(PREFIX + key) else _WANTS

    closers = (session.serve(topics.ASSET, answer), session.serve(topics.ASSET_OFFER, take))

    def close() -> None:
        for closer in closers:
            closer()

    return close


def lacking_assets(store: AssetStore, records: Sequence[EntityRecord]) -> list[str]:
    """What records name that a store has not got."""
    named = references_in(msgspec.json.encode([record.components for record in records]))
    return [reference for reference in named if not store.has(reference)]


async def offer_assets(session: Session, store: AssetStore, records: Sequence[EntityRecord]) -> None:
    """Gives the host what records name and it lacks.

    Raises:
        AssetError: it is not here either, or too large for one message. BusError: the host refuses it, or is gone.
    """
    offer = AssetOffer(session)
    for reference in references_in(msgspec.json.encode([record.components for record in records])):
        if not await offer.bring(reference, store):
            raise AssetError(f"asset {reference} is neither with the host nor here")


def cache_directory() -> Path:
    """Where assets of other machines are kept: $ELYS_CACHE_DIR/assets, or in the user's cache directory."""
    chosen = os.environ.get("ELYS_CACHE_DIR")
    return (Path(chosen) if chosen else Path(platformdirs.user_cache_dir("elys"))) / "assets"


def open_asset_cache(*, max_size: int = CACHE_SIZE) -> AssetStore:
    """A store over the cache directory, first brought below `max_size` bytes. Raises AssetError if it cannot be made."""
    folder = cache_directory()
    store = AssetStore(folder)
    files = sorted(
        ((path.stat(), path) for path in folder.iterdir() if path.is_file()), key=lambda one: one[0].st_mtime
    )
    size = sum(stat.st_size for stat, _ in files)
    for stat, path in files:
        if size <= max_size:
            break
        path.unlink(missing_ok=True)
        size -= stat.st_size
    return store


class AssetClient:
    """Gets assets that this node lacks from the session's host, each once."""

    def __init__(self, session: Session, store: AssetStore) -> None:
        self._session = session
        self._store = store
        self._under_way: dict[str, asyncio.Task[bytes]] = {}

    async def fetch(self, reference: str, *, kind: AssetKind = "mesh") -> bytes:
        """The content named `reference`, from the store or else from the host.

        Raises:
            RequestError: the host has no such asset. MessageError: what came is not what the reference names.
            ConnectionLost: the host does not answer. AssetError: this is no reference, or the cache cannot be written.
        """
        if not is_reference(reference):
            raise AssetError(f"{reference!r} names no asset: a reference is {PREFIX} and 32 hex digits")
        task = self._under_way.get(reference)
        if task is None:
            task = asyncio.create_task(self._get(reference, kind))
            self._under_way[reference] = task
            task.add_done_callback(lambda _: self._under_way.pop(reference, None))
        # One asker who gives up must not take the answer from the others.
        return await asyncio.shield(task)

    async def _get(self, reference: str, kind: AssetKind) -> bytes:
        if self._store.has(reference):
            try:
                return await asyncio.to_thread(self._store.get, reference)
            except AssetError as error:
                _log.warning("%s; asking the host for it", error)
        data = await self._session.request(topics.ASSET, b"", key=reference.removeprefix(PREFIX), timeout=ASSET_TIMEOUT)
        if reference_of(data) != reference:
            raise MessageError(f"the host answered {reference} with other content ({reference_of(data)})")
        await asyncio.to_thread(self._store.put, data, kind=kind)
        return data


class AssetOffer:
    """Brings the host content that it lacks."""

    def __init__(self, session: Session) -> None:
        self._session = session

    async def is_there(self, reference: str) -> bool:
        """Whether the host has the content; BusError where it does not say."""
        return await self._ask(reference, b"")

    async def bring(self, reference: str, store: AssetStore) -> bool:
        """Whether the host has the content, now that it was given what `store`, or else this machine's cache, has of it.

        Raises:
            AssetError: it is too large for one message.
            BusError: the host does not answer, or takes no offers.
        """
        if await self._ask(reference, b""):
            return True
        for known in (store, open_asset_cache()):
            try:
                data = await asyncio.to_thread(known.get, reference)
            except AssetError:
                continue
            if len(data) > MAX_MESSAGE_SIZE - 4096:
                raise AssetError(f"asset {reference} has {len(data) >> 20} MiB, more than one message may carry")
            return await self._ask(reference, data)
        return False

    async def _ask(self, reference: str, data: bytes) -> bool:
        key = reference.removeprefix(PREFIX)
        reply = await self._session.request(topics.ASSET_OFFER, data, key=key, timeout=ASSET_TIMEOUT)
        return reply == _HAS
