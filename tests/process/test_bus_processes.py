"""Real processes over real zenoh, killed and stopped: nobody else may suffer, and nothing may stay behind."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus.discovery import join_session
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.player import Player
from elys.bus.recorder import record_session
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.transports.zenoh import ZenohTransport

pytestmark = pytest.mark.process
PROGRAMS = Path(__file__).parent / "programs"
ROOT = Path(__file__).parents[2]
PATIENCE = 60.0  # [s] far beyond what anything here takes; a failure, not a measure


class Programs:
    """Starts programs and ends what is left of them."""

    def __init__(self) -> None:
        self.started: list[Program] = []
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"

    def host(self, *, epoch: int, pipe: int | None = None) -> Program:
        arguments = [self.endpoint, str(epoch), *([] if pipe is None else [str(pipe)])]
        return self.start("bus_host.py", *arguments, pass_fds=() if pipe is None else (pipe,))

    def viewer(self) -> Program:
        return self.start("bus_viewer.py", self.endpoint)

    def start(self, program: str, *arguments: str, pass_fds: tuple[int, ...] = ()) -> Program:
        command = [sys.executable, str(PROGRAMS / program), *arguments]
        return self._started(command, pass_fds)

    def recorder(self, reading: int, path: Path) -> Program:
        command = [sys.executable, "-m", "elys.bus.recorder_process", "--fd", str(reading), "--output", str(path)]
        return self._started(command, (reading,))

    def _started(self, command: list[str], pass_fds: tuple[int, ...]) -> Program:
        program = Program(command, pass_fds)
        self.started.append(program)
        return program


class Program:
    """A process whose lines can be waited for."""

    def __init__(self, command: list[str], pass_fds: tuple[int, ...]) -> None:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, pass_fds=pass_fds, env=environment, cwd=ROOT
        )
        self.lines: list[str] = []
        self._came = threading.Condition()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._came:
                self.lines.append(line.strip())
                self._came.notify_all()

    def wait_for_lines(self, count: int) -> list[str]:
        """Waits until so many more lines have come, and returns them."""
        with self._came:
            start = len(self.lines)
            assert self._came.wait_for(lambda: len(self.lines) >= start + count, PATIENCE), self.lines[-3:]
            return self.lines[start:]

    def wait_open(self) -> None:
        with self._came:
            assert self._came.wait_for(lambda: "open" in self.lines, PATIENCE)

    def send(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE)
        self._thread.join(PATIENCE)


@pytest.fixture
def programs() -> Iterator[Programs]:
    opened = Programs()
    yield opened
    for program in opened.started:
        program.end()


def shared_memory_files() -> set[str]:
    return {entry.name for entry in Path("/dev/shm").iterdir() if "zenoh" in entry.name}


def assert_right(frame: StateFrame) -> None:
    np.testing.assert_array_equal(frame.position[:, 2], frame.tick + np.arange(1, frame.body_count + 1))


def test_a_killed_host_is_noticed_within_a_second_and_all_resume_with_the_next(programs: Programs) -> None:
    before = shared_memory_files()
    host = programs.host(epoch=1)
    host.wait_open()
    other = programs.viewer()
    other.wait_for_lines(5)

    async def watch() -> None:
        joined = await join_session(programs.endpoint, kind="editor", timeout=PATIENCE)
        mirror = SceneMirror()
        links: asyncio.Queue[bool] = asyncio.Queue()
        joined.on_link(links.put_nowait)
        await follow_scene(joined, mirror)
        frames: list[StateFrame] = []
        follow_state(joined, mirror, frames.append)
        for epoch in (1, 2, 3):
            while not frames or frames[-1].epoch != epoch or mirror.epoch != epoch or mirror.sequence < 3:
                await asyncio.sleep(0.01)
            assert_right(frames[-1])
            assert len(mirror.entities) == 1000
            while other.lines[-1].split()[0] != str(epoch):  # whoever else is there has come back as well
                await asyncio.sleep(0.01)
            host = programs.started[-1] if epoch > 1 else programs.started[0]
            killed = time.monotonic()
            host.send(signal.SIGKILL)
            assert await asyncio.wait_for(links.get(), PATIENCE) is False
            assert (
                time.monotonic() - killed < 3.0
            )  # the connection ends at once; by its silence it would be known after 4 s
            assert not joined.connected
            host.end()
            if epoch < 3:
                programs.host(epoch=epoch + 1).wait_open()
                assert await asyncio.wait_for(links.get(), PATIENCE) is True
        await asyncio.wait_for(joined.close(), 5.0)

    asyncio.run(asyncio.wait_for(watch(), 4 * PATIENCE))
    assert shared_memory_files() <= before


def test_a_stopped_and_a_killed_viewer_cost_the_host_and_the_others_nothing(programs: Programs) -> None:
    host = programs.host(epoch=1)
    host.wait_open()
    stopped, killed, well = programs.viewer(), programs.viewer(), programs.viewer()
    for viewer in (stopped, killed, well):
        viewer.wait_for_lines(5)
    stopped.send(signal.SIGSTOP)
    killed.send(signal.SIGKILL)
    first, *_, last = host.wait_for_lines(8)  # two seconds of the host's time
    # A host that waited for a reader would fall behind by seconds; what the machine does to it is far less.
    assert float(last.split()[3]) - float(first.split()[3]) < 1.0
    well.wait_for_lines(20)
    seen = len(stopped.lines)
    stopped.send(signal.SIGCONT)
    stopped.wait_for_lines(5)
    assert len(stopped.lines) > seen
    ticks = [int(line.split()[1]) for line in stopped.lines]
    assert ticks == sorted(ticks)


def test_a_killed_host_leaves_a_whole_recording(programs: Programs, tmp_path: Path) -> None:
    path = tmp_path / "f.mcap"
    reading, writing = os.pipe()
    recorder = programs.recorder(reading, path)
    host = programs.host(epoch=5, pipe=writing)
    os.close(reading)
    os.close(writing)
    host.wait_open()
    host.wait_for_lines(4)
    recorder.send(signal.SIGINT)  # Ctrl-C reaches everybody: the recorder goes on until the pipe ends
    host.wait_for_lines(1)
    host.send(signal.SIGKILL)
    assert recorder.process.wait(PATIENCE) == 0
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
        assert summary is not None and summary.statistics is not None
    last_tick = int(host.lines[-1].split()[1])
    with Recording(path) as recording:
        assert not recording.reader.mended
        ticks = recording.tick.tolist()
        assert ticks == list(range(1, len(ticks) + 1)) and len(ticks) >= last_tick - 5
        for position in range(len(recording)):
            assert_right(recording.frame(position))
        assert len(recording.mirror_at(len(recording) - 1).entities) == 1000


def test_a_killed_recorder_leaves_the_host_alone_and_the_file_readable(programs: Programs, tmp_path: Path) -> None:
    path = tmp_path / "f.mcap"
    reading, writing = os.pipe()
    recorder = programs.recorder(reading, path)
    host = programs.host(epoch=5, pipe=writing)
    os.close(reading)
    os.close(writing)
    host.wait_open()
    last = host.wait_for_lines(4)[-1]
    recorder.send(signal.SIGKILL)
    recorder.end()
    lines = host.wait_for_lines(5)
    assert lines[-1].endswith("recorder False")
    assert float(lines[-1].split()[3]) - float(lines[0].split()[3]) < 1.0
    with Recording(path) as recording:
        assert recording.reader.mended
        assert int(recording.tick[-1]) >= int(last.split()[1]) - 240  # no more than a second, with the open chunk
        for position in range(len(recording)):
            assert_right(recording.frame(position))


def test_recorded_from_outside_and_replayed_over_the_network(programs: Programs, tmp_path: Path) -> None:
    path = tmp_path / "f.mcap"
    host = programs.host(epoch=1)
    host.wait_open()

    async def record() -> int:
        joined = await join_session(programs.endpoint, kind="recorder", timeout=PATIENCE)
        stop = asyncio.Event()
        asyncio.get_running_loop().call_later(2.0, stop.set)
        messages = await record_session(joined, path, stop)
        await joined.close()
        return messages

    assert asyncio.run(record()) > 100
    host.end()

    async def replay() -> None:
        with Recording(path) as recording:
            ticks = recording.tick.tolist()
            assert ticks == list(range(ticks[0], ticks[-1] + 1))
            transport = await asyncio.to_thread(ZenohTransport.listen, programs.endpoint)
            hosting = await Session.host(transport, name="replay", kind="replay", epoch=77)
            player = Player(recording, hosting, loop=True)
            task = asyncio.create_task(player.run())
            viewer = programs.viewer()
            while len(viewer.lines) < 20:
                await asyncio.sleep(0.01)
            assert {line.split()[0] for line in viewer.lines} == {"77"}
            assert {int(line.split()[1]) for line in viewer.lines} <= set(ticks)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            await hosting.close()

    asyncio.run(asyncio.wait_for(replay(), PATIENCE))
