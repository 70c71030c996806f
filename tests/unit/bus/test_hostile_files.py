"""Whatever a file is made of: a right result or one clear sentence, within bounded memory and time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from elys.bus.recording import Recording
from elys.common.assets.store import reference_of
from elys.common.errors import RecordingError
from tests.unit.bus.hostile_files import hostile
from tests.unit.bus.told_recordings import IMAGE, PICTURE_MESH, TICKS, messages, write_told

FILES, SOAKED = 100, 2000
BATCH = 50
ROOT = Path(__file__).parents[3]


@pytest.mark.timeout(1800)
def test_no_file_crashes_hangs_or_eats_the_memory(tmp_path: Path, soak: bool) -> None:
    whole = write_told(tmp_path / "told", chunk=5000).read_bytes()
    told = list(messages(last=40))
    attachments = [(reference_of(data), data) for data in (PICTURE_MESH, IMAGE)]
    with Recording(tmp_path / "told") as recording:
        truth = {tick: recording.frame_body(position) for position, tick in enumerate(recording.tick.tolist())}
    outcomes: dict[str, list[int]] = {}
    for start in range(0, SOAKED if soak else FILES, BATCH):
        folder = tmp_path / "files"
        folder.mkdir()
        kinds = {}
        for seed in range(start, start + BATCH):
            kind, data = hostile(seed, whole, told, attachments)
            kinds[f"{seed:05}.mcap"] = kind
            (folder / f"{seed:05}.mcap").write_bytes(data)
        for file, said in opened(folder).items():
            check(folder / file, kinds[file], said, truth)
            done = outcomes.setdefault(kinds[file], [0, 0])
            done[not said["info"]] += 1
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
    assert sum(map(sum, outcomes.values())) == (SOAKED if soak else FILES)
    # Both ends are met: some files are refused, and of those that were merely cut most can be read.
    assert all(refused for kind, (refused, _) in outcomes.items() if kind in ("bomb", "foreign"))
    assert outcomes["cut"][1] > outcomes["cut"][0]


def opened(folder: Path) -> dict[str, dict[str, str]]:
    """What a process with little memory says of each file of a folder."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.unit.bus.hostile_files", str(folder)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
        timeout=600,
        check=False,
    )
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, (lines[-1:], done.stderr[-3000:])
    return {line["file"]: line["said"] for line in lines}


def check(path: Path, kind: str, said: dict[str, str], truth: dict[int, bytes]) -> None:
    for way, sentence in said.items():
        assert not sentence.startswith("CRASH"), f"{kind} {path.name} {way}: {sentence}"
        assert len(sentence) < 700 and "\n" not in sentence and "Traceback" not in sentence, (kind, path.name, sentence)
        if sentence:
            assert path.name in sentence or "model" in sentence, (kind, path.name, way, sentence)
    if kind in (
        "cut",
        "flipped",
        "overwritten",
        "spliced",
        "lying",
    ):  # checksums tell: what is read is what was written
        try:
            with Recording(path) as recording:
                for position, tick in enumerate(recording.tick.tolist()):
                    assert recording.frame_body(position) == truth[tick], (kind, path.name, tick)
        except RecordingError:
            pass


def test_a_cut_file_has_all_that_stood_before_the_cut(tmp_path: Path) -> None:
    """Of a file cut at any chunk's end every frame before it is there."""
    whole = write_told(tmp_path / "told.mcap", chunk=3000)
    with Recording(whole) as recording:
        ends = [sum(recording.reader.chunk_place(number)) for number in range(recording.reader.chunk_count)]
        chunk_of = [recording.place(position).chunk for position in range(len(recording))]
    data = whole.read_bytes()
    assert len(ends) > 10
    for number, end in list(enumerate(ends))[chunk_of[0] :]:
        (tmp_path / "cut.mcap").write_bytes(data[:end])
        with Recording(tmp_path / "cut.mcap") as cut:
            assert len(cut) == sum(chunk <= number for chunk in chunk_of)
    assert len(cut) == TICKS + 1
