"""Voices into one stream of two channels: pitch by resampling, gains that go in ramps, and a limiter behind.

All works in quanta of 256 samples: within one a gain goes in a straight line, so nothing clicks; the limiter looks one ahead, so
nothing clips, and everything is heard 5 ms later.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

RATE: Final = 48_000  # [Hz]
QUANTUM: Final = 256  # samples
CEILING: Final = 0.97  # that no sample exceeds
RELEASE: Final = 0.06  # of what it is turned down, that the limiter gives back in a quantum
MOST_VOICES: Final = 64
SILENT: Final = 1e-5  # gain below which a voice is left out of the sum, and goes on unheard
_STEPS: Final = np.arange(QUANTUM)
_RISE: Final = (_STEPS + 1) / QUANTUM
Samples = NDArray[np.float32]  # (N, C), C of 1 or 2


class Voice:
    """A sound that is played.

    Attributes:
        left, right: the gains that it goes to.
        pitch: samples of the sound in one of the stream.
        is_over: it has ended; it is heard no more.
    """

    def __init__(
        self,
        samples: Samples,
        *,
        left: float = 1.0,
        right: float = 1.0,
        pitch: float = 1.0,
        loop: bool = False,
        fades_in: bool = False,
    ) -> None:
        """Begins as loud as it is, or from silence: that is for what does not begin at its beginning."""
        self.samples = samples
        self.left, self.right, self.pitch, self.loop = left, right, pitch, loop
        self.is_over = not len(samples)
        self._gain = (0.0, 0.0) if fades_in else (left, right)
        self._place = 0.0  # [samples] in the sound
        self._is_stopping = False

    def stop(self) -> None:
        """Falls silent within a quantum."""
        self._is_stopping = True

    def mix_into(self, stream: NDArray[np.float64]) -> None:
        """Adds a quantum (QUANTUM, 2)."""
        if self._is_stopping:
            self.left = self.right = 0.0
        start, end = self._gain, (self.left, self.right)
        self._gain = end
        if max(*start, *end) > SILENT:
            heard = self._read()
            for channel, (a, b) in enumerate(zip(start, end, strict=True)):
                gain = b if a == b else a + (b - a) * _RISE
                stream[:, channel] += heard[:, min(channel, heard.shape[1] - 1)] * gain
        self._place += QUANTUM * self.pitch
        if self.loop:
            self._place %= len(self.samples)
        self.is_over = self._is_stopping or self._place >= len(self.samples) + 1

    def _read(self) -> NDArray[np.floating[Any]]:
        """The next quantum of the sound, at its pitch: between samples by cubics through four of them (Catmull and Rom)."""
        if self.pitch == 1.0 and self._place == int(self._place):
            return self._segment(int(self._place), QUANTUM)
        place = self._place + _STEPS * self.pitch
        first = int(place[0]) - 1
        whole = place.astype(np.intp)
        near = self._segment(first, int(whole[-1]) + 3 - first)
        t = (place - whole)[:, None]
        row = whole - first
        a, b, c, d = near[row - 1], near[row], near[row + 1], near[row + 2]
        return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))

    def _segment(self, first: int, count: int) -> Samples:
        """Samples from one on, of the loop or with silence before and behind."""
        samples, last = self.samples, first + count
        if first >= 0 and last <= len(samples):
            return samples[first:last]
        if self.loop:
            return samples[np.arange(first, last) % len(samples)]
        found = np.zeros((count, samples.shape[1]), np.float32)
        start, end = max(first, 0), min(last, len(samples))
        if end > start:
            found[start - first : end - first] = samples[start:end]
        return found


class Limiter:
    """Turns down what would clip, and up again slowly. What is quiet passes as it is, a quantum later."""

    def __init__(self) -> None:
        self._waiting = np.zeros((QUANTUM, 2))
        self._need = 1.0  # gain at most, of what waits
        self._gain = 1.0  # at the end of what went out last

    def pass_through(self, quantum: NDArray[np.float64]) -> NDArray[np.float64]:
        """Takes a quantum (QUANTUM, 2) and gives back the one before."""
        peak = float(np.abs(quantum).max())
        need = min(1.0, CEILING / peak) if peak > 0.0 else 1.0
        # The line between two gains stays below what either quantum needs where both ends do.
        end = min(self._need, need, self._gain + (1.0 - self._gain) * RELEASE)
        gains = self._gain + (end - self._gain) * _RISE
        out = self._waiting * gains[:, None]
        self._waiting, self._need, self._gain = quantum, need, end
        return out


class Mixer:
    """All voices. One thread mixes; voices are added and changed between quanta."""

    def __init__(self) -> None:
        self.voices: list[Voice] = []
        self.volume = 1.0
        self._volume = 1.0
        self._limiter = Limiter()
        self._left_over = np.zeros((0, 2), np.float32)

    def add(self, voice: Voice) -> None:
        """Plays it from now on; where there are too many, those stop that are heard least."""
        self.voices = [*self.voices, voice]
        beyond = len(self.voices) - MOST_VOICES
        if beyond > 0:
            for quiet in sorted(self.voices, key=lambda one: one.left + one.right)[:beyond]:
                quiet.stop()

    def mix(self, count: int) -> NDArray[np.float32]:
        """The next `count` samples (count, 2) of the stream, from -1 to 1."""
        parts = [self._left_over]
        have = len(self._left_over)
        while have < count:
            parts.append(self._quantum())
            have += QUANTUM
        whole = np.concatenate(parts)
        self._left_over = whole[count:]
        return whole[:count]

    def _quantum(self) -> NDArray[np.float32]:
        stream = np.zeros((QUANTUM, 2))
        voices = self.voices
        for voice in voices:
            voice.mix_into(stream)
        if any(voice.is_over for voice in voices):
            self.voices = [voice for voice in self.voices if not voice.is_over]
        end = self.volume
        stream *= (self._volume + (end - self._volume) * _RISE)[:, None]
        self._volume = end
        return self._limiter.pass_through(stream).astype(np.float32)
