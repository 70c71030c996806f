"""Several clips on the same entities: weighted means of what they say, and layers over those.

Places, scales and weights of morph targets are mixed evenly. Of rotations it is the weighted sum of quaternions, each with the
sign that brings it nearer to the sum so far, at length 1: between two it goes the way of slerp, at a speed that is not quite
even.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.clip import WIDTHS, Property
from elys.common.assets.clip_sampling import PROPERTIES, ClipSampler, Samples
from elys.common.math import quaternion
from elys.sim_node.ecs.entities import Indices

Floats64 = NDArray[np.float64]
MOST_NUMBERS: Final = 2048  # of morph targets of one entity: more than there can be


class Spots(NamedTuple):
    """Where K values of a group go: `flat` numbers of values (players by channels), `slot` which each is of the mix."""

    flat: Indices | slice
    slot: Indices | slice
    size: int


def spots(flat: Indices, slot: Indices) -> Spots:
    """Those of [K] numbers each; what rises by 1 becomes a slice, which is read and written several times faster."""
    return Spots(_compact(flat), _compact(slot), len(flat))


def _compact(numbers: Indices) -> Indices | slice:
    if len(numbers) and np.array_equal(numbers, np.arange(numbers[0], numbers[0] + len(numbers))):
        return slice(int(numbers[0]), int(numbers[0]) + len(numbers))
    return numbers


class MixGroup(NamedTuple):
    """Players of one clip in one layer, none of them twice, that go the same way over what is below.

    Attributes:
        voices: [G] rows of voices.
        spots: by property.
        is_added: whether the difference from the clip's beginning is added.
    """

    sampler: ClipSampler
    voices: Indices
    spots: Mapping[Property, Spots]
    is_added: bool


class Mix(NamedTuple):
    """Layers, the lowest first, over how what they move rests.

    Attributes:
        keys: by property [S]: places of entities, of weights places times MOST_NUMBERS plus which target.
        rest: by property [S, width].
    """

    layers: Sequence[Sequence[MixGroup]]
    keys: Mapping[Property, Indices]
    rest: Mapping[Property, Floats64]

    def pose(self, times: Floats64, shares: Floats64) -> dict[Property, Floats64]:
        """[S, width] by property, where voices [V] are at `times` in their clips and count by their `shares`."""
        pose = {name: rest.copy() for name, rest in self.rest.items()}
        for groups in self.layers:
            replacing = [group for group in groups if not group.is_added]
            if replacing:
                _replace(pose, replacing, times, shares)
            for group in groups:
                if group.is_added:
                    _add(pose, group, times, shares)
        return pose


def _replace(pose: dict[Property, Floats64], groups: list[MixGroup], times: Floats64, shares: Floats64) -> None:
    sums = {name: np.zeros_like(values) for name, values in pose.items()}
    totals = {name: np.zeros(len(values)) for name, values in pose.items()}
    for group in groups:
        samples = group.sampler.sample(times[group.voices])
        for name in PROPERTIES:
            flat, slot, size = group.spots[name]
            if not size:
                continue
            values, weight = _values(samples, name)[flat], _weights(shares, group, name)[flat]
            if name == "rotation":
                weight_signed = np.where((sums[name][slot] * values).sum(axis=1) < 0.0, -weight, weight)
                sums[name][slot] += weight_signed[:, None] * values
            else:
                sums[name][slot] += weight[:, None] * values
            totals[name][slot] += weight
    for name, values in pose.items():
        rest = np.maximum(1.0 - totals[name], 0.0)
        rest[rest < 1e-9] = 0.0  # shares that make 1 but for rounding
        if name == "rotation":
            rest = np.where((sums[name] * values).sum(axis=1) < 0.0, -rest, rest)
            mixed = quaternion.normalize(sums[name] + rest[:, None] * values)
            pose[name] = np.where((totals[name] > 0.0)[:, None], mixed, values)
        else:
            pose[name] = sums[name] + rest[:, None] * values


def _add(pose: dict[Property, Floats64], group: MixGroup, times: Floats64, shares: Floats64) -> None:
    samples, first = group.sampler.sample(times[group.voices]), group.sampler.sample(np.zeros(1))
    for name in PROPERTIES:
        flat, slot, size = group.spots[name]
        if not size:
            continue
        values = _values(samples, name)
        begins = np.tile(_values(first, name), (len(group.voices), 1))[flat]
        values, weight = values[flat], _weights(shares, group, name)[flat][:, None]
        below = pose[name][slot]
        if name == "rotation":
            turn = quaternion.multiply(quaternion.conjugate(begins), values)
            part = quaternion.nlerp(np.broadcast_to(quaternion.IDENTITY, turn.shape), turn, weight[:, 0])
            pose[name][slot] = quaternion.normalize(quaternion.multiply(below, part))
        elif name == "scale":
            ratio = np.divide(values, begins, out=np.ones_like(values), where=begins != 0.0)
            pose[name][slot] = below * (1.0 + weight * (ratio - 1.0))
        else:
            pose[name][slot] = below + weight * (values - begins)


def _values(samples: Samples, name: Property) -> Floats64:
    """[players x channels, width]."""
    values: Floats64 = getattr(samples, name)
    return values.reshape(-1, WIDTHS.get(name, 1))


def _weights(shares: Floats64, group: MixGroup, name: Property) -> Floats64:
    """[players x channels] each player's share."""
    return np.repeat(shares[group.voices], len(group.sampler.targets[name]))
