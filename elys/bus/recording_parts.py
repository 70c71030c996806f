"""Recordings made of parts of others: `cut` takes a time out of one, `merge` puts several of one session together.

What is written is a recording like any other: it begins with the scene as it was then, carries the assets that it names, and
its frames, events and commands are those of the sources, bit for bit.
"""

from __future__ import annotations

import heapq
import logging
from collections import OrderedDict
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from hashlib import blake2b
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from elys.bus import codec, topics
from elys.bus.compressed_video import VIDEO_PREFIX
from elys.bus.exports.files import whole_file
from elys.bus.exports.selection import Progress, Selection, no_progress, selected_positions
from elys.bus.messages.scene import SceneDelta
from elys.bus.messages.state_frame import HEADER
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.bus.recording_sources import SOURCES_NAME, Sources, source_of, sources_metadata
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import METADATA_NAME, McapWriter, recorded_channels
from elys.bus.transports.mcap_index import DELTA_CHANNEL, SNAPSHOT_CHANNEL, STATE_CHANNEL
from elys.bus.transports.mcap_reading import RecordedMessage
from elys.common.assets.store import references_in
from elys.common.errors import RecordingError

_REMEMBERED: Final = 1 << 14  # messages by which a second recorder's copies are known
_SCENE: Final = frozenset({STATE_CHANNEL, SNAPSHOT_CHANNEL, DELTA_CHANNEL})  # written by `_PartWriting.frame`
_log = logging.getLogger(__name__)


class PartReport(NamedTuple):
    """What a part holds."""

    ticks: int
    duration: float  # [s]
    duplicates: int  # messages that another source had as well
    gaps: tuple[tuple[int, int], ...]  # ticks between which nothing is in any source


def cut(source: Path, target: Path, selection: Selection, progress: Progress = no_progress) -> PartReport:
    """Writes a recording of the time between the selection's start and end.

    Raises:
        RecordingError: the source is no recording, has no tick in that time, or the target cannot be written.
    """
    _check_apart([source], target)
    with Recording(source, checked=True) as recording, whole_file(target) as part:
        positions = selected_positions(recording, Selection(start=selection.start, end=selection.end)).tolist()
        first, last = positions[0], positions[-1]
        # Several frames may tell of the first tick, as in a pause: all of them belong to it.
        first = int(np.searchsorted(recording.tick, recording.tick[first], side="left"))
        writing = _PartWriting(part, recording, Sources(made_by="cut", of=(source_of(recording, first, last),)))
        with writing:
            for message in _before(recording) if first == 0 else ():
                writing.message(recording, message)
            for position in range(first, last + 1):
                writing.frame(recording, position)
                for message in _beside(recording, position):
                    writing.message(recording, message)
                progress(position + 1 - first, last + 1 - first)
        return PartReport(len(positions), float(recording.time[last] - recording.time[first]), 0, ())


def merge(sources: Sequence[Path], target: Path, progress: Progress = no_progress) -> PartReport:
    """Writes one recording of all that is in several of the same session: parts that follow one another, or several recorders'.

    Each tick is there once, and each message that several have.

    Raises:
        RecordingError: a source is no recording or of another session, or the target cannot be written.
    """
    _check_apart(sources, target)
    with ExitStack() as stack:
        recordings = [stack.enter_context(Recording(source, checked=True)) for source in sources]
        recordings.sort(key=lambda recording: (int(recording.tick[0]), str(recording.path)))
        _check_same_session(recordings)
        part = stack.enter_context(whole_file(target))
        used = tuple(source_of(recording, 0, len(recording) - 1) for recording in recordings)
        writing = _PartWriting(part, recordings[0], Sources(made_by="merge", of=used))
        total, done, ticks = sum(map(len, recordings)), 0, []
        with writing:
            for number, recording in enumerate(recordings):
                for message in _before(recording):
                    writing.message(recordings[number], message, source=number)
            for tick, having in _by_tick(recordings):
                ticks.append(tick)
                number, first, last = having[0]
                for position in range(first, last + 1):
                    writing.frame(recordings[number], position)
                for number, first, last in having:
                    for position in range(first, last + 1):
                        for message in _beside(recordings[number], position):
                            writing.message(recordings[number], message, source=number)
                    done += last + 1 - first
                progress(done, total)
        duration = max(float(r.time[-1]) for r in recordings) - min(float(r.time[0]) for r in recordings)
        return PartReport(len(ticks), duration, writing.duplicates, gaps_in(ticks))


