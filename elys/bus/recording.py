"""A recording as a timeline: frames by tick, and the scene as it was at any of them.

Opening reads where the state frames stand, not the frames. If the recorded host started anew, or was itself a replay that
was wound back, the file holds several runs; the timeline is the longest. A simulation that was rewound and went on as a fork
left two futures in the file: the index names the one that it kept, and nothing of what it showed of its past meanwhile.

What is damaged is left out, with one warning, by who opens it `checked`, which reads the whole file: all that read it anyway do.
A player opens at once, and anew where it comes upon damage.
"""

from __future__ import annotations

import contextlib
import copy
import logging
import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus import codec
from elys.bus.messages.scene import SceneDelta, Snapshot
from elys.bus.messages.state_frame import HEADER, StateFrame, unpack_frame
from elys.bus.mirror import SceneMirror
from elys.bus.recording_damage import LostPart, readable_frames
from elys.bus.topics import READABLE_VERSIONS, Encoding
from elys.bus.transports.mcap import EXACT_CHANNEL, METADATA_NAME
from elys.bus.transports.mcap_index import (
    DELTA_CHANNEL,
    LATEST,
    SCENE_INDEX,
    SCENE_INDEX_NAME,
    SNAPSHOT_CHANNEL,
    STATE_CHANNEL,
    STATE_INDEX,
    STATE_INDEX_NAME,
    IndexBuilder,
)
from elys.bus.transports.mcap_reading import McapReader, Place, RecordedMessage
from elys.common.assets.store import is_reference, reference_of
from elys.common.errors import MessageError, RecordingError

# By column of frames: what a compact recording calls the largest error, and its unit.
_STATED: Final = {
    "position": ("position_error_m", 1.0),
    "rotation": ("rotation_error_degrees", math.pi / 180.0),
    "linear_velocity": ("linear_velocity_error_m_s", 1.0),
    "angular_velocity": ("angular_velocity_error_rad_s", 1.0),
}
_ROUNDED: Final = 1.005  # what is told with three digits
_log = logging.getLogger(__name__)


