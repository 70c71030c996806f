"""Random play, pause, step, seek, rate, loop and range: what is shown is always what a plain model says it should be."""

from __future__ import annotations

import asyncio
import os
import random
import threading
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from elys.bus import topics
from elys.bus.following import follow_state
from elys.bus.messages.commands import (
    Command,
    CommandReply,
    CommandRequest,
    Seek,
    SetLoop,
    SetPlaying,
    SetRange,
    SetRate,
    StepTicks,
)
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.player import END_MARGIN, Player
from elys.bus.recorder import record_pipe
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.loopback import LoopbackBroker
from tests.property.virtual_time import run_in_virtual_time
from tests.unit.bus.conftest import RandomHost, assert_same_columns

TICKS = 150  # at 60 a second, the first of them 1
LAST = TICKS - 1


@dataclass
class Model:
    """A recording of TICKS ticks on a timeline, in plain Python; frame n shows tick n + 1."""

    playing: bool = True
    loop: bool = False
    rate: float = 1.0
    first: int = 0
    last: int = LAST
    frame: int = 0
    wall: float = 0.0  # [s] that belongs to the next
    time: float = 1 / 60  # [s] of simulation
    times: list[float] = field(default_factory=lambda: [(n + 1) / 60 for n in range(TICKS)])

    @property
    def end(self) -> int:
        return self.last if self.frame <= self.last else LAST

    def due(self, wall: float) -> float:
        return self.time + (wall - self.wall) * self.rate

    def go(self, frame: int, wall: float) -> None:
        self.frame, self.wall, self.time = frame, wall, self.times[frame]

    def pass_until(self, wall: float) -> None:
        while self.playing:
            reached = self.wall + (self.times[self.end] - self.time) / self.rate
            if reached > wall:
                self.frame = max(self.frame, bisect_right(self.times, self.due(wall)) - 1)
                return
            self.frame = self.end
            if self.loop and self.first < self.end:
                self.go(self.first, reached)
            else:
                self.playing = False

    def is_between_frames(self, wall: float) -> bool:
        """Whether rounding cannot decide what is shown."""
        if not self.playing:
            return True
        place = self.due(wall) * 60
        return abs(place - round(place)) > 1e-3

    def nearest(self, time: float) -> int:
        return min(range(TICKS), key=lambda n: (abs(self.times[n] - time), n))

    def accepts(self, command: Command, wall: float) -> bool:
        """Does what is asked, or says that it must be refused."""
        match command:
            case SetPlaying(playing=playing):
                if playing and not self.playing and self.times[self.end] - self.times[self.frame] < END_MARGIN:
                    self.go(self.first, wall)
                self.playing = playing
                self.go(self.frame, wall)
            case StepTicks(count=count):
                if self.playing:
                    return False
                self.frame = min(max(self.frame + count, 0), LAST)
            case Seek(time=time):
                self.go(self.nearest(time), wall)
            case SetRate(rate=rate):
                if not 0.01 <= rate <= 100.0:
                    return False
                if self.playing:
                    self.time, self.wall = self.due(wall), wall
                self.rate = rate
            case SetLoop(loop=loop):
                self.loop = loop
            case SetRange(start=start, end=end):
                first = self.times[0] if start is None else start
                last = self.times[-1] if end is None else end
                if not (first < last and first < self.times[-1] and last > self.times[0]):
                    return False
                self.first, self.last = self.nearest(first), self.nearest(last)
        return True


