"""Sounds as the bytes of their files: decoded where they are heard, not here."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Final

from elys.common.assets.images import read_asset_file
from elys.common.assets.store import AssetStore
from elys.common.components.sound import BUILT_IN_SOUNDS
from elys.common.errors import AssetError

SOUND_SUFFIXES: Final = (".wav", ".ogg", ".flac", ".mp3")


def sound_format(data: bytes) -> str:
    """What kind of sound file the bytes are, by their first ones: "wav", "ogg", "flac", "mp3", or "" for none."""
    if data[:4] == b"RIFF" and data[8:12] == b"WAVE":
        return "wav"
    if data[:4] == b"OggS":
        return "ogg"
    if data[:4] == b"fLaC":
        return "flac"
    # Tags, or the eleven bits with which each frame begins.
    if data[:3] == b"ID3" or (len(data) > 1 and data[0] == 0xFF and data[1] & 0xE0 == 0xE0 and data[1] & 0x06):
        return "mp3"
    return ""


def no_sound(name: str) -> str:
    """Says that a name is no sound, and what would be one."""
    close = difflib.get_close_matches(name.lower(), BUILT_IN_SOUNDS, n=1, cutoff=0.6)
    remedy = f"did you mean '{close[0]}'?" if close else f"built in are {', '.join(BUILT_IN_SOUNDS)}"
    return f"{name!r} is no sound that is built in and no file of one ({', '.join(SOUND_SUFFIXES)}); {remedy}"


def read_sound(path: Path, assets: AssetStore) -> str:
    """Puts a sound file into the store and returns its reference; raises AssetError if it is missing or no sound."""
    data = read_asset_file(path, what="sound")
    if not sound_format(data):
        raise AssetError(f"{path} is not a sound that ELYS knows ({', '.join(SOUND_SUFFIXES)})")
    return assets.put(data, kind="sound", source=str(path))
