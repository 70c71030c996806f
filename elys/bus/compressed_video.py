"""Pictures of a recording: Foxglove's message for them, so that its viewer and others show them beside what was simulated.

https://docs.foxglove.dev/docs/sdk/schemas/compressed-video: H.264 as Annex B, a picture a message, without B frames, parameter
sets with each keyframe. Encoded as JSON like all else in a recording, so that whoever reads one of its channels reads this.
"""

from __future__ import annotations

import re
from typing import Any, Final

import msgspec

VIDEO_PREFIX: Final = "video/"  # of channels; what follows names the view
SCHEMA_NAME: Final = "foxglove.CompressedVideo"
_NANOSECONDS: Final = 1_000_000_000


class VideoTime(msgspec.Struct, frozen=True, kw_only=True):
    """Wall clock."""

    sec: int
    nsec: int


class CompressedVideo(msgspec.Struct, frozen=True, kw_only=True):
    """One picture. `data` is base64 in JSON."""

    timestamp: VideoTime
    frame_id: str
    data: bytes
    format: str


_SCHEMA: Final[dict[str, Any]] = {
    "title": SCHEMA_NAME,
    "description": "A single frame of a compressed video bitstream",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {
                "sec": {"type": "integer", "minimum": 0},
                "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999},
            },
            "description": "Timestamp of video frame",
        },
        "frame_id": {"type": "string", "description": "Frame of reference for the video"},
        "data": {
            "type": "string",
            "contentEncoding": "base64",
            "description": "Compressed video frame data: Annex B, one frame, no B frames, SPS and PPS with each IDR",
        },
        "format": {"type": "string", "description": "Video format: h264"},
    },
}


def video_schema() -> bytes:
    """The JSON Schema of the message."""
    return msgspec.json.encode(_SCHEMA)


def video_body(h264: bytes, *, time_ns: int, frame_id: str) -> bytes:
    """A message with a picture that shows what was at `time_ns` [ns] of the wall clock, seen from `frame_id`."""
    time = VideoTime(sec=time_ns // _NANOSECONDS, nsec=time_ns % _NANOSECONDS)
    return msgspec.json.encode(CompressedVideo(timestamp=time, frame_id=frame_id, data=h264, format="h264"))


def video_channel(name: str) -> str:
    """The channel of a view's pictures."""
    return VIDEO_PREFIX + (re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-") or "view")
