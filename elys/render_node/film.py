"""Pictures as H.264 films."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import av
import numpy as np
from numpy.typing import NDArray

from elys.common.errors import ElysError
from elys.render_node.picture_files import VIDEO_SUFFIXES, output_kind
from elys.render_node.sound.mixer import RATE

CONSTANT_RATE_FACTOR: Final = "20"  # of H.264: hardly told from the original
ENCODER_THREADS: Final = "4"  # a number of its own: what is written depends on it, and must not on the machine
# x264 spreads quality over time by sums that come out otherwise in one film of two hundred.
SAME_BYTES: Final = "mbtree=0"
SOUND_BIT_RATE: Final = 160_000  # [bit/s] of AAC
AAC_SAMPLES: Final = 1024  # in a frame
MAX_VIDEO_EDGE: Final = 8192  # [pixels]


class VideoWriter:
    """An H.264 film in an mp4 file. Edges that are odd lose a pixel, as the format wants them even."""

    def __init__(self, path: Path, width: int, height: int, *, fps: float = 30.0, sound: bool = False) -> None:
        """With `sound` it has a track for `add_sound`.

        Raises ElysError where the file cannot be written or is no video by its suffix.
        """
        if output_kind(path) != "video":
            raise ElysError(f"{path} is no video: give it the suffix {' or '.join(VIDEO_SUFFIXES)}")
        check_video(width, height, fps)
        self.width, self.height = max(width & ~1, 2), max(height & ~1, 2)
        self._path = path
        self._is_broken = False
        rate = Fraction(fps).limit_denominator(1001)
        try:
            self._container = av.open(str(path), "w", options={"movflags": "faststart", "fflags": "+bitexact"})
            stream: Any = self._container.add_stream("libx264", rate=rate)
            self._track = _SoundTrack(self._container) if sound else None
        except (OSError, ValueError, av.FFmpegError) as error:
            raise ElysError(f"the video {path} cannot be written: {error}") from error
        stream.width, stream.height, stream.pix_fmt = self.width, self.height, "yuv420p"
        stream.options = {
            "crf": CONSTANT_RATE_FACTOR,
            "preset": "veryfast",
            "threads": ENCODER_THREADS,
            "x264-params": SAME_BYTES,
        }
        self._stream = stream

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Appends a picture: RGBA (H, W, 4), the upper row first, at least as large as the video."""
        picture = np.ascontiguousarray(pixels[: self.height, : self.width, :3])
        if picture.shape != (self.height, self.width, 3):
            raise ElysError(f"a picture of {picture.shape[1]} x {picture.shape[0]} is too small for the video")
        self._mux(av.VideoFrame.from_ndarray(picture, format="rgb24"))

    def add_sound(self, samples: NDArray[np.float32]) -> None:
        """Appends to the sound: (N, 2) at 48 kHz."""
        assert self._track is not None
        self._track.add(samples)
        self._mux_sound(self._track.packets())

    def close(self) -> None:
        """Finishes the file."""
        try:
            if not self._is_broken and self._track is not None:
                self._mux_sound(self._track.packets(is_end=True))
            if not self._is_broken:
                self._mux(None)
        finally:
            self._container.close()

    def _mux_sound(self, packets: Iterator[Any]) -> None:
        try:
            for packet in packets:
                self._container.mux(packet)
        except (OSError, ValueError, av.FFmpegError) as error:
            self._is_broken = True
            raise ElysError(f"the video {self._path} cannot be written: {error}") from error

    def _mux(self, frame: Any) -> None:
        try:
            self._container.mux(self._stream.encode(frame))
        except (OSError, ValueError, av.FFmpegError) as error:
            self._is_broken = True
            raise ElysError(f"the video {self._path} cannot be written: {error}") from error


class _SoundTrack:
    """AAC, in pieces of as many samples as it wants."""

    def __init__(self, container: Any) -> None:
        self._stream: Any = container.add_stream("aac", rate=RATE, layout="stereo", options={"flags": "+bitexact"})
        self._stream.bit_rate = SOUND_BIT_RATE
        self._waiting: Any = av.AudioFifo()
        self._count = 0

    def add(self, samples: NDArray[np.float32]) -> None:
        if not len(samples):
            return
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples.T), format="fltp", layout="stereo")
        frame.sample_rate, frame.pts, frame.time_base = RATE, self._count, Fraction(1, RATE)
        self._count += len(samples)
        self._waiting.write(frame)

    def packets(self, *, is_end: bool = False) -> Iterator[Any]:
        while (frame := self._waiting.read(AAC_SAMPLES, partial=is_end)) is not None:
            yield from self._stream.encode(frame)
        if is_end:
            yield from self._stream.encode(None)


def check_video(width: int, height: int, fps: float) -> None:
    """Raises ElysError for a film that cannot be made."""
    if max(width, height) > MAX_VIDEO_EDGE:
        raise ElysError(f"a video of {width} x {height} pixels cannot be written: edges go to {MAX_VIDEO_EDGE}")
    if not (0.1 <= fps <= 1000.0):
        raise ElysError(f"a video has between 0.1 and 1000 pictures a second, not {fps:g}")
