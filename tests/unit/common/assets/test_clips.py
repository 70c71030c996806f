"""Clips: their bytes, and what they say at a time, against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, interp1d
from scipy.spatial.transform import Rotation, Slerp

from elys.common.assets.clip import Channel, Clip, clip_names, decode_clips, encode_clips
from elys.common.assets.clip_sampling import ClipSampler
from elys.common.errors import AssetError

RANDOM = np.random.default_rng(5)
TIMES = np.cumsum(RANDOM.uniform(0.1, 0.4, 7)).astype(np.float32)
MOMENTS = np.concatenate([RANDOM.uniform(0.0, 3.0, 200), TIMES.astype(np.float64), [0.0, 100.0]])
WITHIN = np.clip(MOMENTS, float(TIMES[0]), float(TIMES[-1]))


def channel(name, interpolation, values, target=("a",), times=TIMES) -> Channel:
    return Channel(
        target=target, property=name, interpolation=interpolation, times=times, values=values.astype(np.float32)
    )


def sampled(*channels: Channel):
    return ClipSampler(Clip(name="c", channels=channels)).sample(MOMENTS)


def unit(count: int) -> np.ndarray:
    return Rotation.random(count, rng=RANDOM).as_quat().astype(np.float32)


def test_lines_and_steps_agree_with_scipy() -> None:
    values = RANDOM.normal(size=(7, 3)).astype(np.float32)
    ours = sampled(channel("position", "linear", values), channel("scale", "step", values))
    times = TIMES.astype(np.float64)
    np.testing.assert_allclose(ours.position[:, 0], interp1d(times, values.astype(float), axis=0)(WITHIN), atol=1e-12)
    expected = interp1d(times, values, axis=0, kind="previous")(WITHIN)
    np.testing.assert_array_equal(ours.scale[:, 0], expected)


def test_rotations_go_evenly_on_the_short_way() -> None:
    values = unit(7)
    values[3] *= -1.0  # the same rotation: nothing may turn the long way round to it
    ours = sampled(channel("rotation", "linear", values)).rotation[:, 0]
    theirs = Slerp(TIMES.astype(np.float64), Rotation.from_quat(values))(WITHIN).as_quat()
    angle = (Rotation.from_quat(ours).inv() * Rotation.from_quat(theirs)).magnitude()
    assert angle.max() < 1e-12
    np.testing.assert_allclose(np.linalg.norm(ours, axis=1), 1.0, rtol=1e-14)


def test_splines_agree_with_scipy() -> None:
    keys = RANDOM.normal(size=(7, 3, 3)).astype(np.float32)
    turns = np.stack([0.3 * RANDOM.normal(size=(7, 4)), unit(7), 0.3 * RANDOM.normal(size=(7, 4))], axis=1)
    ours = sampled(channel("position", "cubic", keys), channel("rotation", "cubic", turns))
    for found, given in ((ours.position[:, 0], keys), (ours.rotation[:, 0], turns.astype(np.float32))):
        expected = np.array([hermite(given, moment) for moment in WITHIN])
        if found.shape[1] == 4:
            expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def hermite(keys: np.ndarray, moment: float) -> np.ndarray:
    """One piece of the spline: glTF's two tangents at a key differ, scipy's one does not."""
    times = TIMES.astype(np.float64)
    piece = min(int(np.searchsorted(times, moment, side="right")) - 1, len(times) - 2)
    ends = slice(piece, piece + 2)
    slopes = np.stack([keys[piece, 2], keys[piece + 1, 0]]).astype(np.float64)
    return CubicHermiteSpline(times[ends], keys[ends, 1].astype(np.float64), slopes)(moment)


def test_channels_keep_their_places_whatever_their_interpolation_and_times() -> None:
    short = TIMES[:2]
    values = [RANDOM.normal(size=(count, 3)) for count in (7, 2, 7)]
    channels = [
        channel("position", "linear", values[0], ("x",)),
        channel("position", "step", values[1], ("y",), short),
        channel("position", "linear", values[2], ("z", "w")),
        channel("weights", "linear", RANDOM.normal(size=(7, 3)), ("x",)),
    ]
    clip = Clip(name="c", channels=tuple(channels))
    sampler = ClipSampler(clip)
    assert sampler.targets["position"] == [("x",), ("y",), ("z", "w")]
    assert sampler.targets["weights"] == [("x",)] * 3
    together = sampler.sample(MOMENTS)
    for column, one in enumerate(channels[:3]):
        np.testing.assert_array_equal(together.position[:, column], sampled(one).position[:, 0])
    expected = interp1d(TIMES.astype(np.float64), channels[3].values.astype(float), axis=0)(WITHIN)
    np.testing.assert_allclose(together.weights, expected, atol=1e-12)


def test_many_players_get_what_each_gets_alone() -> None:
    sampler = ClipSampler(Clip(name="c", channels=(channel("rotation", "linear", unit(7)),)))
    together = sampler.sample(MOMENTS).rotation
    for place in range(0, len(MOMENTS), 17):
        np.testing.assert_array_equal(together[place], sampler.sample(MOMENTS[place : place + 1]).rotation[0])


def some_clips() -> list[Clip]:
    first = (channel("position", "linear", np.ones((7, 3))), channel("rotation", "cubic", np.ones((7, 3, 4)), ()))
    return [Clip(name="Walk", channels=first), Clip(name="", channels=(channel("weights", "step", np.ones((7, 5))),))]


def test_bytes_give_back_what_was_put_in() -> None:
    data = encode_clips(some_clips())
    assert encode_clips(decode_clips(data)) == data
    for ours, given in zip(decode_clips(data), some_clips(), strict=True):
        assert (ours.name, ours.duration) == (given.name, float(TIMES[-1]))
        for a, b in zip(ours.channels, given.channels, strict=True):
            assert (a.target, a.property, a.interpolation) == (b.target, b.property, b.interpolation)
            np.testing.assert_array_equal(a.times, b.times)
            np.testing.assert_array_equal(a.values, b.values)


def test_names_are_told_without_the_keys() -> None:
    some = some_clips()
    assert clip_names(encode_clips([*some, Clip(name="Last", channels=()), *some])) == (*(c.name for c in some), "Last")
    with pytest.raises(AssetError, match="their header says"):
        clip_names(encode_clips(some)[:-4])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data[:5], "too few"),
        (lambda data: b"ELYM" + data[4:], "it starts with"),
        (lambda data: data[:4] + b"\7" + data[5:], "format 7"),
        (lambda data: data[:-4], "their header says"),
        (lambda data: data[:-4] + b"\0\0\xc0\x7f", "not finite"),
        (lambda data: data.replace(b'"keys":7', b'"keys":0'), "header is wrong"),
        (lambda data: data.replace(b'"width":3', b'"width":4'), "a position of 4 numbers"),
        (lambda data: data.replace(TIMES.tobytes(), TIMES[::-1].tobytes(), 1), "do not rise"),
    ],
)
def test_bytes_that_are_no_clips_are_refused(change, words: str) -> None:
    with pytest.raises(AssetError, match=words):
        decode_clips(change(encode_clips(some_clips())))
