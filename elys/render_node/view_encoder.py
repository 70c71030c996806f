"""Pictures of a view as a stream of H.264, for viewers to whom JPEG takes too long."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, Final, NamedTuple

import av
import numpy as np
from av.video.frame import PictureType
from numpy.typing import NDArray

from elys.common.errors import ElysError

CONSTANT_RATE_FACTOR: Final = 24  # of H.264: about as good as JPEG of quality 85
SHORTEST_BUFFER: Final = 0.25  # [s] of the bit rate that a single picture may take
TIME_BASE: Final = Fraction(1, 1000)
THREADS: Final = 4


class CodedPicture(NamedTuple):
    """One picture of a stream."""

    data: bytes  # Annex B
    number: int  # in the stream, from 1
    is_keyframe: bool  # can be seen without those before it


class ViewEncoder:
    """One stream of pictures of one size. Each is encoded at once and refers to none that comes later."""

    def __init__(self, width: int, height: int, *, bit_rate: float = 0.0, preset: str = "ultrafast") -> None:
        """`bit_rate` [bit/s] is the most that it takes; 0 leaves that to what is seen. `preset` is one of x264's.

        Raises ElysError.
        """
        self.width, self.height, self.bit_rate = width, height, bit_rate
        self._number = 0
        coder: Any = av.CodecContext.create("libx264", "w")
        coder.width, coder.height = width + width % 2, height + height % 2
        coder.pix_fmt, coder.time_base, coder.framerate = "yuv420p", TIME_BASE, Fraction(30)
        coder.thread_count = THREADS
        options = {"preset": preset, "tune": "zerolatency", "crf": str(CONSTANT_RATE_FACTOR), "forced-idr": "1"}
        limits = {"maxrate": str(int(bit_rate)), "bufsize": str(int(bit_rate * SHORTEST_BUFFER))} if bit_rate else {}
        coder.options = {**options, **limits, "x264-params": "keyint=infinite:scenecut=0:bframes=0"}
        try:
            coder.open()
        except (ValueError, av.FFmpegError) as error:
            raise ElysError(f"pictures of {width} x {height} cannot be encoded as H.264: {error}") from error
        self._coder = coder

    def encode(self, pixels: NDArray[np.uint8], *, keyframe: bool) -> CodedPicture:
        """Encodes RGB or RGBA pixels (H, W, 3 or 4), the upper row first. Raises ElysError."""
        even = np.pad(pixels, ((0, self.height % 2), (0, self.width % 2), (0, 0)), mode="edge")
        layout = "rgb24" if pixels.shape[-1] == 3 else "rgba"
        frame: Any = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format=layout)
        frame = frame.reformat(format="yuv420p")
        frame.pts, frame.time_base = self._number * 33, TIME_BASE
        frame.pict_type = PictureType.I if keyframe or not self._number else PictureType.NONE
        try:
            packets = self._coder.encode(frame)
        except (ValueError, av.FFmpegError) as error:
            raise ElysError(f"a picture cannot be encoded as H.264: {error}") from error
        self._number += 1
        data = b"".join(bytes(packet) for packet in packets)
        return CodedPicture(data, self._number, any(packet.is_keyframe for packet in packets))


class ViewDecoder:
    """Turns the pictures of such a stream back into pixels."""

    def __init__(self) -> None:
        self._last = 0  # the number of the picture that was decoded last
        self._decoder: Any = None

    def decode(self, picture: CodedPicture, width: int, height: int) -> NDArray[np.uint8] | None:
        """RGBA (H, W, 4), the upper row first; None where one before it is missing, so that a keyframe is needed.

        Raises ValueError for what is no such picture.
        """
        if picture.is_keyframe:
            self._decoder = av.CodecContext.create("h264", "r")
            self._decoder.thread_count = 1  # more would keep pictures back
        elif self._decoder is None or picture.number != self._last + 1:
            self._decoder = None
            return None
        self._last = picture.number
        try:
            frames = self._decoder.decode(av.Packet(picture.data))
        except av.FFmpegError as error:
            self._decoder = None
            raise ValueError(f"it is no H.264: {error}") from error
        if len(frames) != 1 or not (0 <= frames[0].width - width <= 1 and 0 <= frames[0].height - height <= 1):
            self._decoder = None
            raise ValueError(f"it holds no picture of {width} x {height}")
        pixels: NDArray[np.uint8] = frames[0].to_ndarray(format="rgba")[:height, :width]
        return pixels
