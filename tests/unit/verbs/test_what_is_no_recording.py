"""Files that are no recordings, to every verb that takes one; and places where nothing can be written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from mcap.writer import Writer

VERBS = {
    "info": ("info", "{}"),
    "export": ("export", "{}", "out.npz"),
    "export glb": ("export", "{}", "out.glb"),
    "cut": ("cut", "{}", "-o", "out.mcap"),
    "merge": ("merge", "{}", "{}", "-o", "out.mcap"),
    "recover": ("recover", "{}"),
    "render": ("render", "{}", "-o", "out.png"),
    "play": ("play", "{}"),
    "play --edit": ("play", "{}", "--edit"),
}
MAGIC = b"\x89MCAP0\r\n"


def foreign(path: Path) -> None:
    """A whole MCAP file of somebody else's."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        channel = writer.register_channel("/camera", "json", schema)
        for time in range(10):
            writer.add_message(channel, time, b"{}", time)
        writer.finish()


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "cannot be opened: No such file"),
        (b"", "is empty"),
        (bytes(range(256)) * 50, "is no recording: it does not start as an MCAP file does"),
        (MAGIC, "holds nothing that can be read"),
        (MAGIC + bytes(range(256)) * 50, "holds nothing that can be read"),
        ("foreign", "is an MCAP file, but no recording of ELYS"),
        ("directory", "Is a directory"),
    ],
    ids=["missing", "empty", "garbage", "head", "garbage behind a head", "foreign", "directory"],
)
def test_what_is_no_recording(elys, tmp_path: Path, verb: str, content: bytes | str | None, expected: str) -> None:
    path = tmp_path / "it.mcap"
    match content:
        case bytes():
            path.write_bytes(content)
        case "foreign":
            foreign(path)
        case "directory":
            path.mkdir()
    sentence = elys(*(word.format("it.mcap") for word in VERBS[verb])).sentence
    assert "it.mcap" in sentence
    assert expected in sentence
    left = {path.name for path in tmp_path.iterdir()} - {"it.mcap", "runtime"}
    assert not left


def test_a_recording_that_is_missing_has_a_remedy(elys, tmp_path: Path) -> None:
    assert elys("info", "it.mcap").sentence.endswith("`elys run SCENE --record FILE.mcap` makes one")
    for moment in range(5):
        foreign(tmp_path / f"other{moment}.mcap")
        os.utime(tmp_path / f"other{moment}.mcap", (moment, moment))
    said = elys("info", "it.mcap").sentence
    assert said.endswith(f"in {tmp_path} there are other4.mcap, other3.mcap, other2.mcap and 2 more, newest first")


@pytest.mark.parametrize("output", ["it.mcap", "out.txt", "out", "."])
def test_arrays_go_into_a_file_of_their_own_kind(elys, tmp_path: Path, output: str) -> None:
    """Above all not over the recording itself."""
    foreign(tmp_path / "it.mcap")
    before = (tmp_path / "it.mcap").read_bytes()
    assert "give it the suffix .npz" in elys("export", "it.mcap", output).sentence
    assert (tmp_path / "it.mcap").read_bytes() == before
