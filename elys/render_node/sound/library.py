"""Sounds by name: built in ones at once, files when they have come and are decoded, off the thread that draws."""

from __future__ import annotations

import io
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

import av
import numpy as np

from elys.common.components.sound import BUILT_IN_SOUNDS
from elys.common.errors import AssetError, ElysError
from elys.render_node.sound.built_in import built_in_sound
from elys.render_node.sound.mixer import RATE, Samples

LONGEST: Final = 300.0  # [s] of a file; what is longer is cut
_log = logging.getLogger(__name__)


class SoundLibrary:
    """A cache in front of `fetch`, which gives the bytes of a reference or raises an ElysError, and may block."""

    def __init__(self, fetch: Callable[[str], bytes]) -> None:
        self._fetch = fetch
        self._lock = threading.Lock()
        self._known: dict[str, Samples | None] = {}  # None: cannot be had
        self._pending: dict[str, Future[None]] = {}
        self._pool: ThreadPoolExecutor | None = None

    def sound(self, name: str) -> Samples | None:
        """The samples of a sound; None while it is on its way, or if it cannot be had, which is said once."""
        if name in BUILT_IN_SOUNDS:
            return built_in_sound(name)
        with self._lock:
            if name in self._known or name in self._pending:
                return self._known.get(name)
            self._pool = self._pool or ThreadPoolExecutor(2, thread_name_prefix="elys-sounds")
            self._pending[name] = self._pool.submit(self._load, name)
        return None

    def is_pending(self, name: str) -> bool:
        """Whether it is on its way."""
        with self._lock:
            return name in self._pending

    def settle(self, name: str, timeout: float = 60.0) -> Samples | None:
        """The same, waited for."""
        found = self.sound(name)
        with self._lock:
            pending = self._pending.get(name)
        if pending is not None:
            pending.result(timeout)
            found = self.sound(name)
        return found

    def close(self) -> None:
        """Ends the threads."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)

    def _load(self, name: str) -> None:
        found: Samples | None = None
        try:
            found = decode_sound(self._fetch(name))
        except (ElysError, TimeoutError) as error:
            _log.warning("%s is not heard: %s", name, str(error) or "nobody has answered in time")
        finally:
            with self._lock:
                self._known[name] = found
                self._pending.pop(name, None)


def decode_sound(data: bytes) -> Samples:
    """Samples (N, 1 or 2) at 48 kHz of a wav, ogg, flac or mp3 file.

    Raises:
        AssetError: the bytes are no such file, or a damaged one.
    """
    pieces: list[np.ndarray] = []
    left = round(LONGEST * RATE)
    try:
        with av.open(io.BytesIO(data)) as container:
            stream = container.streams.audio[0]
            layout = "mono" if stream.channels == 1 else "stereo"
            resampler = av.AudioResampler(format="fltp", layout=layout, rate=RATE)
            for frame in (*_frames(container, stream), None):
                for made in resampler.resample(frame):
                    if left > 0:
                        pieces.append(made.to_ndarray().T[:left])
                        left -= len(pieces[-1])
    except (OSError, ValueError, IndexError, av.FFmpegError) as error:
        raise AssetError(f"this is no sound that can be decoded (wav, ogg, flac or mp3): {error}") from error
    samples = np.concatenate(pieces).astype(np.float32) if pieces else np.zeros((0, 1), np.float32)
    if not np.isfinite(samples).all():
        raise AssetError("this sound has samples that are no numbers")
    return samples


def _frames(container: av.container.InputContainer, stream: object) -> list[object]:
    """All frames, up to the longest that is taken."""
    found: list[object] = []
    count = 0
    for frame in container.decode(stream):
        found.append(frame)
        count += frame.samples
        if count > LONGEST * frame.sample_rate:
            _log.warning("a sound is longer than %g s and is cut", LONGEST)
            break
    return found
