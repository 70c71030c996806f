"""What the fields of components that name assets hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from elys.common.assets.store import AssetKind

# Ground may be named where it is collided with, and where it is drawn.
_KINDS: Final[Mapping[str, AssetKind]] = {
    "mesh": "mesh",
    "heights": "heights",
    "clips": "clips",
    "skin": "skin",
    "source": "script",
    "sound": "sound",
}


def expected_kind(field_name: str) -> AssetKind | None:
    """What an ASSET field of that name holds; None where nothing says so."""
    if field_name.endswith("_texture") or field_name == "image":
        return "image"
    return _KINDS.get(field_name)
