"""The last seconds of a session, kept in memory, and written as a recording when something went wrong.

The tick only appends what it published anyway. Writing is the work of a thread, and of a recorder process of its own: neither
the tick nor the session waits for it. Where a `CrashBox` is given, it keeps the same outside of this process.
"""

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

from elys.bus import codec, topics
from elys.bus.crash_box import CrashBox
from elys.bus.exact_keeping import ExactSource, ExactState
from elys.bus.messages.exact_state import ExactHead
from elys.bus.messages.scene import Snapshot
from elys.bus.recording_pipe import FrameKind, frame_head
from elys.bus.session import Session
from elys.bus.topics import Encoding, Topic
from elys.common.assets.store import AssetStore, references_in
from elys.common.errors import AssetError

SECONDS: Final = 5.0  # [s] of simulation
ROOM: Final = 64 << 20  # [bytes] kept at most of so many seconds: very many bodies have fewer
MOST_ROOM: Final = 512 << 20  # [bytes] however many seconds are asked for
MOST_DELTAS: Final = 4 << 20  # [bytes] of deltas after which the scene is taken anew
_RESYNC: Final = b'"resync":true'
_log = logging.getLogger(__name__)


class _Said(NamedTuple):
    topic: Topic[Any]
    payload: bytes
    time: int  # [ns]


class _Scene(NamedTuple):
    """The scene as it was, and the deltas that follow it."""

    snapshot: Snapshot
    tick: int
    time: int  # [ns]
    deltas: list[_Said]


class _Kept(NamedTuple):
    """An exact state, and the commands that follow it."""

    state: ExactState
    time: int  # [ns]
    commands: list[_Said]


