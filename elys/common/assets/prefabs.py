"""Prefabs as assets: the records of one, so that what a script spawns is content that a recording holds."""

from __future__ import annotations

import msgspec

from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError
from elys.common.scene_document import EntityRecord


def put_prefab(records: list[EntityRecord], assets: AssetStore, *, source: str = "") -> str:
    """Puts the records of a prefab into the store and returns its reference."""
    return assets.put(msgspec.json.encode(records), kind="prefab", source=source)


def decode_prefab(data: bytes) -> list[EntityRecord]:
    """Records from their bytes, the root first; AssetError for what is no prefab."""
    try:
        records = msgspec.json.decode(data, type=list[EntityRecord])
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise AssetError(f"this is no prefab ({error})") from error
    if not records:
        raise AssetError("this is no prefab: nobody is in it")
    return records
