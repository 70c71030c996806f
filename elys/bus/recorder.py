"""Recording a session: from a pipe, as the process beside a simulation, or from outside, as one more node of the session."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from elys.bus import codec, topics
from elys.bus.asset_service import AssetClient
from elys.bus.exact_asking import ExactAsking
from elys.bus.messages.scene import SceneDelta, Snapshot, SnapshotRequest
from elys.bus.recorder_files import Recorder as Recorder
from elys.bus.recording_pipe import FrameKind, PipeFrame, PipeReader
from elys.bus.recording_plan import PLAIN, RecordingPlan
from elys.bus.session import Session
from elys.bus.topics import Encoding, Topic
from elys.bus.transports.mcap import recorded_channels
from elys.bus.view_recording import RecordedView, ViewRecording
from elys.common.assets.store import AssetStore
from elys.common.errors import BusError, ElysError, MessageError, ProtocolError, RecordingError

_RETRY: Final = 0.2  # [s] between requests for a snapshot or an asset that cannot be had now
_log = logging.getLogger(__name__)


# --- beside a simulation -------------------------------------------------------------------------------------------


def record_pipe(descriptor: int, path: Path, plan: RecordingPlan = PLAIN) -> int:
    """Writes what comes through a pipe (see `recording_pipe`) until it ends, or the recording is full, then finishes the file.

    Returns the messages.

    Raises:
        RecordingError: the file cannot be written, or the pipe carries something else.
    """
    reader = PipeReader(descriptor)
    recorder: Recorder | None = None
    try:
        while not (reader.ended or (recorder is not None and recorder.is_full)):
            for frame in reader.read(1.0 if recorder is None else recorder.seconds_until_due()):
                if frame.kind is FrameKind.BEGIN and recorder is None:
                    recorder = _begun(path, frame, plan)
                elif recorder is not None:
                    _take_frame(recorder, frame)
            if recorder is not None:
                recorder.keep_time()
    finally:
        if recorder is not None:
            recorder.close()
    return 0 if recorder is None else recorder.message_count


def _begun(path: Path, frame: PipeFrame, plan: RecordingPlan) -> Recorder:
    return Recorder(path, session=frame.name, scene=frame.content.decode(errors="replace"), plan=plan)


def _take_frame(recorder: Recorder, frame: PipeFrame) -> None:
    if frame.kind is FrameKind.ASSET:
        recorder.asset(frame.name, frame.content)
    elif frame.kind is FrameKind.FACTS:
        recorder.facts(frame.name, codec.decode_body(frame.content, dict[str, str], Encoding.JSON))
    elif frame.kind is FrameKind.MESSAGE and frame.name in recorded_channels():
        recorder.message(frame.name, frame.content, time_ns=frame.time)


# --- from outside --------------------------------------------------------------------------------------------------


async def record_session(
    session: Session,
    path: Path,
    stop: asyncio.Event,
    views: Sequence[RecordedView] = (),
    plan: RecordingPlan = PLAIN,
) -> int:
    """Records a joined session, with pictures of these views, until `stop` is set or the recording is full.

    Finishes the file and returns the messages.

    Raises:
        RecordingError: the file cannot be written.
    """
    recording = _OutsideRecording(session, path, views, plan)
    try:
        await recording.run(stop)
    finally:
        recording.close()
    return recording.recorder.message_count


class _OutsideRecording:
    """Subscribes to everything, and asks for the scene at the start, at a gap, at a resync and after a new start of the host."""

    def __init__(
        self, session: Session, path: Path, views: Sequence[RecordedView], plan: RecordingPlan = PLAIN
    ) -> None:
        self.recorder = Recorder(path, session=session.name, scene="", plan=plan)
        self._views = [ViewRecording(session, view, self._keep_picture) for view in views]
        self._session = session
        self._assets = AssetClient(session, AssetStore())
        self._epoch = session.epoch
        self._sequence = -1
        self._exact = ExactAsking(session, self._keep_exact)
        self._early: list[tuple[str, bytes, int]] | None = []  # kept until the first snapshot stands before them
        self._lost = asyncio.Event()
        self._lost.set()
        self._wanted: asyncio.Queue[str] = asyncio.Queue()
        self._closers = [
            session.subscribe_payloads(topic, self._reader_of(topic), every=True)
            for topic in topics.TOPICS
            if topic.recorded and plan.takes(topic.name)
        ]
        session.on_link(lambda connected: self._link_changed() if connected else None)

    async def run(self, stop: asyncio.Event) -> None:
        works = (
            self._exact.run(),
            self._take_snapshots(),
            self._take_assets(),
            self._keep_time(),
            *(view.run() for view in self._views),
        )
        tasks = [asyncio.create_task(work) for work in works]
        stopping = asyncio.create_task(stop.wait())
        try:
            done, _ = await asyncio.wait([*tasks, stopping], return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in (*tasks, stopping):
                task.cancel()
            await asyncio.gather(*tasks, stopping, return_exceptions=True)

    def close(self) -> None:
        for close in self._closers:
            close()
        self._write_early()
        self.recorder.close()

    def _reader_of(self, topic: Topic[Any]) -> Any:
        def heard(_: str, payload: bytes) -> None:
            try:
                codec.check_prefix(payload, topic.encoding)
            except (MessageError, ProtocolError) as error:
                _log.debug("not recorded, on %s: %s", topic.name, error)
                return
            self._heard(topic, payload[codec.PREFIX.size :])

        return heard

    def _heard(self, topic: Topic[Any], body: bytes) -> None:
        self._exact.heard(topic, body)
        if topic is topics.DELTA:
            self._heard_delta(body)
        if topic is topics.EVENTS:
            self._want(body)  # the files of sounds
        self._write_or_wait(topic.name, body, time.time_ns())

    def _write_or_wait(self, channel: str, body: bytes, now: int) -> None:
        if self._early is not None:
            self._early.append((channel, body, now))
            return
        with contextlib.suppress(RecordingError):  # said again when the recorder's time is kept
            self.recorder.message(channel, body, time_ns=now)

    def _heard_delta(self, body: bytes) -> None:
        try:
            delta = codec.decode_body(body, SceneDelta, Encoding.JSON)
        except MessageError as error:
            _log.debug("a delta cannot be read: %s", error)
            self._lost.set()
            return
        self._want(body)
        if delta.resync or delta.epoch != self._epoch or delta.sequence > self._sequence + 1:
            self._lost.set()
        self._epoch, self._sequence = delta.epoch, delta.sequence

    def _link_changed(self) -> None:
        self._lost.set()
        self._exact.ask_anew()

    def _keep_picture(self, channel: str, body: bytes, now: int) -> None:
        self.recorder.add_video(channel)
        self._write_or_wait(channel, body, now)

    def _keep_exact(self, state: bytes, facts: dict[str, dict[str, str]]) -> None:
        for name, values in facts.items():
            self.recorder.facts(name, values)
        self._write_or_wait(topics.EXACT.name, state, time.time_ns())

    def _want(self, body: bytes) -> None:
        for reference in self.recorder.lacking(body):
            self._wanted.put_nowait(reference)

    async def _take_snapshots(self) -> None:
        while True:
            await self._lost.wait()
            self._lost.clear()
            try:
                snapshot = await self._session.request(topics.SNAPSHOT, SnapshotRequest(), timeout=5.0)
            except BusError as error:
                _log.debug("no snapshot now, asking again: %s", error)
                self._lost.set()
            else:
                self._write_snapshot(snapshot)
            await asyncio.sleep(_RETRY)

    def _write_snapshot(self, snapshot: Snapshot) -> None:
        body = codec.encode_body(snapshot, Encoding.JSON)
        self.recorder.message(topics.SNAPSHOT.name, body, time_ns=time.time_ns())
        self._want(body)
        if snapshot.epoch != self._epoch or snapshot.sequence > self._sequence:
            self._epoch, self._sequence = snapshot.epoch, snapshot.sequence
        self._write_early()

    def _write_early(self) -> None:
        early, self._early = self._early or [], None
        for name, body, now in early:
            self.recorder.message(name, body, time_ns=now)

    async def _take_assets(self) -> None:
        while True:
            reference = await self._wanted.get()
            try:
                self.recorder.asset(reference, await self._assets.fetch(reference))
            except ElysError as error:
                _log.warning("the recording lacks an asset: %s", error)

    async def _keep_time(self) -> None:
        while not self.recorder.is_full:
            await asyncio.sleep(max(0.02, self.recorder.seconds_until_due()))
            self.recorder.keep_time()
