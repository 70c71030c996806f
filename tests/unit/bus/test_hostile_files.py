"""Whatever a file is made of: a right result or one clear sentence, within bounded memory and time."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from elys.bus.messages.commands import SetComponent
from elys.bus.recording import Recording
from elys.bus.transports.mcap_reading import McapReader
from elys.common.assets.store import is_reference, reference_of
from elys.common.errors import RecordingError
from tests.recorded_sessions import in_short_chunks, recorded
from tests.unit.bus.hostile_files import Message, hostile
from tests.unit.bus.told_recordings import IMAGE, PICTURE_MESH, TICKS, messages, write_told

FILES, SOAKED = 100, 2000
SESSIONS = 5  # as many times fewer of a session that can be run again: that takes its time
BATCH = 50
ROOT = Path(__file__).parents[3]


def told_file(folder: Path) -> tuple[Path, list[Message], list[tuple[str, bytes]]]:
    """What the files of motion in closed form are made of."""
    attachments = [(reference_of(data), data) for data in (PICTURE_MESH, IMAGE)]
    return write_told(folder / "told", chunk=5000), list(messages(last=40)), attachments


def session_file(folder: Path) -> tuple[Path, list[Message], list[tuple[str, bytes]]]:
    """What the files of a session are made of, which holds exact states and commands."""

    async def session() -> Path:
        async with recorded(folder, outside=False) as stage:
            anna = await stage.person("Anna")
            await anna.step(20)
            body = int(stage.simulation.moving_bodies().entity[3])
            await anna.do(SetComponent(entity=body, component="Transform", values={"position": [0.2, 7.0, 0.1]}))
            await anna.step(20)
        return stage.beside

    path = in_short_chunks(asyncio.run(session()), folder / "session")
    with McapReader(path) as reader:
        told = [(message.channel, message.body, message.log_time) for message in reader.messages()]
        attachments = [(name, reader.attachment(name)) for name in reader.attachments if is_reference(name)]
    return path, told, attachments


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("make", [told_file, session_file])
def test_no_file_crashes_hangs_or_eats_the_memory(tmp_path: Path, soak: bool, make: Callable[[Path], Any]) -> None:
    source, told, attachments = make(tmp_path)
    whole = source.read_bytes()
    with Recording(source) as recording:
        truth: dict[int, set[bytes]] = {}
        for position, tick in enumerate(recording.tick.tolist()):
            truth.setdefault(tick, set()).add(recording.frame_body(position))
    outcomes: dict[str, list[int]] = {}
    count = (SOAKED if soak else FILES) // (1 if make is told_file else SESSIONS)
    for start in range(0, count, BATCH):
        folder = tmp_path / "files"
        folder.mkdir()
        kinds = {}
        for seed in range(start, min(start + BATCH, count)):
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
    assert sum(map(sum, outcomes.values())) == count
    # Both ends are met: some files are refused, and of those that were merely cut most can be read.
    assert all(refused for kind, (refused, _) in outcomes.items() if kind in ("bomb", "foreign"))
    if make is told_file:  # a session of half a second is mostly the state at its beginning
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


def check(path: Path, kind: str, said: dict[str, str], truth: dict[int, set[bytes]]) -> None:
    for way, sentence in said.items():
        assert not sentence.startswith("CRASH"), f"{kind} {path.name} {way}: {sentence}"
        assert len(sentence) < 700 and "\n" not in sentence and "Traceback" not in sentence, (kind, path.name, sentence)
        if sentence and way not in ("verify", "fork"):  # those are also told what of the simulation's state is wrong
            assert path.name in sentence or "model" in sentence, (kind, path.name, way, sentence)
    if kind in (
        "cut",
        "flipped",
        "overwritten",
        "spliced",
        "lying",
    ):  # checksums tell: what is read is what was written
        try:
            with Recording(path, checked=True) as recording:
                for position, tick in enumerate(recording.tick.tolist()):
                    assert recording.frame_body(position) in truth[tick], (kind, path.name, tick)
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
