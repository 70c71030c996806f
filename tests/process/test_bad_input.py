"""Taken ports, cut recordings, full disks, no EGL and signals, on real processes: one sentence, and nobody else suffers."""

from __future__ import annotations

import asyncio
import os
import re
import resource
import signal
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus.messages.state_frame import HEADER
from elys.bus.recording import Recording
from elys.common.errors import ElysError
from tests.process.clients import client
from tests.process.conftest import Command, wait_until

pytestmark = pytest.mark.process


def the_sentence(command: Command, *, status: int = 1) -> str:
    """The last thing a command said before it ended in failure, in one line and without a traceback."""
    assert command.wait() == status, command.output
    assert "Traceback" not in command.output
    sentences = [line for line in command.lines if line.startswith("elys: ")]
    assert len(sentences) == 1, command.output
    assert command.lines[-1] == sentences[0], command.output
    return sentences[0]


def message_count(path: Path) -> int:
    """What the plain reader of the mcap package finds; it refuses a file that was not finished."""
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages())


def ticks_seen(endpoint: str, count: int) -> list[int]:
    """The ticks of so many frames of a running session."""

    async def watch() -> list[int]:
        async with client(endpoint) as watcher:
            await watcher.until(lambda: len(watcher.frames) >= count)
            return [frame.tick for frame in watcher.frames]

    return asyncio.run(watch())


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three seconds of the sample "stack", in several chunks, the first of which ends well before the half."""
    folder = tmp_path_factory.mktemp("recording")
    environment = {**os.environ, "ELYS_RUNTIME_DIR": str(folder), "PYTHONUNBUFFERED": "1"}
    words = ("run", "stack", "--headless", "--realtime", "--steps", "180", "--record", "whole.mcap")
    command = Command(words, environment, folder)
    assert command.wait() == 0, command.output
    return folder / "whole.mcap"


def test_a_taken_port_and_a_file_being_recorded_are_refused_and_their_owner_goes_on(elys, free_port, tmp_path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    owner = elys("run", "stack", "--headless", "--listen", endpoint, "--record", "it.mcap")
    owner.wait_for("first tick")
    (tmp_path / "old.mcap").write_bytes(b"somebody's only copy")
    intruders = {
        "is in use": elys("run", "stack", "--headless", "--listen", endpoint, "--record", "old.mcap"),
        "it.mcap is being recorded by another process": elys(
            "run", "stack", "--headless", "--record", "it.mcap", "--overwrite"
        ),
        "being recorded by another": elys("record", "--connect", endpoint, "-o", "it.mcap", "--overwrite"),
        "there is no display": elys("view", "--connect", endpoint),
        "no display": elys("edit", "--connect", endpoint),
    }
    for expected, intruder in intruders.items():
        assert expected in the_sentence(intruder)
    beside = elys("record", "--connect", endpoint, "-o", "it.mcap", "--seconds", "0.5")
    assert beside.wait() == 0, beside.output
    assert "it.mcap is there already: recording to it-2.mcap" in beside.output
    assert any(line.startswith("it-2.mcap") for line in beside.lines)
    assert len(set(ticks_seen(endpoint, 30))) >= 30
    owner.process.terminate()
    assert owner.wait() == 0
    assert message_count(tmp_path / "it.mcap") > 100
    assert message_count(tmp_path / "it-2.mcap") > 0
    assert (tmp_path / "old.mcap").read_bytes() == b"somebody's only copy"


def test_two_runs_live_side_by_side(elys, tmp_path) -> None:
    nobody = [
        elys(*words, "--connect", "tcp/127.0.0.1:9")
        for words in (("topic", "echo", "state"), ("record", "-o", "n.mcap"))
    ]
    twins = [elys("run", "stack", "--headless", "--name", f"twin-{n}", "--record", f"{n}.mcap") for n in "ab"]
    endpoints = [twin.wait_for(r"simulating .* at (\S+)")[1] for twin in twins]
    for twin in twins:
        twin.wait_for("first tick")
    listed = elys("sessions")
    assert listed.wait() == 0
    assert [line.split()[:3] for line in listed.lines if "twin" in line] == [
        [f"twin-{'ab'[endpoints.index(endpoint)]}", "simulation", endpoint]
        for endpoint in sorted(endpoints, key=listed.output.index)
    ]
    for twin in twins:
        twin.process.send_signal(signal.SIGINT)
        assert twin.wait() == 0
        assert "Traceback" not in twin.output
    assert message_count(tmp_path / "a.mcap") > 0 < message_count(tmp_path / "b.mcap")
    for command in nobody:
        assert "nobody answers at tcp/127.0.0.1:9" in the_sentence(command)
        assert "elys run SCENE" in command.output
    assert not (tmp_path / "n.mcap").exists()


def test_a_recording_cut_in_half_is_read_as_far_as_it_goes(elys, recording: Path, tmp_path) -> None:
    with recording.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    middle = chunks[len(chunks) // 2].chunk_start_offset + 10
    (tmp_path / "half.mcap").write_bytes(recording.read_bytes()[:middle])
    warning = "half.mcap was never finished: it is read as far as it is whole"
    info = elys("info", "half.mcap", "--json")
    export = elys("export", "half.mcap", "half.npz")
    render = elys("render", "half.mcap", "-o", "half.png", "--size", "64x64")
    play = elys("play", "half.mcap", "--loop")
    late = elys("render", recording, "-o", "late.png", "--time", "99")
    empty = elys("render", recording, "-o", "late.png", "--size", "0x64")
    for command in (info, export, render):
        assert command.wait() == 0, command.output
        assert warning in command.output
        assert "Traceback" not in command.output
    assert "lasts 3.00 s: there is nothing at 99 s" in the_sentence(late)
    assert "edges go from 1 to 32768" in the_sentence(empty)
    assert '"complete": false' in info.output
    assert (tmp_path / "half.png").stat().st_size > 100
    with np.load(tmp_path / "half.npz") as arrays:
        assert 10 < len(arrays["tick"]) < 180
        assert np.isfinite(arrays["position"]).all()
    endpoint = play.wait_for(r"playing half.mcap at (\S+):")[1]
    assert warning in play.output
    assert len(ticks_seen(endpoint, 20)) >= 20


def test_where_nothing_can_be_drawn_all_else_works(elys, free_port, recording: Path, tmp_path) -> None:
    (tmp_path / "no-vendors").mkdir()
    without_egl = {"__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path / "no-vendors")}
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", "stack", "--headless", "--listen", endpoint, "--record", "it.mcap", **without_egl)
    render = elys("render", recording, "-o", "it.png", **without_egl)
    doctor = elys("doctor", **without_egl)
    run.wait_for("first tick")
    node = elys("node", "render", "--connect", endpoint, **without_egl)
    for command in (render, node):
        sentence = the_sentence(command)
        assert "nothing can be drawn offscreen" in sentence
        assert "apt install" in sentence
    assert not (tmp_path / "it.png").exists()
    assert doctor.wait() == 0
    assert "cannot draw offscreen" in doctor.output
    assert len(ticks_seen(endpoint, 10)) >= 10
    run.process.terminate()
    assert run.wait() == 0
    assert message_count(tmp_path / "it.mcap") > 0


def test_a_full_disk_is_said_and_ends_nothing_else(elys, free_port, recording: Path, tmp_path) -> None:
    for name in ("it.mcap", "it.npz", "it.png", "it.mp4"):
        (tmp_path / name).symlink_to("/dev/full")
    commands = [
        elys("export", recording, "it.npz"),
        elys("render", recording, "-o", "it.png", "--size", "64x64"),
        elys("render", recording, "-o", "it.mp4", "--size", "64x64", "--duration", "0.1"),
    ]
    run = elys("run", "stack", "--headless", "--steps", "200", "--record", "it.mcap")
    for command in commands:
        assert "No space left on device" in the_sentence(command)
    assert the_sentence(run).startswith("elys: the recorder ended with status 1")
    assert "recorder: the recording it.mcap cannot be written any further: No space left on device" in run.output


def test_a_disk_that_fills_up_ends_the_recording_alone(elys, free_port, tmp_path) -> None:
    """With all that fitted, and with its summary, beside the simulation as from outside."""
    endpoint = f"tcp/127.0.0.1:{free_port}"
    # It moves as long as this takes: the summary alone is 100 kB, and chunks must make room for it here.
    run = elys("run", "yard", "--headless", "--keep", "0", "--listen", endpoint, "--record", "it.mcap")
    run.wait_for("first tick")
    outside = elys("record", "--connect", endpoint, "-o", "outside.mcap")
    (recorder,) = children_of(run.process.pid)
    limits = {}
    for name, process in (("it.mcap", recorder), ("outside.mcap", outside.process.pid)):
        wait_until_readable(tmp_path / name)
        wait_until(lambda name=name: (tmp_path / name).stat().st_size > 200_000)
        limits[name] = (tmp_path / name).stat().st_size + 400_000
        resource.prlimit(process, resource.RLIMIT_FSIZE, (limits[name],) * 2)
    run.wait_for("the recording it.mcap cannot be written any further: File too large; what fitted is whole")
    assert "outside.mcap cannot be written any further: File too large; what fitted is whole" in the_sentence(outside)
    assert len(ticks_seen(endpoint, 30)) >= 30
    assert "the session goes on without a recording" in run.output
    run.process.terminate()
    the_sentence(run)
    for name, limit in limits.items():
        assert 0.4 * limit < (tmp_path / name).stat().st_size <= limit
        check_ended_whole(elys, tmp_path / name)


def check_ended_whole(elys, path: Path) -> None:
    """Every tick is there from the first to the last, also for the library's own reader, and nothing calls it cut off."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        found = [HEADER.unpack_from(said.data)[1] for _, _, said in reader.iter_messages(topics=["state"])]
    assert len(found) > 15 and found == list(range(found[0], found[0] + len(found)))
    with Recording(path) as recording:
        assert not recording.reader.mended and recording.tick.tolist() == found
    info = elys("info", path.name)
    assert info.wait() == 0, info.output
    assert "complete" in info.output and "cut off" not in info.output


