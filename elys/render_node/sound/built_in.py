"""Sounds that ELYS makes itself, the same each time: (N, 1) samples at 48 kHz, beginning and ending at 0."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components.sound import BUILT_IN_SOUNDS
from elys.render_node.sound.mixer import RATE, Samples

PEAK: Final = 0.8
ATTACK: Final = 0.0015  # [s] in which they rise from nothing
_SEED: Final = 20_011


@cache
def built_in_sound(name: str) -> Samples:
    """One of BUILT_IN_SOUNDS; KeyError for any other name."""
    wave = _MAKERS[name]()
    wave *= PEAK / np.abs(wave).max()
    samples = wave.astype(np.float32)[:, None]
    samples.setflags(write=False)  # it is shared
    return samples


def _time(seconds: float) -> NDArray[np.float64]:
    return np.arange(round(seconds * RATE)) / RATE


def _shaped(wave: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same from 0 to 0, without a click."""
    edge = round(ATTACK * RATE)
    wave[:edge] *= np.linspace(0.0, 1.0, edge)
    wave[-4 * edge :] *= np.linspace(1.0, 0.0, 4 * edge)
    return wave


def _click() -> NDArray[np.float64]:
    t = _time(0.05)
    return _shaped((np.sin(2 * np.pi * 2400 * t) + 0.6 * np.sin(2 * np.pi * 3700 * t)) * np.exp(-t / 0.006))


def _hit() -> NDArray[np.float64]:
    """A dull blow: a tone that falls from 190 to 70 Hz, and the noise of the first moment."""
    t = _time(0.35)
    phase = 2 * np.pi * (70 * t + 120 * 0.03 * (1 - np.exp(-t / 0.03)))
    noise = _noise(len(t), lambda f: np.exp(-f / 1500.0))
    return _shaped(np.sin(phase) * np.exp(-t / 0.08) + 0.7 * noise * np.exp(-t / 0.012))


def _chime() -> NDArray[np.float64]:
    """A struck bar: the partials of a free one, which are no harmonics, and fade the sooner the higher they are."""
    t = _time(1.6)
    partials = ((1.0, 1.0, 0.45), (2.756, 0.5, 0.22), (5.404, 0.25, 0.1), (8.933, 0.12, 0.05))
    return _shaped(
        sum((a * np.sin(2 * np.pi * 880 * f * t) * np.exp(-t / d) for f, a, d in partials), np.zeros(len(t)))
    )


def _roll() -> NDArray[np.float64]:
    """A rumble that goes on without a seam when it is repeated; louder and fainter twice a second."""
    t = _time(2.0)
    rumble = _noise(len(t), lambda f: f / 60.0 / (1.0 + (f / 120.0) ** 3))
    return rumble * (1.0 + 0.35 * np.sin(2 * np.pi * 2.0 * t))


def _whoosh() -> NDArray[np.float64]:
    """Air: noise about a pitch that rises and falls."""
    t = _time(0.7)
    course = np.sin(np.pi * t / t[-1])
    tones = np.random.default_rng(_SEED + 1).uniform(0.0, 1.0, (2, 160))
    frequency = 200.0 * 20.0 ** tones[0]
    wave = np.zeros(len(t))
    middle = np.log(350.0 + 1300.0 * course)
    for hertz, start in zip(frequency.tolist(), tones[1].tolist(), strict=True):
        near = np.exp(-(((np.log(hertz) - middle) / 0.45) ** 2))
        wave += near * np.sin(2 * np.pi * (hertz * t + start))
    return _shaped(wave * course**2)


def _noise(count: int, loudness: Callable[[NDArray[Any]], NDArray[Any]]) -> NDArray[np.float64]:
    """Noise of a spectrum, given by frequency [Hz], that repeats after `count` samples."""
    frequency = np.fft.rfftfreq(count, 1.0 / RATE)
    phase = np.random.default_rng(_SEED).uniform(0.0, 2.0 * np.pi, len(frequency))
    spectrum = loudness(frequency) * np.exp(1j * phase)
    spectrum[0] = 0.0
    wave = np.fft.irfft(spectrum, count)
    return np.asarray(wave / np.abs(wave).max())


_MAKERS: Final[dict[str, Callable[[], NDArray[np.float64]]]] = dict(
    zip(BUILT_IN_SOUNDS, (_click, _hit, _chime, _roll, _whoosh), strict=True)
)