class Actor:
    """Makes up what somebody does."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def command(self) -> Command:
        choose = self.random
        match choose.randrange(8):
            case 0 | 1:
                return SetPlaying(playing=choose.random() < 0.6)
            case 2:
                return StepTicks(count=choose.choice((1, 1, -1, -1, 5, -7, 1000, -1000)))
            case 3 | 4:
                odd = (-5.0, 1e9)
                return Seek(time=choose.choice(odd) if choose.random() < 0.1 else choose.uniform(-0.1, 2.7))
            case 5:
                return SetRate(rate=choose.choice((0.01, 0.1, 0.5, 1.0, 2.0, 10.0, 100.0, 0.0, -1.0, 1e3)))
            case 6:
                return SetLoop(loop=choose.random() < 0.5)
            case _:
                start = choose.choice((None, choose.uniform(-0.5, 2.8)))
                length = choose.choice((-0.2, 0.0, *(choose.uniform(0.3, 2.0) for _ in range(4))))
                end = choose.choice((None, (start or 0.0) + length))
                return SetRange(start=start, end=end)


def record_random_scene(path: Path) -> RandomHost:
    async def record() -> RandomHost:
        session = await Session.host(LoopbackBroker().listen(), name="yard", kind="simulation", epoch=7)
        host = RandomHost(session)
        reading, writing = os.pipe()
        thread = threading.Thread(target=record_pipe, args=(reading, path))
        thread.start()
        tap = RecordingTap(session, writing, take_snapshot=host.truth.to_snapshot, assets=host.assets, lossless=True)
        for number in range(TICKS):
            host.publish_tick(resync=number == 70)
        tap.close()
        thread.join(30)
        await session.close()
        return host

    return asyncio.run(record())


def nearest_is_clear(command: Command) -> bool:
    """Whether what is asked for is not just between two frames."""
    asked = [getattr(command, name, None) for name in ("time", "start", "end")]
    return all(abs((time * 60) % 1 - 0.5) > 1e-6 for time in asked if time is not None and abs(time) < 1e6)


@pytest.mark.parametrize("seed", range(2))
def test_what_is_shown_is_what_was_asked_for(seed: int, tmp_path: Path, soak: bool) -> None:
    host = record_random_scene(tmp_path / "f.mcap")
    actions = 5000 if soak else 400

    async def play() -> None:
        loop, actor, model, broker = asyncio.get_running_loop(), Actor(seed), Model(), LoopbackBroker()
        with Recording(tmp_path / "f.mcap") as recording:
            session = await Session.host(broker.listen(), name="replay", kind="replay", epoch=99)
            playing = asyncio.create_task(Player(recording, session).run())
            viewer = await Session.join(broker.connect(), kind="render")
            frames: list[StateFrame] = []
            statuses: list[SessionStatus] = []
            follow_state(viewer, SceneMirror(), frames.append)
            viewer.subscribe(topics.STATUS, lambda status, _: statuses.append(status))
            await asyncio.sleep(0.5)
            model.pass_until(loop.time())

            async def ask(command: Command) -> CommandReply:
                return await viewer.request(topics.COMMAND, CommandRequest(origin=viewer.node.id, command=command))

            refused = 0
            for number in range(actions):
                await asyncio.sleep(actor.random.choice((0.0, 0.003, actor.random.uniform(0.0, 0.6))))
                while not model.is_between_frames(loop.time()):
                    await asyncio.sleep(0.0007 / model.rate)
                model.pass_until(loop.time())
                command = actor.command()
                while not nearest_is_clear(command):
                    command = actor.command()
                told = len(statuses)
                reply = await ask(command)
                assert reply.accepted == model.accepts(command, loop.time()), (number, command, reply)
                refused += not reply.accepted
                for _ in range(8):  # what was published is heard before time goes on
                    await asyncio.sleep(0)
                model.pass_until(loop.time())  # who is led to the end while playing is at the loop's start at once
                frame = frames[-1]
                assert frame.tick == model.frame + 1, (number, command, frame.tick, model)
                assert_same_columns(frame, host.frames[frame.tick])
                if len(statuses) > told:
                    status = statuses[-1]
                    assert (status.playing, status.loop, status.rate) == (model.playing, model.loop, model.rate)
                del frames[:-1], statuses[:-1]
            assert actions * 0.05 < refused < actions * 0.5
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)
            await viewer.close()
            await session.close()

    run_in_virtual_time(play())
