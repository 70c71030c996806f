"""A recorded run beside a session: where its bodies are at the instants that are shown, over the bus and from the file."""

from __future__ import annotations

import asyncio
import itertools
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from elys.bus import ghost_service, topics
from elys.bus.ghost_following import FollowedGhost, GhostFollower
from elys.bus.ghost_service import ALIGNED_NOW, MOST_FRAMES, GhostServer, opened_ghosts, positions_between
from elys.bus.ghost_track import FrameRun, GhostTrack, RecordedTrack
from elys.bus.messages.ghosts import UNTIL_TOLD, Ghost, GhostChange, GhostPart, GhostPartRequest, GhostSceneRequest
from elys.bus.messages.session import SessionStatus
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import reference_of
from elys.common.errors import MessageError, RecordingError, RequestError
from tests.unit.bus.told_recordings import FALLING, GUEST, PICTURE_MESH, RATE, TICKS, frame_at, write_told

END = TICKS / RATE


class Beside:
    """A session with a ghost in it, and somebody who follows it."""

    def __init__(self, host: Session, viewer: Session, recording: Recording) -> None:
        self.host, self.viewer, self.recording = host, viewer, recording
        self.changes = 0
        self.follower = GhostFollower(viewer, self._changed)
        self.servers: list[asyncio.Task[None]] = []

    def _changed(self) -> None:
        self.changes += 1

    async def show(self, **options: Any) -> FollowedGhost:
        """Serves the recording, and waits until it is followed."""
        server = GhostServer(self.recording, self.host, **options)
        self.servers.append(asyncio.create_task(server.run()))
        self.last_server = server
        async with asyncio.timeout(10.0):
            while server.told.ghost not in self.follower.tracks:
                await asyncio.sleep(0.005)
        return self.follower.tracks[server.told.ghost]

    async def around(self, track: FollowedGhost, time: float) -> tuple[Any, Any]:
        """The frames about a time, once they have come, with their scene."""
        async with asyncio.timeout(10.0):
            while (pair := track.around(time)) is None or track._scene_of != pair[0].delta_sequence:
                await asyncio.sleep(0.005)
        return pair


@asynccontextmanager
async def beside(folder: Path) -> AsyncIterator[Beside]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="play", kind="simulation", epoch=1)
    viewer = await Session.join(broker.connect(), kind="render")
    with Recording(write_told(folder / "other.mcap")) as recording:
        made = Beside(host, viewer, recording)
        try:
            yield made
        finally:
            made.follower.close()
            for task in made.servers:
                task.cancel()
            await asyncio.gather(*made.servers, return_exceptions=True)
            await viewer.close()
            await host.close()


def check_pair(pair: tuple[Any, Any], first: int, last: int) -> None:
    """Whether frames are those of two ticks, bit for bit."""
    for frame, tick in zip(pair, (first, last), strict=True):
        true = frame_at(tick, 0)
        assert frame.tick == tick
        for column in ("entity", "position", "rotation", "local_position", "weight"):
            np.testing.assert_array_equal(getattr(frame, column), getattr(true, column))


@pytest.mark.parametrize("over_the_bus", [True, False])
async def test_bodies_are_where_they_were_at_the_instant_that_is_shown(tmp_path: Path, over_the_bus: bool) -> None:
    async with beside(tmp_path) as made:
        followed = await made.show()
        recorded = RecordedTrack(made.recording)
        random = np.random.default_rng(3)
        for time in (0.0, *random.uniform(0.0, END, 12).tolist(), 1.0, 0.5, 1.5, END):
            track: GhostTrack = followed if over_the_bus else recorded
            pair = await made.around(followed, time) if over_the_bus else recorded.around(time)
            assert pair is not None
            tick = time * RATE
            is_one = abs(tick - round(tick)) < 1e-6
            check_pair(pair, *((round(tick),) * 2 if is_one else (math.floor(tick), math.ceil(tick))))
            assert (GUEST in track.mirror.entities) == (GUEST in pair[0].entity.tolist())
            assert track.mirror.entities[FALLING].name == "Falling"


