"""export, cut, merge, recover and info on the command line: what they say, and times as people write them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from elys.bus.recording import Recording
from elys.common.errors import ElysError
from elys.verbs.moments import parse_moment
from tests.unit.bus.told_recordings import TICKS, write_told


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("2", 2.0),
        ("2s", 2.0),
        ("0", 0.0),
        ("0s", 0.0),
        ("500ms", 0.5),
        ("1m30s", 90.0),
        ("1min 30 s", 90.0),
        ("1m2", 62.0),
        ("2h", 7200.0),
        ("1.5m", 90.0),
        (".25", 0.25),
        ("-1s", -1.0),
        ("", 7.0),
    ],
)
def test_times_as_people_write_them(text: str, seconds: float) -> None:
    assert parse_moment(text, otherwise=7.0) == pytest.approx(seconds)


@pytest.mark.parametrize("text", ["x", "1x", "s", "1 2", "-", "--1", "nan", "inf", "1e5", "1:30"])
def test_what_is_no_time_is_said(text: str) -> None:
    with pytest.raises(ElysError, match="is no time"):
        parse_moment(text)


def test_parts_and_the_whole(elys, tmp_path: Path) -> None:
    write_told(tmp_path / "run.mcap")
    for words in (("--to", "1s", "-o", "a.mcap"), ("--from", "800ms", "-o", "b.mcap")):
        done = elys("cut", "run.mcap", *words)
        assert done.status == 0 and "ticks" in done.out
    done = elys("merge", "a.mcap", "b.mcap", "-o", "c.mcap")
    assert f"c.mcap: {TICKS + 1} ticks, 2.00 s" in done.out
    assert "were in several of them and are there once" in done.out
    told = elys("info", "c.mcap").out
    assert "made by merge of a.mcap, 0.00 s to 1.00 s (ticks 0 to 60)" in told
    assert "  made by cut of run.mcap" in told
    facts = json.loads(elys("info", "c.mcap", "--json").out)
    assert facts["health"]["missing_ticks"] == 0 and facts["sources"]["made_by"] == "merge"


def test_what_is_recorded_keeps_what_was_there(elys, tmp_path: Path) -> None:
    words = ("run", "stack", "--headless", "--steps", "20", "--record", "s.mcap")
    first = elys(*words)
    assert first.status == 0 and "\ns.mcap: " in first.out
    before = (tmp_path / "s.mcap").read_bytes()
    again = elys(*words, "--json")
    assert "s.mcap is there already: recording to s-2.mcap" in again.err
    report = json.loads(again.out)
    assert report["recording"] == "s-2.mcap"
    assert report["recording_size"] == (tmp_path / "s-2.mcap").stat().st_size > 0
    assert (tmp_path / "s.mcap").read_bytes() == before
    over = elys(*words, "--overwrite")
    assert over.status == 0 and "\ns.mcap: " in over.out
    assert (tmp_path / "s.mcap").read_bytes() != before
    with Recording(tmp_path / "s.mcap") as recording:
        assert recording.tick.tolist()[-1] == 20
    assert sorted(path.name for path in tmp_path.glob("*.mcap")) == ["s-2.mcap", "s.mcap"]


def test_what_can_be_made_again_is_not_written_over_unless_asked(elys, tmp_path: Path) -> None:
    write_told(tmp_path / "run.mcap")
    precious = tmp_path / "o.mcap"
    verbs = (("cut", "run.mcap", "--to", "1s"), ("merge", "run.mcap"), ("fork", "run.mcap", "--at", "1s"))
    for words in verbs:
        precious.write_text("precious")
        sentence = elys(*words, "-o", "o.mcap").sentence
        assert "o.mcap is there already: move it away, name another file, or give --overwrite" in sentence
        assert precious.read_text() == "precious"
    for words in verbs[:2]:
        assert elys(*words, "-o", "o.mcap", "--overwrite").status == 0
    precious.write_bytes((tmp_path / "run.mcap").read_bytes())
    pytest.importorskip("foxglove")
    assert "is a recording, and would be lost" in elys("export", "run.mcap", "o.mcap", "--foxglove").sentence
    assert precious.read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_recovering_says_what_is_lost(elys, tmp_path: Path) -> None:
    whole = write_told(tmp_path / "run.mcap", chunk=3000).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    said = elys("info", "cut.mcap").out
    assert "cut off: read as far as it goes" in said and "`elys recover` mends it" in said
    done = elys("recover", "cut.mcap")
    assert done.status == 0
    assert "cut.recovered.mcap: " in done.out and "where it was cut off" in done.out
    assert "is there already" in elys("recover", "cut.mcap").sentence
    assert "the damaged file is cut.mcap.bak" in elys("recover", "cut.mcap", "--in-place").out
    assert "is whole: there is nothing to mend" in elys("recover", "cut.mcap").out
    assert "give one of them" in elys("recover", "cut.mcap", "--in-place", "-o", "x.mcap").sentence


def test_damage_in_a_whole_file_is_said_with_its_ticks_and_a_remedy(elys, tmp_path: Path, caplog) -> None:
    path = write_told(tmp_path / "run.mcap", chunk=3000)
    with Recording(path) as recording:
        offset, length = recording.reader.chunk_place(recording.place(70).chunk)
    data = bytearray(path.read_bytes())
    data[offset + length - 40] ^= 1
    path.write_bytes(data)
    info = elys("info", "run.mcap")
    health = next(line for line in info.out.splitlines() if line.startswith("health: "))
    assert "damaged: read without what is lost" in info.out
    named = re.search(r"ticks (\d+) to (\d+) \(.* s to .* s\) cannot be read", health)
    assert named is not None and int(named[1]) <= 70 <= int(named[2])
    assert "`elys recover`" in health
    for words in (("info", "run.mcap"), ("export", "run.mcap", "o.csv")):
        caplog.clear()
        assert elys(*words).status == 0
        said = [record.getMessage() for record in caplog.records]
        assert len(said) == 1 and "`elys recover run.mcap` writes a whole file" in said[0] and named[0] in said[0], said
    caplog.clear()
    done = elys("recover", "run.mcap", "-o", "whole.mcap")
    assert f"missing in it: ticks {named[1]} to {named[2]}" in done.out
    assert "ticks are missing" in elys("info", "whole.mcap").out and not caplog.records
    compared = elys("diff", "run.mcap", "whole.mcap")
    assert compared.status == 0 and compared.err.count("`elys recover run.mcap` writes a whole file") == 1


@pytest.mark.parametrize("name", ["o.npz", "o.csv", "o.parquet", "o.glb", "o.foxglove.mcap"])
def test_each_kind_of_file_is_written_by_its_suffix(elys, tmp_path: Path, name: str) -> None:
    pytest.importorskip({"o.parquet": "pyarrow", "o.foxglove.mcap": "foxglove"}.get(name, "numpy"))
    write_told(tmp_path / "run.mcap")
    done = elys("export", "run.mcap", name, "--from", "0.5s", "--to", "1s", "--rate", "10", "--entities", "Fall*")
    assert done.status == 0 and done.out.startswith(f"{name}: ")
    assert (tmp_path / name).stat().st_size > 500


def test_wrong_words_are_said(elys, tmp_path: Path) -> None:
    write_told(tmp_path / "run.mcap")
    assert "lies before --from" in elys("export", "run.mcap", "o.csv", "--from", "2s", "--to", "1s").sentence
    assert "give it the suffix .mcap" in elys("export", "run.mcap", "o.csv", "--foxglove").sentence
    assert "`elys render run.mcap -o o.mp4` makes" in elys("export", "run.mcap", "o.mp4").sentence
    assert "recordings have the suffix .mcap" in elys("cut", "run.mcap", "-o", "o.csv").sentence
    assert "cannot be written" in elys("export", "run.mcap", "nowhere/o.csv").sentence


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["run", "x", "--foxglove"], ["run", "x", "--foxglove", "8765"]),
        (["run", "--foxglove", "x"], ["run", "--foxglove", "8765", "x"]),
        (["run", "x", "--foxglove", "9000", "--headless"], ["run", "x", "--foxglove", "9000", "--headless"]),
        (["run", "x", "--foxglove", "--headless"], ["run", "x", "--foxglove", "8765", "--headless"]),
        (["export", "a.mcap", "b.mcap", "--foxglove"], ["export", "a.mcap", "b.mcap", "--foxglove"]),
    ],
)
def test_the_port_for_foxglove_may_be_left_out(words: list[str], expected: list[str]) -> None:
    from elys.__main__ import _with_default_port

    assert _with_default_port(words) == expected