class LastSeconds:
    """Keeps what `session` publishes; `take_snapshot` gives the scene as it is, which is asked for rarely.

    `exact` gives exact states, so that what is written can be run again. Kept are `seconds` of simulation.
    """

    def __init__(
        self,
        session: Session,
        *,
        take_snapshot: Callable[[], Snapshot],
        assets: AssetStore,
        exact: ExactSource | None = None,
        seconds: float = SECONDS,
        box: CrashBox | None = None,
    ) -> None:
        self._seconds, self._room = seconds, room_for(seconds)
        self._is_shortened = False  # and it was said
        self._box = box
        self._boxed: set[str] = set()  # assets; of the box's thread alone
        self._session = session
        self._take_snapshot = take_snapshot
        self._assets = assets
        self._ticks: deque[tuple[int, int, list[_Said]]] = deque()  # tick, bytes, what was said
        self._now: list[_Said] = []
        self._size = 0  # of all that is kept [bytes]
        self._now_size = 0
        self._tick = 0
        self._delta_size = 0
        self._scenes: deque[_Scene] = deque()
        self._states: deque[_Kept] = deque()
        self._exact = exact
        self._writers: list[threading.Thread] = []
        self._take_scene()
        if box is not None:
            box.begin(self._beginning)
        if exact is not None:
            exact.listeners.append(self)
            if (now := exact.exact_now()) is not None:
                self.take(now)
        session.taps.append(self.publication)

    def wants(self, head: ExactHead, size: int) -> bool:
        """Whether an exact state would be kept."""
        last = self._states[-1].state.head if self._states else None
        return last is None or head.is_unexplained or not 0.0 <= head.time - last.time < self._seconds / 2.0

    def take(self, state: ExactState) -> None:
        """Keeps an exact state."""
        now = time.time_ns()
        self._states.append(_Kept(state, now, []))
        if self._box is not None:
            self._box.exact(lambda: _framed_state(state, now))

    def publication(self, topic: Topic[Any], _: str, payload: bytes) -> None:
        """Takes what the session has just published."""
        if not topic.recorded or topic is topics.STATUS:
            return
        said = _Said(topic, payload, time.time_ns())
        if self._box is not None:
            self._put_into(self._box, said)
        if topic is topics.COMMANDS and self._states:
            self._states[-1].commands.append(said)
            return
        if topic is topics.DELTA:
            self._scenes[-1].deltas.append(said)
            self._delta_size += len(payload)
            if _RESYNC in payload or self._delta_size > MOST_DELTAS:
                self._take_scene()
            return
        self._now.append(said)
        self._now_size += len(payload)

    def end_tick(self, tick: int, tick_rate: float) -> None:
        """Ends a tick: what is older than `SECONDS` is let go."""
        self._ticks.append((tick, self._now_size, self._now))
        self._size += self._now_size
        self._now, self._now_size, self._tick = [], 0, tick
        oldest = tick - self._seconds * tick_rate
        while len(self._ticks) > 1 and (self._ticks[0][0] < oldest or self._size > self._room):
            if not self._is_shortened and self._ticks[0][0] > oldest:
                self._say_shortened((tick - self._ticks[0][0]) / tick_rate)
            self._size -= self._ticks.popleft()[1]
        while len(self._scenes) > 1 and self._scenes[1].tick < self._ticks[0][0]:
            self._scenes.popleft()
            if self._box is not None:
                self._box.drop_scene()
        while len(self._states) > 1 and self._states[1].state.head.tick < self._ticks[0][0]:
            self._states.popleft()
            if self._box is not None:
                self._box.drop_exact()
        if self._box is not None:
            self._box.end_tick(tick, tick_rate)

    def save(self, path: Path) -> None:
        """Begins to write what is kept; a thread of its own does it, and tells in the log when the file is whole."""
        said = [message for _, _, messages in self._ticks for message in messages]
        scenes = [_Scene(scene.snapshot, scene.tick, scene.time, list(scene.deltas)) for scene in self._scenes]
        states = [_Kept(kept.state, kept.time, list(kept.commands)) for kept in self._states]
        work = (path, self._session.name, scenes, states, said)
        writer = threading.Thread(target=self._write, args=work, name="elys-last-seconds")
        self._writers.append(writer)
        writer.start()

    @property
    def is_writing(self) -> bool:
        """Whether a file is not whole yet."""
        return any(writer.is_alive() for writer in self._writers)

    def close(self, timeout: float = 30.0) -> None:
        """Keeps nothing any more, and waits until what is being written is whole, at most `timeout` seconds."""
        if self.publication in self._session.taps:
            self._session.taps.remove(self.publication)
        if self._exact is not None and self in self._exact.listeners:
            self._exact.listeners.remove(self)
        for writer in self._writers:
            writer.join(timeout)
        if self._box is not None:
            self._box.close()

    # --- inside ----------------------------------------------------------------------------------------------------

    def _take_scene(self) -> None:
        snapshot = self._take_snapshot()
        self._delta_size = 0
        now = time.time_ns()
        self._scenes.append(_Scene(snapshot, snapshot.tick, now, []))
        if self._box is not None:
            self._box.scene(lambda: self._framed_scene(snapshot, now))

    def _say_shortened(self, seconds: float) -> None:
        self._is_shortened = True
        megabytes = self._room >> 20
        _log.info("the last %.1f s are kept, not %g: more would take over %d MB", seconds, self._seconds, megabytes)

    # --- for the box -----------------------------------------------------------------------------------------------

    def _put_into(self, box: CrashBox, said: _Said) -> None:
        topic, body = said.topic, memoryview(said.payload)[codec.PREFIX.size :]
        if topic is topics.DELTA:
            box.delta(topic.name, body, said.time)
        elif topic is topics.COMMANDS and self._states:
            box.command(topic.name, body, said.time)
        else:
            box.message(topic.name, body, said.time)
        if topic is topics.DELTA or topic is topics.EVENTS:
            box.assets(lambda: self._box_assets(box, bytes(body), said.time))

    def _beginning(self) -> Iterable[bytes | memoryview]:
        """What stands before everything."""
        now = time.time_ns()
        yield from _framed(FrameKind.BEGIN, self._session.name, self._scenes[0].snapshot.scene.encode(), now)
        yield from self._framed_facts(now)

    def _framed_scene(self, snapshot: Snapshot, moment: int) -> Iterable[bytes | memoryview]:
        body = codec.encode_body(snapshot, Encoding.JSON)
        assert self._box is not None
        self._box_assets(self._box, body, moment)
        yield from _framed(FrameKind.MESSAGE, topics.SNAPSHOT.name, body, moment)

    def _box_assets(self, box: CrashBox, body: bytes, moment: int) -> None:
        for reference in references_in(body):
            if reference not in self._boxed:
                self._boxed.add(reference)
                with contextlib.suppress(AssetError):  # told where it is drawn
                    box.asset(reference, self._assets.get(reference), moment)

    def _framed_facts(self, moment: int) -> Iterable[bytes | memoryview]:
        for name, values in (self._exact.facts() if self._exact is not None else {}).items():
            yield from _framed(FrameKind.FACTS, name, codec.encode_body(values, Encoding.JSON), moment)

    def _write(self, path: Path, session: str, scenes: list[_Scene], states: list[_Kept], said: list[_Said]) -> None:
        reading, writing = os.pipe()
        command = [sys.executable, "-m", "elys.bus.recorder_process", "--fd", str(reading), "--output", str(path)]
        try:
            with subprocess.Popen(
                command, pass_fds=[reading], stdin=subprocess.DEVNULL, start_new_session=True
            ) as process:
                os.close(reading)
                with os.fdopen(writing, "wb") as pipe:
                    for piece in self._pieces(session, scenes, states, said):
                        pipe.write(piece)
            status = process.returncode
        except OSError as error:
            _log.warning("the last seconds could not be written to %s: %s", path, error.strerror)
            return
        if status == 0:
            _log.warning("the last seconds before it are in %s: look at them with `elys play %s`", path, path)

    def _pieces(
        self, session: str, scenes: list[_Scene], states: list[_Kept], said: list[_Said]
    ) -> Iterable[bytes | memoryview]:
        sent: set[str] = set()
        first = scenes[0]
        yield from _framed(FrameKind.BEGIN, session, first.snapshot.scene.encode(), first.time)
        yield from self._framed_facts(first.time)
        for kept in states:
            yield from _framed_state(kept.state, kept.time)
            said = [*said, *kept.commands]
        for body, name, moment in _in_order(scenes, said):
            if name in (topics.SNAPSHOT.name, topics.DELTA.name, topics.EVENTS.name):
                yield from self._assets_of(body, sent, moment)
            yield from _framed(FrameKind.MESSAGE, name, body, moment)

    def _assets_of(self, body: bytes, sent: set[str], moment: int) -> Iterable[bytes]:
        for reference in references_in(body):
            if reference in sent:
                continue
            sent.add(reference)
            try:
                yield from _framed(FrameKind.ASSET, reference, self._assets.get(reference), moment)
            except AssetError as error:
                _log.warning("%s lacks an asset: %s", "the file of the last seconds", error)


def _in_order(scenes: list[_Scene], said: list[_Said]) -> Iterable[tuple[bytes, str, int]]:
    """Body, channel and time [ns] of everything, as it came."""
    scene = [(codec.encode_body(one.snapshot, Encoding.JSON), topics.SNAPSHOT.name, one.time) for one in scenes]
    deltas = [message for one in scenes for message in one.deltas]
    messages = [(one.payload[codec.PREFIX.size :], one.topic.name, one.time) for one in (*deltas, *said)]
    return sorted([*scene, *messages], key=lambda message: message[2])


def _framed_state(state: ExactState, moment: int) -> Iterable[bytes | memoryview]:
    parts = state.parts()
    yield frame_head(FrameKind.MESSAGE, topics.EXACT.name, sum(map(len, parts)), moment)
    yield from parts


def room_for(seconds: float) -> int:
    """How many bytes may be kept of so many seconds."""
    return min(max(ROOM, round(ROOM * seconds / SECONDS)), MOST_ROOM)


def _framed(kind: FrameKind, name: str, content: bytes, moment: int) -> Iterable[bytes]:
    yield frame_head(kind, name, len(content), moment)
    yield content
