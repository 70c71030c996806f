"""What recordings cost: sizes, rates and processor times of making, opening and verifying them.

A pile of 10,000 cubes is simulated once in a session of its own, and all that it says is kept: while it settles, and when it
sleeps. That is told to a recorder process at 60 ticks a second, as the session would; its processor time is what the system
says of it when it ends. Seeks are in a recording of 10 minutes of 1000 cubes, half of the time at rest.
"""

from __future__ import annotations

import asyncio
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import zstandard

from elys.bus import codec, topics
from elys.bus.last_seconds import LastSeconds
from elys.bus.messages.state_frame import HEADER
from elys.bus.recording import Recording
from elys.bus.recording_pipe import FrameKind, frame_head
from elys.bus.recording_plan import RecordingPlan
from elys.bus.session import Session
from elys.bus.state_packing.stream import FramePacker
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.mcap import McapWriter
from elys.sim_node.guard import Guard
from elys.sim_node.node import SimulationNode
from elys.verbs.recording_child import RecordingChild
from tests.benchmarks.figures import percentiles
from tests.benchmarks.rewinding import load
from tests.benchmarks.seeking import picture_rows
from tests.benchmarks.verifying import verifying_rows

RATE: Final = 60.0  # [Hz]
HOUR: Final = 3600.0 * RATE  # ticks
Said = list[tuple[str, bytes]]  # channel and body


class Told:
    """All that a session said, tick by tick."""

    def __init__(self, count: int, ticks: int) -> None:
        self.ticks: list[Said] = []
        self.snapshot = b""
        self.awake: list[int] = []
        asyncio.run(self._run(count, ticks))

    async def _run(self, count: int, ticks: int) -> None:
        simulation = load(count)
        session = await Session.host(LoopbackBroker().listen(), name="pile", kind="simulation", epoch=1)
        node = SimulationNode(simulation, session, realtime=False, keep=0.0)
        self.snapshot = codec.encode_body(node.snapshot(), Encoding.JSON)
        said: Said = []

        def hear(topic: topics.Topic[Any], _: str, payload: bytes) -> None:
            if topic.recorded:
                said.append((topic.name, payload[codec.PREFIX.size :]))

        session.taps.append(hear)
        for tick in range(ticks):
            node.tick()
            if tick % 15 == 0:
                node._publish_status()
            self.ticks.append(said[:])
            said.clear()
            self.awake.append(simulation.physics.watch().awake)
        await session.close()

    def frames(self, ticks: Iterable[int]) -> Iterator[bytes]:
        """The state frames of some ticks."""
        return (body for tick in ticks for channel, body in self.ticks[tick] if channel == topics.STATE.name)


def recorded(
    told: Told, ticks: list[int], path: Path, *options: str, rate: float = RATE, repeats: int = 1
) -> tuple[float, int]:
    """Tells a recorder process these ticks, `rate` a second; its processor time [s] and the size of the file [bytes]."""
    path.unlink(missing_ok=True)
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "elys.bus.recorder_process", "--fd", str(reading), "--output", str(path), *options]
    process = subprocess.Popen(command, pass_fds=[reading], stdin=subprocess.DEVNULL)
    os.close(reading)

    def say(kind: FrameKind, name: str, content: bytes) -> None:
        os.write(writing, frame_head(kind, name, len(content), time.time_ns()))
        view = memoryview(content)
        while view:
            view = view[os.write(writing, view) :]

    say(FrameKind.BEGIN, "pile", b"Pile")
    say(FrameKind.MESSAGE, topics.SNAPSHOT.name, told.snapshot)
    begun, number = time.monotonic(), 0
    for _ in range(repeats):
        for tick in ticks:
            time.sleep(max(0.0, begun + number / rate - time.monotonic()))
            for channel, body in told.ticks[tick]:
                say(FrameKind.MESSAGE, channel, _renumbered(body, number) if channel == topics.STATE.name else body)
            number += 1
    os.close(writing)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"the recorder ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime, path.stat().st_size


def _renumbered(body: bytes, tick: int) -> bytes:
    """A frame as of another tick, so that what is told twice goes on in time."""
    epoch, _, _, published, *rest = HEADER.unpack_from(body)
    return HEADER.pack(epoch, tick, tick / RATE, published + tick * 16_666_667, *rest) + body[HEADER.size :]


def sizes_and_times(folder: Path) -> list[tuple[str, str]]:
    """Rows about the pile of 10,000."""
    told = Told(10_000, 160)
    moving = [tick for tick, awake in enumerate(told.awake) if awake and tick > 18]
    asleep = [tick for tick, awake in enumerate(told.awake) if not awake][-60:]
    plain = statistics.mean(len(zstandard.compress(frame)) for frame in told.frames(moving))
    rows = [("raw frames, plain zstd, moving", f"{plain * HOUR / 1e9:.0f} GB/h")]
    for name, options in (("lossless", ()), ("compact", ("--plan", '{"compact":true}'))):
        idle, empty = recorded(told, [], folder / "empty.mcap", *options)
        repeats = 8
        used, size = recorded(told, moving, folder / "moving.mcap", *options, repeats=repeats)
        count = repeats * len(moving)
        rows += [
            (f"{name}, all channels, moving", f"{(size - empty) / count * HOUR / 1e9:.1f} GB/h"),
            (f"{name}, frames alone, moving", f"{_frame_size(told, moving, name) * HOUR / 1e9:.1f} GB/h"),
            (f"{name}, recorder, moving", f"{100.0 * (used - idle) / (count / RATE):.1f} % of a core"),
        ]
        repeats = 20
        used, size = recorded(told, asleep, folder / "asleep.mcap", *options, repeats=repeats)
        count = repeats * len(asleep)
        first = _first_frame(told, asleep[0], name)
        rows += [
            (f"{name}, all channels, asleep", f"{(size - empty - first) / count * HOUR / 1e6:.1f} MB/h"),
            (f"{name}, recorder, asleep", f"{100.0 * (used - idle) / (count / RATE):.1f} % of a core"),
        ]
    return rows