class Recording:
    """An open recording of a session. Positions number its frames from 0.

    Attributes:
        bounds: by column of frames how far values may lie from what they were (rotations: [rad]); {} of a lossless recording.
        epoch: which run of the host made its frames. run_count: how many runs the file holds.
        lost: what is damaged, as far as it is known. is_checked: all of it is, and none of its frames is named here.
        tick: [F] u64. time: [F] f64 s of simulation, never falling. body_count: [F] u32.

    Raises:
        RecordingError: it cannot be read, was made by another version, or holds no scene or no frame.
    """

    def __init__(self, path: Path, *, run: int | None = None, checked: bool = False) -> None:
        self.path = path
        self.reader = McapReader(path)
        self.is_checked = checked or self.reader.mended
        self.lost: tuple[LostPart, ...] = ()
        try:
            self._check_version()
            if checked:
                self.reader.check()
            self._all_frames, self._all_scene = self._read_indexes()
            if self.is_checked:
                self._leave_out_damage()
            self._take(run)
        except BaseException:
            self.reader.close()
            raise

    def other_run(self, number: int) -> Recording:
        """Another of the runs that the file holds; it is read through the same open file, which whoever opened it closes."""
        other = copy.copy(self)
        other._take(number)
        return other

    def _take(self, run: int | None) -> None:
        """Makes a run the timeline."""
        frames, following, self.run_count = _run_of(self._all_frames, self.path, run)
        scene = self._all_scene
        self._scene = _SceneIndex(scene[scene["epoch"] == frames["epoch"][0]], self.path)
        self.epoch = int(frames["epoch"][0])
        self.bounds = _bounds(self.reader.metadata[METADATA_NAME])
        self.tick: NDArray[np.uint64] = frames["tick"]
        self.time: NDArray[np.float64] = frames["time"]
        self.body_count: NDArray[np.uint32] = frames["body_count"]
        self._sequences: NDArray[np.uint64] = frames["delta_sequence"]
        self._places = _places(frames)
        self._end = next(iter(_places(following)), None)  # the first frame of another run

    def close(self) -> None:
        """Closes the file."""
        self.reader.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._places)

    # --- frames ----------------------------------------------------------------------------------------------------

    def position_at(self, time: float) -> int:
        """The frame nearest to a simulation time [s]; of several at one tick the last."""
        after = int(np.searchsorted(self.time, time, side="right"))
        if after == 0:
            return self.last_of_tick(0)
        if after < len(self) and self.time[after] - time < time - self.time[after - 1]:
            return self.last_of_tick(after)
        return after - 1

    def last_of_tick(self, position: int) -> int:
        """The last frame of the tick that the frame at `position` shows."""
        return int(np.searchsorted(self.tick, self.tick[position], side="right")) - 1

    def frame_body(self, position: int) -> bytes:
        """A frame as it was recorded, header and columns."""
        body = self.reader.message_at(self._places[position]).body
        if len(body) < HEADER.size or HEADER.unpack_from(body)[1] != int(self.tick[position]):
            raise RecordingError(f"the index of {self.path} is wrong: there is no frame of tick {self.tick[position]}")
        return body

    def frame(self, position: int) -> StateFrame:
        """A frame, decoded."""
        try:
            return unpack_frame(self.frame_body(position))
        except MessageError as error:
            raise RecordingError(f"a frame in {self.path} is damaged: {error}") from error

    def place(self, position: int) -> Place:
        """Where a frame's message stands in the file."""
        return self._places[position]

    def log_time(self, position: int) -> int:
        """When a frame was recorded [ns], by the recorder's wall clock."""
        return self.reader.message_at(self._places[position]).log_time

    def is_within(self, message: RecordedMessage) -> bool:
        """Whether a message belongs to the run that is the timeline, and not to another in the same file."""
        return message.place >= self._places[0] and (self._end is None or message.place < self._end)

    def messages_of(self, first: int, last: int) -> Iterator[RecordedMessage]:
        """What else was recorded with the frames from `first` to `last`: after each and before the next, scene left out.

        What came with frames that are not part of the timeline is left out.
        """
        start = self._places[first]
        end = self._places[last + 1] if last + 1 < len(self) else self._end
        shown = set(self._places[first : last + 1])
        is_shown = True
        for message in self.reader.stored_messages(start=start, end=end):
            if message.channel == STATE_CHANNEL:
                is_shown = message.place in shown
            elif is_shown and message.channel not in (SNAPSHOT_CHANNEL, DELTA_CHANNEL, EXACT_CHANNEL):
                yield message

    # --- the scene -------------------------------------------------------------------------------------------------

    def mirror_at(self, position: int) -> SceneMirror:
        """The scene as it was at a frame, with that frame."""
        mirror = SceneMirror()
        target = int(self._sequences[position])
        # What was recorded from outside may begin with frames that are older than its first snapshot.
        self._become(mirror, self._scene.snapshot_between(-2, target) or self._scene.first_snapshot())
        self.advance(mirror, position)
        mirror.keep_frame(self.frame(position))
        return mirror

    def needs_rebuilding(self, mirror: SceneMirror, position: int) -> bool:
        """Whether the mirror's scene is later than that of the frame at `position`, so that `advance` cannot lead there."""
        return mirror.sequence > max(int(self._sequences[position]), self._scene.first_sequence)

    def advance(self, mirror: SceneMirror, position: int) -> list[SceneDelta] | None:
        """Brings a mirror of an earlier frame to a later one, the frame itself left out.

        Returns the deltas that did it; None when it took a snapshot, so that everything may have changed.
        """
        target = int(self._sequences[position])
        followed: list[SceneDelta] | None = []
        while mirror.sequence < target:
            delta = self._follow(mirror)
            if delta is not None:
                if followed is not None:
                    followed.append(delta)
                continue
            # A gap or a resync: the recorder asked for a snapshot then. Until there is one, the scene is the last known.
            place = self._scene.snapshot_between(mirror.sequence, target)
            if place is None:
                break
            self._become(mirror, place)
            followed = None
        return followed

    def _follow(self, mirror: SceneMirror) -> SceneDelta | None:
        """Applies the next delta, if there is one that can be."""
        place = self._scene.deltas.get(mirror.sequence + 1)
        if place is None:
            return None
        try:
            delta = codec.decode_body(self.reader.message_at(place).body, SceneDelta, Encoding.JSON)
            if delta.resync:
                return None
            mirror.apply_delta(delta)
        except MessageError as error:
            _log.warning("a delta in %s cannot be followed: %s", self.path, error)
            return None
        return delta

    def _become(self, mirror: SceneMirror, place: Place) -> None:
        try:
            mirror.apply_snapshot(codec.decode_body(self.reader.message_at(place).body, Snapshot, Encoding.JSON))
        except MessageError as error:
            raise RecordingError(f"a snapshot in {self.path} cannot be used: {error}") from error

    # --- assets ----------------------------------------------------------------------------------------------------

    def asset_references(self) -> list[str]:
        """The assets the recording carries."""
        return [name for name in self.reader.attachments if is_reference(name)]

    def asset(self, reference: str) -> bytes:
        """The content named `reference`; RecordingError if the recording lacks it or it is damaged."""
        data = self.reader.attachment(reference)
        if reference_of(data) != reference:
            raise RecordingError(f"the asset {reference} in {self.path} is damaged")
        return data

    # --- opening ---------------------------------------------------------------------------------------------------

    def _check_version(self) -> None:
        made = self.reader.metadata.get(METADATA_NAME)
        if made is None:
            raise RecordingError(f"{self.path} is an MCAP file, but no recording of ELYS")
        if made.get("protocol") not in [str(version) for version in READABLE_VERSIONS]:
            raise RecordingError(
                f"{self.path} was recorded by ELYS {made.get('elys', '?')} in protocol version {made.get('protocol', '?')}; "
                f"this one reads versions {' and '.join(map(str, READABLE_VERSIONS))}: open it with that release"
            )

    def _read_indexes(self) -> tuple[NDArray[Any], NDArray[Any]]:
        reader = self.reader
        if reader.mended:  # what is left of its chunks need not be numbered as they were
            return self._find_indexes()
        try:
            frames = _array(reader.attachment(STATE_INDEX_NAME), STATE_INDEX)
            scene = _array(reader.attachment(SCENE_INDEX_NAME), SCENE_INDEX)
            for index in (frames, scene):
                if np.any(index["chunk"] >= reader.chunk_count):
                    raise RecordingError(f"the index of {self.path} names chunks that are not there")
            if not np.all((frames["time"] >= 0.0) & (frames["time"] < LATEST)):
                raise RecordingError(f"the index of {self.path} names times that are none")
        except RecordingError as error:
            _log.warning("%s: reading the whole file instead", error)
            return self._find_indexes()
        return frames, scene

    def _leave_out_damage(self) -> None:
        """Names nothing that is in a damaged part, nor frames that are told against such; says so."""
        parts = self.reader.damaged_parts()
        if not parts:
            return
        self._all_frames, self.lost = readable_frames(self.reader, self._all_frames, parts)
        self._all_scene = self._all_scene[~np.isin(self._all_scene["chunk"], list(self.reader.damaged))]
        first, more = self.lost[0], len(self.lost) - 1
        _log.warning(
            "%s is damaged: %s%s; it is read without that, and `elys recover %s` writes a whole file of the rest",
            self.path,
            first.sentence,
            f", and {more} more part{'s' if more > 1 else ''}" if more else "",
            self.path,
        )

    def _find_indexes(self) -> tuple[NDArray[Any], NDArray[Any]]:
        builder = IndexBuilder()
        is_packed = self.reader.packs_frames
        for message in self.reader.stored_messages((STATE_CHANNEL, DELTA_CHANNEL, SNAPSHOT_CHANNEL)):
            builder.add_stored(message.channel, message.body, *message.place, is_packed=is_packed)
        return builder.frames(), builder.scene()


