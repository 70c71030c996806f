"""A recording as a session: the same topics and queries as the simulation had, on a timeline that can be wound.

Frames go out with the recorded columns bit for bit; of their header the player sets its own epoch, the delta number and the
time of sending. Deltas are numbered anew: winding back must not make numbers fall.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from typing import Any, Final

import msgspec
import numpy as np

from elys.bus import codec, topics
from elys.bus.marker_log import MarkerLog
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
from elys.bus.messages.history import HistoryReply, HistoryRequest
from elys.bus.messages.physics import Touching, TouchingRequest
from elys.bus.messages.plan import PhysicsPlan, PlanRequest
from elys.bus.messages.scene import SceneDelta, Snapshot, SnapshotRequest
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import HEADER, PLAYING
from elys.bus.messages.timeline import Markers, MarkersRequest
from elys.bus.prefab_service import serve_prefabs
from elys.bus.recorded_markers import read_markers
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.topics import Encoding
from elys.bus.transports.mcap_reading import RecordedMessage
from elys.common.assets.store import PREFIX
from elys.common.errors import MessageError, RecordingError, RequestError

STATUS_INTERVAL: Final = 0.25  # [s]
LOWEST_RATE: Final = 0.01
HIGHEST_RATE: Final = 100.0
_SHOWN_IN_A_ROW: Final = 4  # frames published one by one; of more that are due at once only the last is shown
_TOLD_ONE_BY_ONE: Final = 100  # deltas after a seek; more are said with one resync
END_MARGIN: Final = 0.1  # [s]
_NOT_EDITABLE: Final = "this is a recording: it cannot be edited; run its scene with `elys run` to change it"
_REPLAYED: Final = frozenset(topic.name for topic in topics.TOPICS if topic.recorded) - {topics.STATUS.name}
WHOLE: Final = SetRange()
_log = logging.getLogger(__name__)


class Player:
    """Plays a recording in a session that it hosts (`kind` "replay"). `run` goes on until it is cancelled.

    Where it comes upon damage in a recording that was not `checked`, it opens that once more, and plays on behind the damage.
    Its clock is that of the running loop.
    """

    def __init__(
        self,
        recording: Recording,
        session: Session,
        *,
        playing: bool = True,
        loop: bool = False,
        rate: float = 1.0,
        part: SetRange = WHOLE,
    ) -> None:
        """Plays `part` of it. Raises RequestError if that or `rate` is none, RecordingError if the first frame cannot be read."""
        self.recording = self._given = recording
        self.session = session
        self.playing = playing
        self.loop = loop
        self.rate = _checked_rate(rate)
        self._clock = asyncio.get_running_loop().time
        self._part = part
        self._first, self._last = self._checked_range(part)  # what is played
        self.position = self._first
        self._mirror = recording.mirror_at(self.position)
        self._sequence = 0
        self._ticks = np.unique(recording.tick)
        # The clock's time and simulation time that belong together.
        self._anchor = self._measured = (self._clock(), self.time)
        self._realtime_factor = 0.0
        self._wake = asyncio.Event()
        self._markers = MarkerLog()
        self._reading_markers: asyncio.Task[None] | None = None  # begun when somebody asks
        self._checking = asyncio.Lock()

    @property
    def tick(self) -> int:
        """The tick that is shown."""
        return int(self.recording.tick[self.position])

    @property
    def time(self) -> float:
        """The simulation time that is shown [s]."""
        return float(self.recording.time[self.position])

    async def run(self) -> None:
        """Serves the session and plays."""
        self.session.serve(topics.SNAPSHOT, self._give_snapshot)
        self.session.serve(topics.PLAN, self._refuse_plan)
        self.session.serve(topics.TOUCHING, self._refuse_touching)
        serve_prefabs(self.session, self._has_instance_of)
        self.session.serve(topics.ASSET, self._give_asset)
        self.session.serve(topics.MARKERS, self._give_markers)
        self.session.serve(topics.COMMAND, self._take_command)
        self.session.serve(topics.HISTORY, self._give_history)
        self._set_anchor()
        self._publish_frame()
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._heartbeat())
                group.create_task(self._play())
        finally:
            if self.recording is not self._given:
                self.recording.close()

    async def _play(self) -> None:
        while True:
            if self.playing:
                try:
                    self._catch_up()
                except RecordingError as error:
                    if await self._leave_out_damage():
                        continue
                    _log.error("the replay stops here: %s", error)
                    self._set_playing(False)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), self._seconds_until_due())
            self._wake.clear()

    async def _heartbeat(self) -> None:
        while True:
            self._publish_status()
            if not self.playing:
                self._publish_frame()  # for who has joined meanwhile
            await asyncio.sleep(STATUS_INTERVAL)

    async def _leave_out_damage(self) -> bool:
        """Goes on with what of the recording can be read; returns whether that is another than before."""
        before = self.recording
        async with self._checking:
            if self.recording is not before:
                return True  # somebody else came upon it meanwhile
            if before.is_checked:
                return False
            try:
                checked = await asyncio.to_thread(Recording, before.path, checked=True)
            except RecordingError as error:
                _log.error("%s", error)
                return False
            self._become(checked)
            return True

    def _become(self, checked: Recording) -> None:
        """Shows the same tick of the recording without its damaged parts."""
        self.recording, time = checked, self.time
        self._ticks = np.unique(checked.tick)
        try:
            self._first, self._last = self._checked_range(self._part)
        except RequestError:  # of what was asked for nothing is left
            self._first, self._last = self._checked_range(WHOLE)
        self.position = max(int(np.searchsorted(checked.time, time, side="right")) - 1, 0)
        self._mirror = checked.mirror_at(self.position)
        self._tell_scene(None)
        self._set_anchor()

    # --- time ------------------------------------------------------------------------------------------------------

    def _set_anchor(self) -> None:
        self._anchor = (self._clock(), self.time)

    def _keep_time(self) -> None:
        """Before another rate or range: what has passed of the frame that is shown stays passed."""
        if self.playing:
            self._anchor = (self._clock(), self._due_time())

    def _due_time(self) -> float:
        wall, simulated = self._anchor
        return simulated + (self._clock() - wall) * self.rate

    def _seconds_until_due(self) -> float | None:
        if not self.playing:
            return None
        following = min(self.position + 1, self._end)
        return max(0.0, (float(self.recording.time[following]) - self._due_time()) / self.rate)

    def _catch_up(self) -> None:
        end = self._end
        due = min(int(np.searchsorted(self.recording.time, self._due_time(), side="right")) - 1, end)
        while self.position < due:
            is_far = due - self.position > _SHOWN_IN_A_ROW
            self._go_on(due if is_far else self.position + 1)
        if self.position < end:
            return
        if self.loop and self.recording.tick[self._first] < self.recording.tick[end]:
            self._jump(self._first)
        else:
            self._set_playing(False)

    @property
    def _end(self) -> int:
        """Where playing stops: of who was led beyond the range, the recording's end."""
        return self._last if self.position <= self._last else len(self.recording) - 1

    def _set_playing(self, playing: bool) -> None:
        left = float(self.recording.time[self._end]) - self.time
        if playing and not self.playing and left < END_MARGIN:
            self._jump(self._first)  # who asks to play at the end, or a hand's breadth before it, wants to see it again
        self.playing = playing
        self._set_anchor()
        self._publish_status()
        self._publish_frame()
        self._wake.set()

    # --- moving along the recording --------------------------------------------------------------------------------

    def _go_on(self, position: int) -> None:
        """Forward, with everything that was said on the way."""
        self.recording.frame_body(position)  # raises before anything has changed
        self._tell_scene(self.recording.advance(self._mirror, position), one_by_one=True)
        first, self.position = self.position + 1, position
        self._publish_frame()
        for message in self.recording.messages_of(first, position):
            self._republish(message)

    def _jump(self, position: int) -> None:
        """Anywhere, with nothing but the scene and the frame that are there."""
        self.recording.frame_body(position)  # raises before anything has changed
        if self.recording.needs_rebuilding(self._mirror, position):
            self._mirror = self.recording.mirror_at(position)
            self._tell_scene(None)
        else:
            self._tell_scene(self.recording.advance(self._mirror, position))
        self.position = position
        self._set_anchor()
        self._publish_frame()

    def _step(self, count: int) -> None:
        here = int(np.searchsorted(self._ticks, self.tick))
        there = min(max(here + count, 0), len(self._ticks) - 1)
        position = self.recording.last_of_tick(int(np.searchsorted(self.recording.tick, self._ticks[there])))
        if there == here + 1:
            self._go_on(position)
        else:
            self._jump(position)

    def _tell_scene(self, deltas: list[SceneDelta] | None, *, one_by_one: bool = False) -> None:
        if deltas is None or (len(deltas) > _TOLD_ONE_BY_ONE and not one_by_one):
            self._publish_delta(SceneDelta(epoch=0, sequence=0, tick=self._mirror.tick, resync=True))
            return
        for delta in deltas:
            self._publish_delta(delta)

    # --- publishing ------------------------------------------------------------------------------------------------

    def _publish_delta(self, delta: SceneDelta) -> None:
        self._sequence += 1
        self.session.publish(
            topics.DELTA, msgspec.structs.replace(delta, epoch=self.session.epoch, sequence=self._sequence)
        )

    def _publish_frame(self) -> None:
        body = self.recording.frame_body(self.position)
        _, tick, simulated, _, _, state_hash, count, flags = HEADER.unpack_from(body)
        flags = flags | PLAYING if self.playing else flags & ~PLAYING
        header = HEADER.pack(
            self.session.epoch, tick, simulated, time.time_ns(), self._sequence, state_hash, count, flags
        )
        payload = codec.with_prefix(header + body[HEADER.size :], Encoding.STATE)
        self.session.publish_payload(topics.STATE, payload)

    def _republish(self, message: RecordedMessage) -> None:
        if message.channel not in _REPLAYED:
            return  # the player says itself how it goes, pictures are drawn anew, and who else writes into the file is not known
        topic = topics.topic_named(message.channel)
        body = message.body
        if topic is topics.EVENTS or topic is topics.CONTACTS:
            try:
                events = codec.decode_body(body, topic.message, Encoding.JSON)
            except MessageError as error:
                _log.warning("%s at tick %d are left out: %s", topic.name, self.tick, error)
                return
            body = codec.encode_body(msgspec.structs.replace(events, epoch=self.session.epoch), Encoding.JSON)
        self.session.publish_payload(topic, codec.with_prefix(body, topic.encoding))

    def _publish_status(self) -> None:
        wall, simulated = self._clock(), self.time
        elapsed = wall - self._measured[0]
        if elapsed >= STATUS_INTERVAL:
            self._realtime_factor = max(0.0, (simulated - self._measured[1]) / elapsed)
            self._measured = (wall, simulated)
        status = SessionStatus(
            epoch=self.session.epoch,
            kind="replay",
            scene=self._mirror.scene,
            tick=self.tick,
            simulation_time=simulated,
            playing=self.playing,
            tick_rate=self._mirror.settings.tick_rate,
            rate=self.rate,
            realtime_factor=self._realtime_factor,
            loop=self.loop,
            start_time=float(self.recording.time[0]),
            end_time=float(self.recording.time[-1]),
            entity_count=len(self._mirror.entities),
            body_count=int(self.recording.body_count[self.position]),
            recording=str(self.recording.path.absolute()),
        )
        self.session.publish(topics.STATUS, status)

    # --- answering -------------------------------------------------------------------------------------------------

    def _has_instance_of(self, prefab: str) -> bool:
        return any(entity.prefab == prefab for entity in self._mirror.entities.values())

    async def _give_snapshot(self, request: SnapshotRequest, key: str) -> Snapshot:
        snapshot = self._mirror.to_snapshot(frame=self.recording.frame(self.position))
        return msgspec.structs.replace(snapshot, epoch=self.session.epoch, sequence=self._sequence)

    async def _give_history(self, request: HistoryRequest, key: str) -> HistoryReply:
        return HistoryReply(author="")  # nothing can be edited here

    async def _give_markers(self, request: MarkersRequest, key: str) -> Markers:
        if self._reading_markers is None:
            self._reading_markers = self.session.start(read_markers(self.recording, self._markers))
        return self._markers.reply(request)

    async def _give_asset(self, request: bytes, key: str) -> bytes:
        return self.recording.asset(PREFIX + key)

    async def _refuse_plan(self, request: PlanRequest, key: str) -> PhysicsPlan:
        raise RequestError("a recording is played, nothing is simulated: there is no plan of steps")

    async def _refuse_touching(self, request: TouchingRequest, key: str) -> Touching:
        raise RequestError("a recording is played: it holds which contacts began and ended, not which go on")

    async def _take_command(self, request: CommandRequest, key: str) -> CommandReply:
        try:
            try:
                self._apply(request.command)
            except RecordingError:
                if not await self._leave_out_damage():
                    raise
                self._apply(request.command)
        except (RequestError, RecordingError) as error:
            return CommandReply(accepted=False, tick=self.tick, reason=str(error))
        return CommandReply(accepted=True, tick=self.tick)

    def _apply(self, command: Command) -> None:
        match command:
            case SetPlaying(playing=playing):
                self._set_playing(playing)
                return
            case StepTicks(count=count):
                if self.playing:
                    raise RequestError("pause before stepping")
                self._step(count)
            case Seek(time=seconds):
                if not math.isfinite(seconds):
                    raise RequestError(f"{seconds} is no time to go to")
                self._jump(self.recording.position_at(seconds))
            case SetRate(rate=rate):
                asked = _checked_rate(rate)
                self._keep_time()
                self.rate = asked
            case SetLoop(loop=loop):
                self.loop = loop
            case SetRange():
                self._first, self._last = self._checked_range(command)
                self._part = command
            case _:
                raise RequestError(_NOT_EDITABLE)
        self._publish_status()
        self._wake.set()

    def _checked_range(self, asked: SetRange) -> tuple[int, int]:
        """The first and the last frame of what is to be played."""
        recording = self.recording
        start, end = (float(recording.time[0]), float(recording.time[-1]))
        first = start if asked.start is None else asked.start
        last = end if asked.end is None else asked.end
        is_asked = asked.start is not None or asked.end is not None
        if is_asked and not (first < last and first < end and last > start):
            raise RequestError(
                f"nothing can be played from {first:g} to {last:g} s: the recording goes from {start:.3f} to {end:.3f} s"
            )
        return recording.position_at(first), recording.position_at(last)


def _checked_rate(rate: Any) -> float:
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        raise RequestError(f"the rate of a replay must lie between {LOWEST_RATE:g} and {HIGHEST_RATE:g}, not {rate:g}")
    return float(rate)
