"""The machine's loudspeakers, through miniaudio; without it, or without a device, all is silent, and it is said once."""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.sound.mixer import RATE

BUFFER: Final = 60  # [ms] that are mixed ahead
_log = logging.getLogger(__name__)


class SoundOutput:
    """Asks `mix` for samples (N, 2) f32, on a thread of its own, until it is closed."""

    def __init__(self, mix: Callable[[int], NDArray[np.float32]]) -> None:
        self._device: Any = None
        try:
            import miniaudio
        except ImportError:
            _log.warning("sounds are not heard: miniaudio is not installed (pip install 'elys[sound]')")
            return
        try:
            self._device = miniaudio.PlaybackDevice(
                output_format=miniaudio.SampleFormat.FLOAT32,
                nchannels=2,
                sample_rate=RATE,
                buffersize_msec=BUFFER,
                app_name="ELYS",
            )
            self._device.start(_primed(_stream(mix)))
        except miniaudio.MiniaudioError as error:
            self.close()
            _log.warning("sounds are not heard: this machine has no device that plays them (%s)", error)

    @property
    def is_heard(self) -> bool:
        """Whether there is a device."""
        return self._device is not None

    def close(self) -> None:
        """Gives the device back."""
        if self._device is not None:
            self._device.close()
            self._device = None


def _stream(mix: Callable[[int], NDArray[np.float32]]) -> Generator[bytes, int, None]:
    count = yield b""
    while True:
        count = yield mix(count).tobytes()


def _primed(stream: Generator[bytes, int, None]) -> Generator[bytes, int, None]:
    next(stream)
    return stream