def opened_to_show(path: Path, time: float = -math.inf) -> Recording:
    """A recording whose scene at a time [s] can be had: open at once, and `checked` only where what stands there is damaged.

    Raises:
        RecordingError: as `Recording`.
    """
    recording = Recording(path)
    try:
        recording.mirror_at(recording.position_at(time))
    except RecordingError:
        recording.close()
        if recording.is_checked:
            raise
        return Recording(path, checked=True)
    except BaseException:
        recording.close()
        raise
    return recording


class _SceneIndex:
    """Where the snapshots and deltas of one run stand, by their number."""

    def __init__(self, entries: NDArray[Any], path: Path) -> None:
        self._snapshots: list[tuple[int, Place]] = []
        self.deltas: dict[int, Place] = {}
        sequences, are_snapshots = entries["sequence"].tolist(), entries["is_snapshot"].tolist()
        for sequence, is_snapshot, place in zip(sequences, are_snapshots, _places(entries), strict=True):
            if is_snapshot:
                self._snapshots.append((sequence, place))
            else:
                self.deltas[sequence] = place
        if not self._snapshots:
            raise RecordingError(f"{path} holds no scene: it was cut before the first snapshot")
        self._snapshots.sort(key=lambda snapshot: snapshot[0])
        self.first_sequence = self._snapshots[0][0]

    def first_snapshot(self) -> Place:
        return self._snapshots[0][1]

    def snapshot_between(self, after: int, until: int) -> Place | None:
        """The latest snapshot numbered above `after` and not above `until`."""
        found = [place for sequence, place in self._snapshots if after < sequence <= until]
        return found[-1] if found else None


