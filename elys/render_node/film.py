"""Pictures as H.264 films."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import av
import numpy as np
from numpy.typing import NDArray

from elys.common.errors import ElysError
from elys.render_node.picture_files import VIDEO_SUFFIXES, output_kind

CONSTANT_RATE_FACTOR: Final = "20"  # of H.264: hardly told from the original
ENCODER_THREADS: Final = "4"  # a number of its own: what is written depends on it, and must not on the machine
MAX_VIDEO_EDGE: Final = 8192  # [pixels]


class VideoWriter:
    """An H.264 film in an mp4 file. Edges that are odd lose a pixel, as the format wants them even."""

    def __init__(self, path: Path, width: int, height: int, *, fps: float = 30.0) -> None:
        """Raises ElysError where the file cannot be written or is no video by its suffix."""
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
        except (OSError, ValueError, av.FFmpegError) as error:
            raise ElysError(f"the video {path} cannot be written: {error}") from error
        stream.width, stream.height, stream.pix_fmt = self.width, self.height, "yuv420p"
        stream.options = {"crf": CONSTANT_RATE_FACTOR, "preset": "veryfast", "threads": ENCODER_THREADS}
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

    def close(self) -> None:
        """Finishes the file."""
        try:
            if not self._is_broken:
                self._mux(None)
        finally:
            self._container.close()

    def _mux(self, frame: Any) -> None:
        try:
            self._container.mux(self._stream.encode(frame))
        except (OSError, ValueError, av.FFmpegError) as error:
            self._is_broken = True
            raise ElysError(f"the video {self._path} cannot be written: {error}") from error


def check_video(width: int, height: int, fps: float) -> None:
    """Raises ElysError for a film that cannot be made."""
    if max(width, height) > MAX_VIDEO_EDGE:
        raise ElysError(f"a video of {width} x {height} pixels cannot be written: edges go to {MAX_VIDEO_EDGE}")
    if not (0.1 <= fps <= 1000.0):
        raise ElysError(f"a video has between 0.1 and 1000 pictures a second, not {fps:g}")