def _frame_size(told: Told, ticks: list[int], name: str) -> float:
    """Bytes in the file for each frame of these ticks, told in chunks of a seventh of a second."""
    packer = FramePacker(compact=name == "compact")
    sizes = [len(packer.pack(body, is_entry=n % 9 == 0) or b"") for n, body in enumerate(told.frames(ticks))]
    return statistics.mean(sizes)


def _first_frame(told: Told, tick: int, name: str) -> int:
    return len(FramePacker(compact=name == "compact").pack(next(told.frames([tick])), is_entry=True) or b"")


def ten_minutes(folder: Path) -> Path:
    """A recording of ten minutes of 1000 bodies, of which half of the time something moves."""
    told = Told(1000, 160)
    moving = [tick for tick, awake in enumerate(told.awake) if awake and tick > 18]
    asleep = [tick for tick, awake in enumerate(told.awake) if not awake][-60:]
    path = folder / "minutes.mcap"
    writer = McapWriter(path, session="pile")
    writer.write(topics.SNAPSHOT.name, told.snapshot, log_time=1)
    count = int(600 * RATE)
    kinds = {True: list(told.frames(moving)), False: list(told.frames(asleep))}
    for number in range(count):
        bodies = kinds[number // 1800 % 2 == 0]
        writer.write(topics.STATE.name, _renumbered(bodies[number % len(bodies)], number), log_time=number)
        if number % 9 == 8:
            writer._flush()  # as time would, every 0.15 s
    writer.close()
    return path


def seeks(folder: Path) -> list[tuple[str, str]]:
    """Rows about going to any instant of such a recording."""
    path, count = ten_minutes(folder), int(600 * RATE)
    chance, times = np.random.default_rng(1), []
    began = time.perf_counter()
    with Recording(path) as recording:
        opened = time.perf_counter() - began
        for position in chance.integers(0, count, 400).tolist():
            began = time.perf_counter()
            assert recording.frame(position).tick == position
            times.append(1e3 * (time.perf_counter() - began))
    return [
        ("10 minutes of 1000 bodies, to open", f"{1e3 * opened:.0f} ms"),
        ("any frame of it, p50 / p99", percentiles(times)),
        *picture_rows(path),
    ]


def tick_cost(folder: Path) -> list[tuple[str, str]]:
    """What the simulation spends with a recorder beside what it spends without: the tick's thread, the best of several runs of
    each tick, and all threads of its process, the best run.
    """
    best: dict[bool, list[float]] = {}
    process = {False: math.inf, True: math.inf}
    for run in range(8):
        is_recorded = bool(run % 2)
        times, worked = asyncio.run(_ticked(folder / "tick.mcap" if is_recorded else None))
        known = best.setdefault(is_recorded, times)
        best[is_recorded] = [min(pair) for pair in zip(known, times, strict=True)]
        process[is_recorded] = min(process[is_recorded], worked / len(times))
    alone, beside = (statistics.mean(best[is_recorded]) for is_recorded in (False, True))
    return [
        ("tick of 10,000 bodies, processor time", f"{1e3 * alone:.2f} ms"),
        ("the same while it is recorded", f"{100.0 * (beside / alone - 1.0):+.1f} %"),
        (
            "the same with all threads of the simulation's process",
            f"{100.0 * (process[True] / process[False] - 1.0):+.1f} %",
        ),
    ]


async def _ticked(path: Path | None) -> tuple[list[float], float]:
    """Processor time of the thread [s] for each tick in which the pile settles, and of the process [s] for all of them."""
    simulation = load(10_000)
    session = await Session.host(LoopbackBroker().listen(), name="pile", kind="simulation", epoch=1)
    node = SimulationNode(simulation, session, realtime=False, keep=0.0)
    last = LastSeconds(session, take_snapshot=node.snapshot, assets=simulation.assets)
    node.guard = Guard(simulation, last, lambda tick: Path(f"problem-{tick}.mcap"))
    child = RecordingChild(path, RecordingPlan(overwrites=True)) if path is not None else None
    if child is not None:
        child.attach(session, node, simulation.assets, lossless=True)
    times: list[float] = []
    whole = 0.0
    for tick in range(66):
        if tick == 32:
            whole = time.process_time()
        if node.recorder is not None:
            await node.recorder.ready()
        began = time.thread_time()
        node.tick()
        if tick >= 32:
            times.append(time.thread_time() - began)
        await asyncio.sleep(0.0)
    if node.recorder is not None:
        await node.recorder.ready()
    whole = time.process_time() - whole
    if child is not None:
        await child.finish()
    node.guard.close()
    await session.close()
    return times, whole


def measure() -> list[tuple[str, str]]:
    """Rows for docs/recording-format.md."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return [*sizes_and_times(folder), *tick_cost(folder), *seeks(folder), *verifying_rows(folder)]
