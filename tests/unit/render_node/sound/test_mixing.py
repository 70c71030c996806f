"""Sound against closed forms: gain by distance, power when panned, pitch, ramps, and a limiter that lets nothing clip."""

from __future__ import annotations

import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components.sound import BUILT_IN_SOUNDS
from elys.common.math import quaternion
from elys.render_node.sound.built_in import built_in_sound
from elys.render_node.sound.hearing import Ears, distance_gain, ears_of, heard, panned
from elys.render_node.sound.mixer import CEILING, MOST_VOICES, QUANTUM, RATE, Mixer, Samples, Voice

EARS = Ears((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def tone(hertz: float, seconds: float = 1.0, *, loudness: float = 0.5) -> Samples:
    time = np.arange(round(seconds * RATE)) / RATE
    return (loudness * np.sin(2 * np.pi * hertz * time)).astype(np.float32)[:, None]


def mixed(*voices: Voice, count: int = RATE) -> np.ndarray:
    mixer = Mixer()
    for voice in voices:
        mixer.add(voice)
    return mixer.mix(count + QUANTUM)[QUANTUM:].astype(np.float64)


@pytest.mark.parametrize("distance", [0.0, 1.0, 2.0, 4.0, 100.0])
def test_loudness_falls_with_the_inverse_of_the_distance(distance: float) -> None:
    assert distance_gain(distance, 2.0) == pytest.approx(2.0 / max(distance, 2.0))
    assert distance_gain(distance, 2.0, 50.0) == pytest.approx(
        2.0 / max(distance, 2.0) * (1.0 if distance <= 40.0 else 0.0)
    )


def test_it_fades_out_towards_the_largest_distance() -> None:
    gains = [distance_gain(distance, 1.0, 10.0) * distance for distance in (8.0, 9.0, 9.5, 10.0, 11.0)]
    assert gains == pytest.approx([1.0, 0.5, 0.25, 0.0, 0.0])


@pytest.mark.parametrize("angle", np.linspace(0.0, 2.0 * np.pi, 9))
def test_a_sound_is_of_the_same_power_all_around(angle: float) -> None:
    place = (3.0 * np.sin(angle), 0.0, -3.0 * np.cos(angle))
    left, right = heard(EARS, place, 0.8, 1.0)
    assert left**2 + right**2 == pytest.approx((0.8 / 3.0) ** 2)
    turn = (np.sin(angle) + 1.0) * np.pi / 4.0
    assert (left, right) == pytest.approx((0.8 / 3.0 * np.cos(turn), 0.8 / 3.0 * np.sin(turn)), abs=1e-12)


def test_sides_are_those_of_who_looks() -> None:
    assert panned(-1.0) == pytest.approx((1.0, 0.0))
    assert panned(1.0) == pytest.approx((0.0, 1.0))
    rotation = tuple(quaternion.from_axis_angle((0.0, 1.0, 0.0), np.pi / 2).tolist())  # looks along -x
    ears = ears_of(ViewCamera(position=(1.0, 2.0, 3.0), rotation=rotation))
    left, right = heard(ears, (1.0, 2.0, -7.0), 1.0, 10.0)
    assert (left, right) == pytest.approx((0.0, 1.0), abs=1e-9)
    assert heard(ears, (1.0, 2.0, 3.0), 1.0, 1.0) == pytest.approx((0.5**0.5, 0.5**0.5))  # in the head: on both sides
    assert heard(ears, (float("nan"), 0.0, 0.0), 1.0, 1.0) == (0.0, 0.0)


def test_what_is_quiet_passes_through_bit_for_bit() -> None:
    sound = tone(440.0)
    out = mixed(Voice(sound), count=len(sound) - 2 * QUANTUM)
    np.testing.assert_array_equal(out[:, 0], sound[: len(out), 0])
    np.testing.assert_array_equal(out[:, 1], sound[: len(out), 0])


@pytest.mark.parametrize("pitch", [0.5, 1.5, 2.0])
def test_pitch_is_resampling(pitch: float) -> None:
    sound = tone(400.0, 3.0)
    out = mixed(Voice(sound, pitch=pitch))[QUANTUM:]
    time = (np.arange(len(out)) + QUANTUM) / RATE
    np.testing.assert_allclose(out[:, 0], 0.5 * np.sin(2 * np.pi * 400.0 * pitch * time), atol=2e-4)


def test_a_loop_has_no_seam_and_once_is_once() -> None:
    period = tone(480.0, 1.0)
    looped = Voice(period, loop=True, pitch=1.25)
    out = mixed(looped, count=3 * RATE)
    time = np.arange(len(out)) / RATE
    np.testing.assert_allclose(out[:, 0], 0.5 * np.sin(2 * np.pi * 600.0 * time), atol=2e-4)
    once = Voice(period)
    out = mixed(once, count=2 * RATE)
    assert np.abs(out[RATE + 2 :]).max() == 0.0
    assert once.is_over


def test_nothing_clicks_when_a_source_jumps_or_stops() -> None:
    """No step between two samples is larger than a tone of that loudness and a ramp have."""
    mixer = Mixer()
    voice = Voice(tone(200.0, 4.0), left=1.0, right=0.0)
    mixer.add(voice)
    pieces = []
    for left, right in ((1.0, 0.0), (0.0, 1.0), (0.7, 0.1), (0.0, 0.0), (1.0, 1.0)):
        voice.left, voice.right = left, right
        pieces.append(mixer.mix(1000))
    mixer.volume = 0.0
    pieces.append(mixer.mix(1000))
    mixer.volume = 1.0
    pieces.append(mixer.mix(1000))
    voice.stop()
    pieces.append(mixer.mix(1000))
    out = np.concatenate(pieces)
    assert np.abs(np.diff(out, axis=0)).max() <= 0.5 * (2 * np.pi * 200.0 / RATE + 1.0 / QUANTUM) * 1.01 + 0.5 / QUANTUM
    assert np.abs(out[-QUANTUM:]).max() == 0.0
    assert not mixer.voices


def test_nothing_clips_however_many_sound_and_the_limiter_lets_go_again() -> None:
    loud = [Voice(tone(300.0 + 7 * k, 0.2, loudness=1.0), left=4.0, right=4.0) for k in range(40)]
    quiet = Voice(tone(100.0, 4.0, loudness=0.2))
    out = mixed(*loud, quiet, count=3 * RATE)
    assert np.abs(out).max() <= CEILING + 1e-6
    assert np.abs(out[: RATE // 10]).max() > 0.9
    expected = tone(100.0, 4.0, loudness=0.2)[2 * RATE : 3 * RATE - QUANTUM, 0]
    np.testing.assert_allclose(out[2 * RATE : 3 * RATE - QUANTUM, 0], expected, atol=1e-3)


def test_of_too_many_voices_the_quietest_stop() -> None:
    mixer = Mixer()
    voices = [
        Voice(tone(100.0), left=gain, right=gain, loop=True) for gain in np.linspace(0.001, 0.01, MOST_VOICES + 3)
    ]
    for voice in voices:
        mixer.add(voice)
    mixer.mix(4 * QUANTUM)
    assert [voice.is_over for voice in voices].index(False) == 3
    assert len(mixer.voices) == MOST_VOICES


def test_how_the_stream_is_cut_makes_no_difference() -> None:
    def run(sizes: list[int]) -> np.ndarray:
        mixer = Mixer()
        mixer.add(Voice(built_in_sound("chime"), left=0.3, right=0.6, pitch=1.1))
        return np.concatenate([mixer.mix(size) for size in sizes])

    np.testing.assert_array_equal(run([4000]), run([1, 255, 256, 0, 257, 3231]))


@pytest.mark.parametrize("name", BUILT_IN_SOUNDS)
def test_sounds_that_are_made_here_are_sound(name: str) -> None:
    sound = built_in_sound(name)
    assert np.abs(sound).max() == pytest.approx(0.8)
    step = np.abs(np.diff(sound[:, 0]))
    if name == "roll":  # goes round without a seam
        assert abs(float(sound[0, 0] - sound[-1, 0])) <= step.max()
    else:
        assert abs(float(sound[0, 0])) < 1e-6
        assert abs(float(sound[-1, 0])) < 1e-4
    assert abs(float(sound.mean())) < 0.02


def test_a_chime_has_the_partials_of_a_free_bar() -> None:
    sound = built_in_sound("chime")[:, 0].astype(np.float64)
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound))))
    for ratio in (1.0, 2.756, 5.404):
        near = slice(round((880 * ratio - 30) * len(sound) / RATE), round((880 * ratio + 30) * len(sound) / RATE))
        assert near.start + int(np.argmax(spectrum[near])) == pytest.approx(880 * ratio * len(sound) / RATE, abs=3)


def test_a_sound_without_samples_is_over_at_once() -> None:
    voice = Voice(np.zeros((0, 1), np.float32))
    assert voice.is_over