async def test_what_was_not_yet_is_not_seen_and_what_is_over_rests_where_it_ended(tmp_path: Path) -> None:
    async with beside(tmp_path) as made:
        followed, recorded = await made.show(offset=-10.0), RecordedTrack(made.recording, offset=-10.0)
        check_pair(await made.around(followed, 10.5), 30, 30)
        check_pair(await made.around(followed, 10.0 + END + 100.0), TICKS, TICKS)
        for track in (followed, recorded):
            assert track.around(9.99) is None
            pair = track.around(10.0 + END + 100.0)
            assert pair is not None
            check_pair(pair, TICKS, TICKS)


async def test_frames_come_before_they_are_shown(tmp_path: Path) -> None:
    async with beside(tmp_path) as made:
        followed = await made.show()
        await made.around(followed, 0.0)
        missed = 0
        for step in range(1, 200):  # a hundred pictures a second, as time goes by
            missed += followed.around(step / 100.0) is None
            await asyncio.sleep(0.01)
        assert missed == 0


async def test_a_ghost_begins_when_it_is_wanted_to(tmp_path: Path) -> None:
    async with beside(tmp_path) as made:

        def tell(time: float) -> None:
            made.host.publish(
                topics.STATUS,
                SessionStatus(
                    epoch=1,
                    kind="simulation",
                    scene="Race",
                    tick=0,
                    simulation_time=time,
                    playing=True,
                    tick_rate=60.0,
                ),
            )

        showing = asyncio.create_task(made.show(offset=ALIGNED_NOW))
        await asyncio.sleep(0.05)
        assert not made.follower.tracks
        tell(100.0)
        followed = await showing
        assert followed.told.offset == -100.0
        check_pair(await made.around(followed, 100.5), 30, 30)


async def test_a_ghost_waits_while_its_session_is_held_and_passes_over_where_it_was_held_itself(tmp_path: Path) -> None:
    async with beside(tmp_path) as made:
        followed = await made.show(leaves_out=((1.0, 0.5),))
        check_pair(await made.around(followed, 0.5), 30, 30)
        check_pair(await made.around(followed, 1.1), 96, 96)  # of its own time 1.6 s
        made.last_server.wait(((0.5, UNTIL_TOLD),))
        async with asyncio.timeout(10.0):
            while not followed.told.waits:
                await asyncio.sleep(0.005)
        for time in (0.5, 0.8, 9.0):
            check_pair(await made.around(followed, time), 30, 30)
        made.last_server.wait(((0.5, 3.0),))
        async with asyncio.timeout(10.0):
            while followed.told.waits[0][1] != 3.0:
                await asyncio.sleep(0.005)
        check_pair(await made.around(followed, 3.75), 45, 45)


async def test_a_ghost_is_tinted_shifted_and_taken_away(tmp_path: Path) -> None:
    async with beside(tmp_path) as made:
        followed = await made.show(color=(1, 2, 3), title="Best lap")
        assert (followed.title, followed.color) == ("Best lap", (1, 2, 3))
        key = followed.told.ghost

        async def change(**values: Any) -> Ghost:
            return await made.viewer.request(topics.GHOST_CHANGE, GhostChange(**values), key=key)

        assert (await change(color=(9, 8, 7))).color == (9, 8, 7)
        assert (await change(offset=0.5)).offset == 0.5
        async with asyncio.timeout(10.0):
            while followed.told.offset != 0.5:
                await asyncio.sleep(0.005)
        assert followed.color == (9, 8, 7)
        check_pair(await made.around(followed, 0.5), 60, 60)
        for wrong in ({"color": (0, 0, 256)}, {"offset": "soon"}):
            with pytest.raises(RequestError, match=r"is no colour|Expected `float"):
                await change(**wrong)
        assert followed.fetch is not None
        content = await made.viewer.request(topics.GHOST_ASSET, reference_of(PICTURE_MESH).encode(), key=key)
        assert content == PICTURE_MESH
        seen = made.changes
        await change(is_removed=True)
        await asyncio.wait_for(asyncio.gather(*made.servers), 10.0)
        async with asyncio.timeout(10.0):
            while made.follower.tracks:
                await asyncio.sleep(0.005)
        assert made.changes > seen


