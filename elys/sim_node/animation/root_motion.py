"""Root motion: where a clip moves one of its nodes, the entity that plays it goes instead.

Of the node's pose in the entity's space T is what lies in the plane: its place there and, if it shall turn, its turn about the
vertical. From one tick to the next the entity goes by inverse(T(before)) T(after), over the end of a clip by as many whole clips
as lie between, so that n rounds are n times one. The node keeps the T that it rests in.

Turns about the vertical are quaternions (y, w) of which x and z are 0: products and roots alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.clip import Clip
from elys.common.assets.clip_sampling import ClipSampler
from elys.common.math import quaternion
from elys.sim_node.animation.clip_times import PING_PONG, Way, clip_times

Floats64 = NDArray[np.float64]


class Ground(NamedTuple):
    """Motions of the ground [N]: turns (N, 2) as y and w of quaternions, then places x y z (N, 3) m; y goes by itself."""

    turn: Floats64
    place: Floats64


def standing(count: int) -> Ground:
    """No motion, N times."""
    return Ground(np.tile((0.0, 1.0), (count, 1)), np.zeros((count, 3)))


def after(first: Ground, then: Ground) -> Ground:
    """The motion `first`, and `then` another one as seen from where that has led."""
    ay, aw, by, bw = first.turn[:, 0], first.turn[:, 1], then.turn[:, 0], then.turn[:, 1]
    turn = np.stack((ay * bw + aw * by, aw * bw - ay * by), axis=1)
    return Ground(turn, first.place + turned(first.turn, then.place))


def back(motion: Ground) -> Ground:
    """The inverse."""
    turn = motion.turn * (-1.0, 1.0)
    return Ground(turn, -turned(turn, motion.place))


def turned(turn: Floats64, vector: Floats64) -> Floats64:
    """Vectors (N, 3) turned about the vertical by (N, 2)."""
    y, w = turn[:, 0], turn[:, 1]
    cosine, sine = w * w - y * y, 2.0 * w * y
    x, z = vector[:, 0], vector[:, 2]
    return np.stack((cosine * x + sine * z, vector[:, 1], cosine * z - sine * x), axis=1)


def times_over(motion: Ground, counts: NDArray[np.int64]) -> Ground:
    """A motion as often as `counts` [N], at least 0, says; by squares."""
    result, power, left = standing(len(counts)), motion, counts.copy()
    while left.any():
        longer = after(result, power)
        result = chosen((left & 1).astype(np.bool_), longer, result)
        power, left = after(power, power), left >> 1
    return Ground(_unit(result.turn), result.place)


def chosen(which: NDArray[np.bool_], these: Ground, others: Ground) -> Ground:
    """Of each row [N] one of two motions."""
    return Ground(*(np.where(which[:, None], a, b) for a, b in zip(these, others, strict=True)))


class RootTrack:
    """The node of one clip that moves who plays it."""

    def __init__(self, clip: Clip, node: tuple[str, ...]) -> None:
        channels = tuple(channel for channel in clip.channels if channel.target == node)
        self._sampler = ClipSampler(Clip(name=clip.name, channels=channels))
        self._ends = np.array((0.0, clip.duration))
        self.has_place = bool(self._sampler.targets["position"])
        self.has_turn = bool(self._sampler.targets["rotation"])

    def at(self, times: Floats64, frame: Frame) -> Ground:
        """T at times [N]; of a node that the clip does not move, none."""
        samples, found = self._sampler.sample(times), standing(len(times))
        if self.has_place:
            found = found._replace(place=samples.position[:, 0] @ frame.entity_from_parent.T)
        if self.has_turn and frame.turns:
            found = found._replace(turn=_about_vertical(quaternion.multiply(frame.rotation, samples.rotation[:, 0])))
        return found

    def gone(self, way: Way, loop: NDArray[np.uint8], duration: float, frame: Frame) -> Ground:
        """How far players [N] of the clip went in a tick, seen from the node."""
        lengths = np.full(len(loop), duration)
        times = [clip_times(way.start, loop, lengths), clip_times(way.end, loop, lengths), self._ends]
        count, every = len(loop), self.at(np.concatenate(times), frame)
        before, now = (Ground(*(part[first : first + count] for part in every)) for first in (0, count))
        straight = after(back(before), now)
        laps = np.where(loop == PING_PONG, 0, way.laps)  # there and back is nowhere
        if not laps.any():
            return straight
        is_around = laps != 0
        begin, end = (Ground(*(np.repeat(part[[row]], count, axis=0) for part in every)) for row in (-2, -1))
        out, into = chosen(laps < 0, end, begin), chosen(laps < 0, begin, end)
        whole = times_over(after(back(out), into), np.maximum(np.abs(laps) - 1, 0))
        around = after(after(after(back(before), into), whole), after(back(out), now))
        return chosen(is_around, around, straight)


class Frame(NamedTuple):
    """How the node's parent stands in the space of the entity that plays, and how the node itself rests there.

    Attributes:
        entity_from_parent: [3, 3]. origin: where that has its origin [m]. rotation: its turn, a quaternion.
        rest: [1] T at rest.
    """

    entity_from_parent: Floats64
    origin: Floats64
    rotation: Floats64
    rest: Ground
    turns: bool
    rises: bool


def frame_of(chain: list[tuple[Floats64, Floats64, Floats64]], *, turns: bool, rises: bool) -> Frame:
    """From positions, rotations and scales at rest of those from below the entity down to the node, which is last."""
    linear: Floats64 = np.eye(3)
    origin, rotation = np.zeros(3), quaternion.IDENTITY.copy()
    for position, turn, scale in chain[:-1]:
        origin = origin + linear @ position
        linear = np.asarray(linear @ quaternion.to_matrix(turn) @ np.diag(scale), np.float64)
        rotation = np.asarray(quaternion.multiply(rotation, turn), np.float64)
    position, turn, _ = chain[-1]
    place = (origin + linear @ position)[None]
    rest = standing(1)._replace(place=place)
    if turns:
        rest = rest._replace(turn=_about_vertical(quaternion.multiply(rotation, turn)[None]))
    return Frame(linear, origin, rotation, rest, turns, rises)


def of_entity(motion: Ground, frame: Frame) -> Ground:
    """A motion [N] seen from the node, as that of the entity; up and down only if it rises."""
    rest = Ground(*(np.repeat(part, len(motion.turn), axis=0) for part in frame.rest))
    found = after(after(rest, motion), back(rest))
    return found if frame.rises else found._replace(place=found.place * (1.0, 0.0, 1.0))


def held(position: Floats64, rotation: Floats64, frame: Frame) -> tuple[Floats64, Floats64]:
    """Local places (N, 3) and rotations (N, 4) of the node without what the entity does instead."""
    place = frame.origin + position @ frame.entity_from_parent.T
    kept = (0, 1, 2) if frame.rises else (0, 2)
    place[:, kept] = frame.rest.place[:, kept]
    still = np.asarray(np.linalg.solve(frame.entity_from_parent, (place - frame.origin).T).T, np.float64)
    if not frame.turns:
        return still, rotation
    seen = np.asarray(quaternion.multiply(frame.rotation, rotation), np.float64)
    rest, turn = (rotation_of(each) for each in (frame.rest.turn, _about_vertical(seen)))
    kept_turn = quaternion.multiply(rest, quaternion.conjugate(turn))
    local = quaternion.multiply(quaternion.conjugate(frame.rotation), quaternion.multiply(kept_turn, seen))
    return still, np.asarray(local, np.float64)


def rotation_of(turn: Floats64) -> Floats64:
    """Quaternions (N, 4) of turns (N, 2)."""
    zero = np.zeros(len(turn))
    return np.stack((zero, turn[:, 0], zero, turn[:, 1]), axis=1)


def mean(motions: Ground, shares: Floats64, owner: NDArray[np.intp], count: int) -> Ground:
    """Of several motions [V] by their shares [V], those of `count` owners."""
    place, turn = np.zeros((count, 3)), np.zeros((count, 2))
    signed = np.where(motions.turn[:, 1] < 0.0, -shares, shares)  # ticks turn less than half around
    np.add.at(place, owner, shares[:, None] * motions.place)
    np.add.at(turn, owner, signed[:, None] * motions.turn)
    return Ground(_unit(turn), place)


def _about_vertical(rotation: NDArray[np.floating]) -> Floats64:
    """The turns (N, 2) about the vertical in quaternions (N, 4)."""
    return _unit(np.asarray(rotation[..., (1, 3)], np.float64))


def _unit(turn: Floats64) -> Floats64:
    length = np.sqrt((turn * turn).sum(axis=1, keepdims=True))
    return np.where(length > 1e-12, turn / np.where(length > 1e-12, length, 1.0), (0.0, 1.0))