def wait_until_readable(path: Path) -> None:
    """Waits until there is so much of a recording that it can be read if nothing more is written."""

    def is_readable() -> bool:
        try:
            with Recording(path) as recording:
                return len(recording) > 0
        except ElysError:
            return False

    wait_until(is_readable)


def children_of(pid: int) -> list[int]:
    """The processes that a process has started."""
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    return sorted(int(child) for children in lists for child in children.read_text().split())


@pytest.mark.parametrize("stage", ["loading", "compiling"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_first_tick_ends_at_once_and_leaves_nothing(
    elys, tmp_path, stage: str, number: signal.Signals
) -> None:
    cache = {"ELYS_KERNEL_CACHE": str(tmp_path / "kernels")} if stage == "compiling" else {}
    run = elys("run", "stack", "--headless", "--record", "it.mcap", **cache)
    maps = Path(f"/proc/{run.process.pid}/maps")
    if stage == "loading":
        wait_until(lambda: "_multiarray_umath" in maps.read_text())
    else:
        wait_until(lambda: bool(children_of(run.process.pid)))  # the second process that compiles
    compilers = children_of(run.process.pid)
    run.process.send_signal(number)
    assert run.wait(seconds=20) in (130, -number)
    assert "Traceback" not in run.output
    assert not (tmp_path / "it.mcap").exists()
    wait_until(lambda: not any(is_alive(child) for child in compilers))


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_given_twice_still_leaves_a_whole_recording(elys, tmp_path, number: signal.Signals) -> None:
    run = elys("run", "stack", "--headless", "--record", "it.mcap")
    run.wait_for("first tick")
    (recorder,) = children_of(run.process.pid)
    run.process.send_signal(number)
    run.process.send_signal(number)
    assert run.wait() == 0, run.output
    assert "Traceback" not in run.output
    wait_until(lambda: not is_alive(recorder))
    assert message_count(tmp_path / "it.mcap") > 0


def test_kill_9_of_the_simulation_leaves_a_whole_recording(elys, free_port, tmp_path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", "stack", "--headless", "--listen", endpoint, "--record", "it.mcap")
    run.wait_for("first tick")
    (recorder,) = children_of(run.process.pid)
    outside = elys("record", "--connect", endpoint, "-o", "outside.mcap")
    outside.wait_for("recording Stack-of-10")
    ticks = ticks_seen(endpoint, 60)
    run.kill()
    wait_until(lambda: not is_alive(recorder))
    assert message_count(tmp_path / "it.mcap") > len(ticks)
    info = elys("info", "it.mcap", "--json")
    assert info.wait() == 0, info.output
    assert '"complete": true' in info.output
    assert int(re.search(r'"last_tick": (\d+)', info.output)[1]) >= ticks[-1]
    outside.process.send_signal(signal.SIGINT)
    assert outside.wait() == 0, outside.output
    assert "Traceback" not in outside.output
    assert message_count(tmp_path / "outside.mcap") > 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_every_verb_that_waits(
    elys, free_port, recording: Path, tmp_path, number: signal.Signals
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    play = elys("play", recording, "--loop", "--listen", endpoint)
    play.wait_for("playing")
    waiting = {
        elys("topic", "echo", "state", "--connect", endpoint): '"tick"',
        elys("record", "--connect", endpoint, "-o", "it.mcap"): "recording",
        elys("node", "render", "--connect", endpoint): "drawing views on",
    }
    for command, pattern in waiting.items():
        command.wait_for(pattern)
    wait_until_readable(tmp_path / "it.mcap")
    for command in (*waiting, play):
        command.process.send_signal(number)
        assert command.wait() in (0, 130, -number), command.output
        assert "Traceback" not in command.output
    assert message_count(tmp_path / "it.mcap") > 0