async def test_who_dies_without_a_word_is_not_seen_for_long(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("elys.bus.ghost_following.SILENCE", 0.2)
    async with beside(tmp_path) as made:
        told = GhostServer(made.recording, made.host).told
        made.host.publish(topics.GHOST, told, key=told.ghost)
        async with asyncio.timeout(10.0):
            while not made.follower.tracks:
                await asyncio.sleep(0.005)
            while made.follower.tracks:
                await asyncio.sleep(0.02)


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf])
async def test_no_times_are_refused(tmp_path: Path, time: float) -> None:
    async with beside(tmp_path) as made:
        key = (await made.show()).told.ghost
        for query, request in (
            (topics.GHOST_PART, GhostPartRequest(first=time, last=1.0)),
            (topics.GHOST_PART, GhostPartRequest(first=0.0, last=1.0, step=time)),
            (topics.GHOST_SCENE, GhostSceneRequest(time=time)),
        ):
            with pytest.raises(RequestError, match="Expected `float`"):  # at the border: JSON has none of these
                await made.viewer.request(query, request, key=key)  # type: ignore[arg-type]
        with pytest.raises(RequestError, match="is no time"):
            positions_between(made.recording, GhostPartRequest(first=0.0, last=time))


def test_a_part_brackets_what_is_asked_for(tmp_path: Path) -> None:
    with Recording(write_told(tmp_path / "other.mcap")) as recording:

        def part(first: float, last: float, step: float = 0.0) -> list[int]:
            return positions_between(recording, GhostPartRequest(first=first, last=last, step=step))

        assert part(0.0, 0.0) == [0]
        assert part(-5.0, -4.0) == [0]
        assert part(0.505, 0.52) == [30, 31, 32]
        assert part(END + 1.0, END + 9.0) == [TICKS]
        assert part(0.0, 100.0) == list(range(MOST_FRAMES))
        sparse = part(0.0, END, 0.25)
        assert sparse[0] == 0 and sparse[-1] == TICKS
        assert all(b - a >= 15 for a, b in itertools.pairwise(sparse[:-1]))


async def test_an_answer_is_no_longer_than_a_message_should_be(tmp_path: Path, monkeypatch: Any) -> None:
    async with beside(tmp_path) as made:
        key = (await made.show()).told.ghost
        monkeypatch.setattr(ghost_service, "MOST_BYTES", 1)
        reply = await made.viewer.request(topics.GHOST_PART, GhostPartRequest(first=0.0, last=1.0), key=key)
        assert len(reply.frames) == 2 and not reply.is_end


async def test_a_ghost_that_talks_nonsense_is_not_seen_and_ends_nobody(tmp_path: Path, caplog: Any) -> None:
    async with beside(tmp_path) as made:
        true = GhostServer(made.recording, made.host).told
        parts: list[Any] = [
            GhostPart(frames=()),
            GhostPart(frames=(b"", b"\0" * 999)),
            GhostPart(frames=tuple(made.recording.frame_body(n) for n in (5, 4))),
        ]

        async def answer(_: GhostPartRequest, __: str) -> GhostPart:
            return parts.pop() if parts else GhostPart(frames=())

        made.host.serve(topics.GHOST_PART, answer, key=true.ghost)
        made.host.publish(topics.GHOST, msgspec.structs.replace(true, ghost="another"), key=true.ghost)
        made.host.publish(topics.GHOST, true, key=true.ghost)
        async with asyncio.timeout(10.0):
            while true.ghost not in made.follower.tracks:
                await asyncio.sleep(0.005)
            assert list(made.follower.tracks) == [true.ghost]
            track = made.follower.tracks[true.ghost]
            while parts:
                assert track.around(0.1) is None
                await asyncio.sleep(0.02)
        assert "does not say where it is" in caplog.text


def test_frames_in_no_order_are_refused() -> None:
    frames = [frame_at(tick, 0) for tick in (3, 4, 4)]
    for wrong in ([], frames, frames[1::-1]):
        with pytest.raises(MessageError):
            FrameRun(wrong, is_end=False)


def test_what_is_no_recording_is_said(tmp_path: Path) -> None:
    good = write_told(tmp_path / "good.mcap")
    (tmp_path / "bad.mcap").write_bytes(b"no recording")
    with pytest.raises(RecordingError, match="bad"):
        opened_ghosts([good, tmp_path / "bad.mcap"])
    with pytest.raises(RecordingError, match="too many"):
        opened_ghosts([good] * 17)
