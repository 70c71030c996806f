"""From voices to poses: which clips are sampled together, and where what they say goes.

Who plays one clip alone is posed by it right away; who plays several, or has layers, by a `Mix`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.clip import Property
from elys.common.assets.clip_sampling import PROPERTIES, ClipSampler
from elys.common.assets.morph_weights import parse_weights
from elys.common.components import Morph, Transform
from elys.common.errors import AssetError
from elys.common.ids import Entity
from elys.sim_node.animation.binding import NOWHERE
from elys.sim_node.animation.pose_mixing import MOST_NUMBERS, Floats64, Mix, MixGroup, spots
from elys.sim_node.animation.rest_poses import RestPoses
from elys.sim_node.ecs.entities import Entities, Indices
from elys.sim_node.ecs.world import World

MOVED: Final[tuple[Property, ...]] = ("position", "rotation", "scale")


class Part(NamedTuple):
    """A voice, and what it moves.

    Attributes:
        layer: 0 for who plays on itself, above it the layers over that, in order.
        places: as `Binding.places` gives them. is_alone: whether nothing else moves what it moves.
    """

    voice: int
    root: int
    layer: int
    is_added: bool
    is_alone: bool
    key: tuple[str, str]
    sampler: ClipSampler
    places: dict[Property, Indices]


class Goals(NamedTuple):
    """Where the values of voices alone go: `flat` [K] numbers of values, and the places [K] of the entities they are for."""

    flat: Indices
    places: Indices


class _Alone(NamedTuple):
    """Voices [G] of one clip, each all that its entity plays."""

    sampler: ClipSampler
    voices: Indices
    goals: dict[Property, Goals]
    weight_keys: Indices


class Poser:
    """Writes poses into Transforms, and keeps the weights of morph targets, of one set of voices.

    Attributes:
        moved: places of whose Transforms are written, rising.
        weight_keys, weights: as `Mix.keys` of those that are set, and what they are.
    """

    def __init__(self, world: World, parts: Iterable[Part], rest: RestPoses) -> None:
        self._world = world
        parts = list(parts)
        used = [part.places[name] for part in parts for name in MOVED]
        moved = np.unique(np.concatenate(used)) if used else np.zeros(0, np.intp)
        self.moved: Indices = moved[moved != NOWHERE]
        rest.learn(world, self.moved)
        self._alone = [_alone(group) for group in _grouped(part for part in parts if part.is_alone)]
        mixed = [part for part in parts if not part.is_alone]
        self._mix = _mix(world, mixed, rest) if mixed else None
        keys = [alone.weight_keys for alone in self._alone]
        if self._mix is not None:
            keys.append(self._mix.keys["weights"])
        self.weight_keys: Indices = np.concatenate(keys) if keys else np.zeros(0, np.intp)
        self.weights: Floats64 = np.zeros(len(self.weight_keys))

    @property
    def weight_places(self) -> tuple[Entities, NDArray[np.uint32]]:
        """Whose weights those are, and of which morph target."""
        ids = self._world.allocator.ids[self.weight_keys // MOST_NUMBERS]
        return ids, (self.weight_keys % MOST_NUMBERS).astype(np.uint32)

    def pose(self, times: Floats64, shares: Floats64, *, only_weights: bool = False) -> None:
        """Writes what clips say where voices [V] are at `times` and count by `shares`; logs no change."""
        weights: list[Floats64] = []
        for alone in self._alone:
            samples = alone.sampler.sample(times[alone.voices])
            for name in () if only_weights else MOVED:
                flat, places = alone.goals[name]
                values = getattr(samples, name)
                self._write(name, places, values.reshape(-1, values.shape[-1])[flat])
            weights.append(samples.weights.ravel()[alone.goals["weights"].flat])
        if self._mix is not None:
            pose = self._mix.pose(times, shares)
            for name in () if only_weights else MOVED:
                self._write(name, self._mix.keys[name], pose[name])
            weights.append(pose["weights"][:, 0])
        self.weights = np.concatenate(weights) if weights else self.weights
        if len(self.moved) and not only_weights:
            self._world.transforms.mark_dirty(self.moved)

    def _write(self, name: Property, places: Indices, values: Floats64) -> None:
        table = self._world.table(Transform)
        table.column(name)[table.row_of[places]] = values


def _grouped(parts: Iterable[Part]) -> list[list[Part]]:
    """Parts of one clip that are treated alike, none of an entity twice; in the order of the first of each."""
    found: dict[object, list[Part]] = {}
    seen: dict[object, int] = {}
    for part in parts:
        kind = (part.key, part.layer, part.is_added)
        number = seen[kind, part.root] = seen.get((kind, part.root), -1) + 1
        found.setdefault((kind, number), []).append(part)
    return list(found.values())


def _alone(parts: list[Part]) -> _Alone:
    sampler = parts[0].sampler
    found = {}
    for name in PROPERTIES:
        places = np.concatenate([part.places[name] for part in parts])
        flat = np.flatnonzero(places != NOWHERE)
        found[name] = Goals(flat, places[flat])
    keys = _keys(parts, "weights")[found["weights"].flat]
    return _Alone(sampler, np.array([part.voice for part in parts], np.intp), found, keys)


def _keys(parts: list[Part], name: Property) -> Indices:
    """[players x channels] what each moves, NOWHERE for nothing."""
    places = np.concatenate([part.places[name] for part in parts])
    if name != "weights":
        return places
    numbers = np.tile(parts[0].sampler.weight_numbers.astype(np.intp), len(parts))
    return np.where(places == NOWHERE, NOWHERE, places * MOST_NUMBERS + numbers)


def _mix(world: World, parts: list[Part], rest: RestPoses) -> Mix:
    groups = [(group, {name: _keys(group, name) for name in PROPERTIES}) for group in _grouped(parts)]
    keys: dict[Property, Indices] = {}
    for name in PROPERTIES:
        several = np.concatenate([found[name] for _, found in groups])
        several = several[several != NOWHERE]
        keys[name] = several[np.sort(np.unique(several, return_index=True)[1])]  # in the order of the first clip
    layers: dict[int, list[MixGroup]] = {}
    for group, found in groups:
        of_group = {}
        for name in PROPERTIES:
            flat = np.flatnonzero(found[name] != NOWHERE)
            order = np.argsort(keys[name])
            slot = order[np.searchsorted(keys[name], found[name][flat], sorter=order)]
            of_group[name] = spots(flat, slot)
        voices = np.array([part.voice for part in group], np.intp)
        layers.setdefault(group[0].layer, []).append(MixGroup(group[0].sampler, voices, of_group, group[0].is_added))
    rests = {name: rest.of(name, world.allocator.ids[keys[name]]) for name in MOVED}
    return Mix(
        [layers[number] for number in sorted(layers)],
        keys,
        {**rests, "weights": _weights_at_rest(world, keys["weights"])},
    )


def _weights_at_rest(world: World, keys: Indices) -> Floats64:
    """[S, 1] the weights that Morph components give."""
    found = np.zeros((len(keys), 1))
    known: dict[int, tuple[float, ...]] = {}
    for row, key in enumerate(keys.tolist()):
        place, number = divmod(key, MOST_NUMBERS)
        if place not in known:
            try:
                known[place] = parse_weights(world.get(Entity(int(world.allocator.ids[place])), Morph).weights)
            except AssetError:  # who draws it says so
                known[place] = ()
        if number < len(known[place]):
            found[row, 0] = known[place][number]
    return found
