"""A recording again, with pictures of what it holds: `elys render run.mcap -o with_pictures.mcap`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.compressed_video import VIDEO_PREFIX, video_body, video_channel
from elys.bus.messages.state_frame import HEADER, StateFrame
from elys.bus.recording import Recording
from elys.bus.recording_names import require_free
from elys.bus.transports.mcap import COMPONENTS_NAME, METADATA_NAME, McapWriter, recorded_channels
from elys.bus.transports.mcap_frames import STATE_KEYS_NAME
from elys.bus.transports.mcap_index import SCENE_INDEX_NAME, STATE_CHANNEL, STATE_INDEX_NAME
from elys.common.errors import RecordingError
from elys.render_node.view_encoder import ViewEncoder

KEYFRAME_TIME: Final = 2.0  # [s] of simulation between pictures that can be seen by themselves
PRESET: Final = "veryfast"  # of x264: there is time
_MADE_ANEW: Final = (COMPONENTS_NAME, STATE_INDEX_NAME, SCENE_INDEX_NAME, STATE_KEYS_NAME)
_log = logging.getLogger(__name__)

Draw = Callable[[StateFrame], NDArray[np.uint8]]  # RGBA (H, W, 4) of a frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """Which pictures are added: `fps` a second of simulation at most, of the frames that come and of `duration` [s] of them."""

    name: str
    width: int
    height: int
    fps: float
    duration: float


def with_pictures(
    recording: Recording,
    output: Path,
    strip: Strip,
    frames: Iterator[StateFrame],
    draw: Draw,
    progress: Callable[[], None],
) -> int:
    """Copies a recording and puts a picture behind frames that `frames` gives, in their order; returns how many.

    Raises:
        RecordingError: the output is the recording itself, cannot be written, or has pictures of that name already.
    """
    channel = video_channel(strip.name)
    if output.exists() and output.samefile(recording.path):
        raise RecordingError(f"{output} is the recording itself: name another file for the one with pictures")
    if recording.reader.message_counts().get(channel):
        raise RecordingError(f"{recording.path} holds pictures of '{strip.name}' already: look through another camera")
    require_free(output, remedy="move it away, or name another file for the one with pictures")
    made = recording.reader.metadata.get(METADATA_NAME, {})
    writer = McapWriter(output, session=made.get("session", ""), scene=made.get("scene", ""))
    try:
        count = _copy(recording, writer, strip, frames, draw, progress)
        writer.close()
    except BaseException:
        writer.close()
        output.unlink(missing_ok=True)  # half a copy is none
        raise
    return count


def _copy(
    recording: Recording,
    writer: McapWriter,
    strip: Strip,
    frames: Iterator[StateFrame],
    draw: Draw,
    progress: Callable[[], None],
) -> int:
    encoder = ViewEncoder(strip.width, strip.height, preset=PRESET)
    channel, known = video_channel(strip.name), set(recorded_channels())
    writer.add_video(channel)
    count, due, keyframe_due = 0, -np.inf, -np.inf
    frame = first = next(frames, None)
    for message in recording.reader.messages():
        if message.channel.startswith(VIDEO_PREFIX):
            writer.add_video(message.channel)
        elif message.channel not in known:
            continue  # of a program that adds its own; what it means is not known here
        writer.write(message.channel, message.body, log_time=message.log_time)
        if frame is None or first is None or message.channel != STATE_CHANNEL or not recording.is_within(message):
            continue
        if HEADER.unpack_from(message.body)[1] != frame.tick:
            continue
        time = frame.simulation_time
        if time >= due and time - first.simulation_time <= strip.duration + 1e-9:
            coded = encoder.encode(draw(frame), keyframe=time >= keyframe_due)
            keyframe_due = time + KEYFRAME_TIME if coded.is_keyframe else keyframe_due
            # What is due counts from the first, so that rounding adds up to nothing.
            due = (
                first.simulation_time
                + (np.floor((time - first.simulation_time) * strip.fps + 1e-6) + 1.0) / strip.fps
                - 1e-6
            )
            body = video_body(coded.data, time_ns=frame.published_at, frame_id=strip.name)
            writer.write(channel, body, log_time=message.log_time)
            count += 1
            progress()
        frame = next(frames, None)
    for name in recording.reader.attachments:
        if name not in _MADE_ANEW:
            writer.attach(name, recording.reader.attachment(name), media_type="application/octet-stream")
    return count