def gaps_in(ticks: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Between which ticks, of those that rise, some are missing."""
    numbers = np.asarray(ticks, np.uint64)
    places = np.flatnonzero(np.diff(numbers) > 1)
    return tuple((int(numbers[place]), int(numbers[place + 1])) for place in places)


class _PartWriting:
    """A recording that is being put together: frames with the scene that they need before them."""

    def __init__(self, path: Path, like: Recording, sources: Sources) -> None:
        made = like.reader.metadata[METADATA_NAME]
        self.duplicates = 0
        self._writer = McapWriter(
            path,
            session=made.get("session", ""),
            scene=made.get("scene", ""),
            compact=made.get("state") == "compact",
        )
        self._sources = sources
        # What else the file says of what was simulated: of which build, and of which recording it is a fork.
        self._facts = {
            name: values for name, values in like.reader.metadata.items() if name not in (METADATA_NAME, SOURCES_NAME)
        }
        self._mirror: SceneMirror | None = None
        self._given_up = -1  # a number of deltas that cannot be reached
        self._channels = frozenset(recorded_channels()) - _SCENE
        self._assets: set[str] = set()
        self._unknown: set[str] = set()
        self._told: OrderedDict[tuple[str, bytes], int] = OrderedDict()  # -> the source that had it first

    def __enter__(self) -> None:
        self._writer.add_metadata(SOURCES_NAME, sources_metadata(self._sources))
        for name, values in self._facts.items():
            self._writer.add_metadata(name, values)

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def frame(self, recording: Recording, position: int) -> None:
        """Writes a frame, and before it what of the scene changed since the one before."""
        now = recording.log_time(position)
        body = recording.frame_body(position)
        followed = self._follow(recording, position, HEADER.unpack_from(body)[4])
        if followed is None:
            assert self._mirror is not None
            self._scene(recording, SNAPSHOT_CHANNEL, codec.encode_body(self._mirror.to_snapshot(), Encoding.JSON), now)
        else:
            for delta in followed:
                self._scene(recording, DELTA_CHANNEL, codec.encode_body(delta, Encoding.JSON), now)
        self._writer.write(STATE_CHANNEL, body, log_time=now)

    def _follow(self, recording: Recording, position: int, target: int) -> list[SceneDelta] | None:
        """Brings the scene to that of a frame; returns the deltas that did it, None where everything may have changed."""
        mirror = self._mirror
        if mirror is None or recording.needs_rebuilding(mirror, position):
            self._mirror = recording.mirror_at(position)
            return None
        followed = recording.advance(mirror, position)
        if mirror.sequence < target and target != self._given_up:
            # What leads here is not in this source; it may have a snapshot that does.
            anew = recording.mirror_at(position)
            if anew.sequence > mirror.sequence:
                self._mirror = anew
                return None
            self._given_up = target
        return followed

    def message(self, recording: Recording, message: RecordedMessage, *, source: int = 0) -> None:
        """Writes what was said beside the frames, unless another source had it before."""
        key = (message.channel, blake2b(message.body, digest_size=16).digest())
        if self._told.get(key, source) != source:
            self.duplicates += 1
            return
        self._told[key] = source
        if len(self._told) > _REMEMBERED:
            self._told.popitem(last=False)
        if message.channel.startswith(VIDEO_PREFIX):
            self._writer.add_video(message.channel)
        elif message.channel not in self._channels:
            if message.channel not in self._unknown:
                self._unknown.add(message.channel)
                _log.warning("the channel %r is none of a recording: it is left out", message.channel[:80])
            return
        if message.channel == topics.EVENTS.name:
            self._attach(recording, message.body)  # the files of sounds
        self._writer.write(message.channel, message.body, log_time=message.log_time)

    def _scene(self, recording: Recording, channel: str, body: bytes, now: int) -> None:
        self._attach(recording, body)
        self._writer.write(channel, body, log_time=now)

    def _attach(self, recording: Recording, body: bytes) -> None:
        """Adds the assets that are named in it."""
        for reference in references_in(body):
            if reference in self._assets:
                continue
            self._assets.add(reference)
            try:
                self._writer.attach(reference, recording.asset(reference), media_type="application/octet-stream")
            except RecordingError as error:
                _log.warning("left out: %s", error)


def _beside(recording: Recording, position: int) -> Iterator[RecordedMessage]:
    """What was said after a frame and before the next, scene and frames left out."""
    start = recording.place(position)
    end = recording.place(position + 1) if position + 1 < len(recording) else None
    for message in recording.reader.stored_messages(start=start, end=end):
        if message.channel == STATE_CHANNEL and message.place != start:
            return  # what is of no timeline: told again of the past, or of a future that was given up, or of another run
        if message.channel not in _SCENE:
            yield message


def _before(recording: Recording) -> list[RecordedMessage]:
    """What was said before the first frame of the run."""
    found: list[RecordedMessage] = []
    for message in recording.reader.stored_messages(end=recording.place(0)):
        if message.channel == STATE_CHANNEL:
            found.clear()
        elif message.channel not in _SCENE:
            found.append(message)
    return found


def _by_tick(recordings: Sequence[Recording]) -> Iterator[tuple[int, list[tuple[int, int, int]]]]:
    """Every tick with who has it: the recording's number, and its first and last frame of that tick."""

    def frames(number: int) -> Iterator[tuple[int, int, int, int]]:
        ticks = recordings[number].tick
        starts = np.flatnonzero(np.append(True, ticks[1:] != ticks[:-1])).tolist()
        for first, after in zip(starts, [*starts[1:], len(ticks)], strict=True):
            yield int(ticks[first]), number, first, after - 1

    tick = -1
    having: list[tuple[int, int, int]] = []
    for here, number, first, last in heapq.merge(*(frames(number) for number in range(len(recordings)))):
        if having and here != tick:
            yield tick, having
            having = []
        tick = here
        having.append((number, first, last))
    if having:
        yield tick, having


def _check_apart(sources: Collection[Path], target: Path) -> None:
    """Raises RecordingError where the target is one of the sources."""
    for source in sources:
        if source.exists() and target.exists() and source.samefile(target):
            raise RecordingError(f"{target} is read here and cannot be written as well: choose another name with -o")


def _check_same_session(recordings: Sequence[Recording]) -> None:
    first = recordings[0]
    epoch = HEADER.unpack_from(first.frame_body(0))[0]
    for other in recordings[1:]:
        if HEADER.unpack_from(other.frame_body(0))[0] != epoch:
            raise RecordingError(
                f"{other.path} is of another run than {first.path}: only recordings of one and the same run can be merged"
            )
        if np.array_equal(other.tick, first.tick) and other.path.samefile(first.path):
            raise RecordingError(f"{other.path} is named twice")
