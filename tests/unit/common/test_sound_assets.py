"""Sounds that scenes name: built in, or files beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

from elys.common.assets import AssetStore
from elys.common.assets.sounds import sound_format
from elys.common.errors import SceneError
from elys.common.scene import EntityNode, SceneDocument
from elys.common.scene_expansion import expand

WAV = b"RIFF\x24\0\0\0WAVEfmt "


def sound_in(folder: Path, name: str, store: AssetStore) -> str:
    node = EntityNode(name="Bell", components={"SoundSource": {"sound": name}})
    (record,) = expand(SceneDocument(entities=[node]), directory=folder, assets=store)
    return str(record.components["SoundSource"]["sound"])


def test_a_scene_names_built_in_sounds_and_files(tmp_path: Path) -> None:
    store = AssetStore()
    (tmp_path / "bell.wav").write_bytes(WAV)
    assert sound_in(tmp_path, "chime", store) == "chime"
    reference = sound_in(tmp_path, "bell.wav", store)
    assert store.get(reference) == WAV
    assert store.kind(reference) == "sound"
    assert sound_in(tmp_path, reference, store) == reference


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("chimes", "did you mean 'chime'?"),
        ("box", "'box' is no sound that is built in and no file of one"),
        ("missing.ogg", "missing.ogg"),
        ("text.wav", "is not a sound that ELYS knows"),
        ("picture.png", "is no sound that is built in"),
    ],
)
def test_what_is_no_sound_is_refused(tmp_path: Path, name: str, expected: str) -> None:
    (tmp_path / "text.wav").write_text("hello")
    with pytest.raises(SceneError, match="entities") as raised:
        sound_in(tmp_path, name, AssetStore())
    assert expected in str(raised.value)


def test_files_are_told_by_their_first_bytes() -> None:
    heads = (WAV, b"OggS\0", b"fLaC\0", b"ID3\x03", b"\xff\xfb\x90\x00", b"\xff\xd8\xff\xe0", b"", b"\xff")
    assert [sound_format(head) for head in heads] == ["wav", "ogg", "flac", "mp3", "mp3", "", "", ""]
