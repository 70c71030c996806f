"""What a clip says at given times, for all channels and for many who play it at once.

Only sums, products, quotients and roots: every machine gets the same bits.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.clip import WIDTHS, Channel, Clip, Interpolation, Property
from elys.common.math import quaternion

PROPERTIES: Final[tuple[Property, ...]] = ("position", "rotation", "scale", "weights")


class Samples(NamedTuple):
    """The values of N players: positions [N, P, 3], rotations [N, R, 4], scales [N, S, 3], weights [N, W]."""

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    scale: NDArray[np.float64]
    weights: NDArray[np.float64]


class _Group(NamedTuple):
    """Channels of one property and one interpolation. Weights stand as channels of one number each.

    Attributes:
        columns: [C] which of the property's channels they are. tracks: [C] row of times. first: [C] row of the first key.
        values: [keys of all, width], of cubic splines [keys of all, 3, width].
    """

    property: Property
    interpolation: Interpolation
    columns: NDArray[np.intp]
    tracks: NDArray[np.intp]
    first: NDArray[np.intp]
    values: NDArray[np.float64]


class ClipSampler:
    """A clip made ready to be asked.

    Attributes:
        clip: what it was made of. duration: its length [s].
        targets: of each property whose value each of its columns is, in the order of `Samples`; of weights one for each number.
        weight_numbers: of the columns of weights, which morph target of its entity each is.
    """

    def __init__(self, clip: Clip) -> None:
        self.clip = clip
        self.duration = clip.duration
        self.targets: dict[Property, list[tuple[str, ...]]] = {name: [] for name in PROPERTIES}
        self._tracks: list[NDArray[np.float64]] = []
        known: dict[bytes, int] = {}
        members: dict[tuple[Property, Interpolation], list[tuple[int, int, NDArray[np.float32]]]] = {}
        for channel in clip.channels:
            track = known.setdefault(channel.times.tobytes(), len(self._tracks))
            if track == len(self._tracks):
                self._tracks.append(channel.times.astype(np.float64))
            for values in _parts(channel):
                columns = self.targets[channel.property]
                members.setdefault((channel.property, channel.interpolation), []).append((len(columns), track, values))
                columns.append(channel.target)
        seen: dict[tuple[str, ...], int] = {}
        self.weight_numbers = np.zeros(len(self.targets["weights"]), np.uint32)
        for column, target in enumerate(self.targets["weights"]):
            self.weight_numbers[column] = seen[target] = seen.get(target, -1) + 1
        self._groups = [_group(*key, found) for key, found in members.items()]

    def sample(self, times: NDArray[np.float64]) -> Samples:
        """Values at [N] times [s]; before the first key and after the last the value of that key."""
        count = len(times)
        keys = np.empty((count, len(self._tracks)), np.intp)
        steps = np.empty((2, count, len(self._tracks)))  # how far on towards the next key, and how long that takes
        followers = np.empty_like(keys)
        for track, moments in enumerate(self._tracks):
            key = np.clip(np.searchsorted(moments, times, side="right") - 1, 0, len(moments) - 1)
            after = np.minimum(key + 1, len(moments) - 1)
            span = moments[after] - moments[key]
            keys[:, track], followers[:, track] = key, after
            steps[0, :, track] = np.clip((times - moments[key]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
            steps[1, :, track] = span
        found = {name: np.empty((count, len(self.targets[name]), WIDTHS.get(name, 1))) for name in PROPERTIES}
        for group in self._groups:
            here, after = keys[:, group.tracks] + group.first, followers[:, group.tracks] + group.first
            fraction, span = steps[0][:, group.tracks], steps[1][:, group.tracks]
            found[group.property][:, group.columns] = _between(group, here, after, fraction, span)
        return Samples(found["position"], found["rotation"], found["scale"], found["weights"][:, :, 0])


def _parts(channel: Channel) -> list[NDArray[np.float32]]:
    """A channel's values, of weights those of each morph target by itself."""
    if channel.property != "weights":
        return [channel.values]
    return [channel.values[..., number : number + 1] for number in range(channel.values.shape[-1])]


def _group(name: Property, interpolation: Interpolation, members: list[tuple[int, int, NDArray[np.float32]]]) -> _Group:
    columns, tracks, values = zip(*members, strict=True)
    lengths = [len(part) for part in values]
    joined: NDArray[Any] = np.concatenate(values).astype(np.float64)
    if name == "rotation" and interpolation != "cubic":
        joined = quaternion.normalize(joined)
    first = np.concatenate(([0], np.cumsum(lengths)[:-1])).astype(np.intp)
    return _Group(name, interpolation, np.array(columns, np.intp), np.array(tracks, np.intp), first, joined)


def _between(
    group: _Group,
    here: NDArray[np.intp],
    after: NDArray[np.intp],
    fraction: NDArray[np.float64],
    span: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Values (N, C, width) `fraction` (N, C) of the way from rows `here` to `after`, which are `span` [s] apart.

    glTF 2.0, appendix C.
    """
    values = group.values
    if group.interpolation == "step":
        return values[here]
    if group.interpolation == "linear":
        if group.property == "rotation":
            return np.asarray(quaternion.slerp(values[here], values[after], fraction), np.float64)
        start = values[here]
        return np.asarray(start + (values[after] - start) * fraction[..., None])
    t, span = fraction[..., None], span[..., None]
    squared, cubed = t * t, t * t * t
    spline: NDArray[np.float64] = (
        (2 * cubed - 3 * squared + 1) * values[here, 1]
        + span * (cubed - 2 * squared + t) * values[here, 2]
        + (3 * squared - 2 * cubed) * values[after, 1]
        + span * (cubed - squared) * values[after, 0]
    )
    return np.asarray(quaternion.normalize(spline), np.float64) if group.property == "rotation" else spline