def _places(index: NDArray[Any]) -> list[Place]:
    return [Place(*pair) for pair in zip(index["chunk"].tolist(), index["message"].tolist(), strict=True)]


def _array(data: bytes, dtype: np.dtype[Any]) -> NDArray[Any]:
    if len(data) % dtype.itemsize:
        raise RecordingError("an index in the recording is damaged")
    return np.frombuffer(data, dtype)


def _bounds(made: Mapping[str, str]) -> dict[str, float]:
    bounds = {}
    for column, (name, unit) in _STATED.items():
        with contextlib.suppress(ValueError, KeyError):
            bounds[column] = float(made[name]) * unit * _ROUNDED
    return bounds


def _run_of(frames: NDArray[Any], path: Path, number: int | None) -> tuple[NDArray[Any], NDArray[Any], int]:
    """A stretch of one epoch in which neither tick nor time goes back, what comes after it, and how many there are.

    `number` counts them in the order of the file; None: the longest.
    """
    if not len(frames):
        raise RecordingError(f"{path} holds no state frame: nothing was recorded of any tick")
    earlier, later = frames[:-1], frames[1:]
    breaks = (
        (earlier["epoch"] != later["epoch"]) | (earlier["tick"] > later["tick"]) | ~(earlier["time"] <= later["time"])
    )
    bounds = [0, *(np.flatnonzero(breaks) + 1).tolist(), len(frames)]
    runs = list(pairwise(bounds))
    first, last = max(runs, key=lambda run: run[1] - run[0]) if number is None else runs[number]
    if len(runs) > 1 and number is None:
        _log.warning(
            "%s holds %d runs; this is the longest, %d of %d frames", path, len(runs), last - first, len(frames)
        )
    return frames[first:last], frames[last:], len(runs)
