"""play_animations: clips at the time of the simulation, into the Transforms of what they name.

Who plays a clip is bound once to the entities that its channels name, and again when the tree or the component changes. All who
play the same clip are sampled together. What physics moves is left to physics.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.clip import Clip, Property, decode_clips
from elys.common.assets.clip_sampling import PROPERTIES, ClipSampler
from elys.common.assets.store import AssetStore
from elys.common.components import Animation, Morph, RigidBody, Transform
from elys.common.errors import AssetError
from elys.common.ids import Entity
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.entities import Entities, Indices
from elys.sim_node.ecs.world import World
from elys.sim_node.physics.states import Problem

REPEAT, PING_PONG, ONCE = range(3)  # as the column of Animation.loop has them
_MOVED: Final[tuple[Property, ...]] = ("position", "rotation", "scale")
_NOWHERE: Final = -1


class Animated(NamedTuple):
    """What clips move: of M entities the local transform, and the weights of W morph targets; as `StateFrame` has them."""

    local_position: NDArray[np.float32]  # (M, 3) m
    local_rotation: NDArray[np.float32]  # (M, 4)
    local_scale: NDArray[np.float32]  # (M, 3)
    local_entity: Entities  # (M,)
    weight: NDArray[np.float32]  # (W,)
    weight_entity: Entities  # (W,)
    weight_target: Entities  # (W,)


_NOTHING_ANIMATED: Final = Animated(
    np.zeros((0, 3), np.float32),
    np.zeros((0, 4), np.float32),
    np.zeros((0, 3), np.float32),
    np.zeros(0, np.uint32),
    np.zeros(0, np.float32),
    np.zeros(0, np.uint32),
    np.zeros(0, np.uint32),
)


class _Players(NamedTuple):
    """N entities that play one clip.

    Attributes:
        entities: [N]. places: of each property [N C] the place of the entity that each channel of each player moves, -1 for none.
        weights: [N, W] of morph targets, as they are now.
    """

    sampler: ClipSampler
    entities: Entities
    places: dict[Property, Indices]
    weights: NDArray[np.float64]


class Animations:
    """Who plays what in a world."""

    def __init__(self, world: World, assets: AssetStore) -> None:
        self._world = world
        self._assets = assets
        self._query = world.query(Animation, enabled_only=True)
        self._clips: dict[str, dict[str, Clip] | str] = {}  # by reference; a text says why there are none
        self._samplers: dict[tuple[str, str], ClipSampler] = {}
        self._players: list[_Players] = []
        self._moved: Indices = np.zeros(0, np.intp)  # places, rising
        self._problems: list[Problem] = []
        self._told: set[tuple[int, str]] = set()

    @property
    def is_needed(self) -> bool:
        """Whether anybody plays a clip, or did so until now."""
        return bool(len(self._query) or self._players)

    def take_problems(self) -> list[Problem]:
        """What could not be played, or only in part, since this was last asked."""
        problems, self._problems = self._problems, []
        return problems

    def follow(self, changes: WorldChanges) -> list[Entity]:
        """Binds clips anew where that may have changed, and poses what they move.

        Returns the entities that live and are moved no more: frames tell no longer where they are.
        """
        if not self.is_needed:
            return []
        before = self._world.allocator.ids[self._moved]
        if _may_bind_otherwise(changes):
            self._bind()
        self.pose()
        stopped = np.setdiff1d(before, self._world.allocator.ids[self._moved]).tolist()
        return [Entity(entity) for entity in stopped if entity and self._world.is_alive(entity)]

    def advance(self, seconds: float) -> None:
        """Lets the time of all clips go on, and poses what they move."""
        if not self._players:
            return
        table = self._world.table(Animation)
        for players in self._players:
            rows = table.rows(players.entities)
            times, speed = table.column("time")[rows], table.column("speed")[rows].astype(np.float64)
            moved = times + np.where(table.column("playing")[rows], speed * seconds, 0.0)
            table.column("time")[rows] = _wrapped(moved, table.column("loop")[rows], players.sampler.duration)
        self.pose()

    def pose(self) -> None:
        """Writes what the clips say at their times; logs no change."""
        animation, transform = self._world.table(Animation), self._world.table(Transform)
        for players in self._players:
            samples = players.sampler.sample(self._clip_times(players, animation.rows(players.entities)))
            for name in _MOVED:
                places = players.places[name]
                found = np.flatnonzero(places != _NOWHERE)
                values = getattr(samples, name)
                flat = values.reshape(-1, values.shape[-1])
                transform.column(name)[transform.row_of[places[found]]] = flat[found]
            players.weights[:] = samples.weights
        if len(self._moved):
            self._world.transforms.mark_dirty(self._moved)

    def bind_anew(self) -> None:
        """The world was put back to another time: who plays what is found anew; nothing is moved but weights."""
        self._bind()
        animation = self._world.table(Animation)
        for players in self._players:
            times = self._clip_times(players, animation.rows(players.entities))
            players.weights[:] = players.sampler.sample(times).weights

    def animated(self) -> Animated:
        """What clips move, as it is now."""
        if not self._players:
            return _NOTHING_ANIMATED
        table = self._world.table(Transform)
        rows = table.row_of[self._moved]
        return Animated(
            table.column("position")[rows].astype(np.float32),
            table.column("rotation")[rows],
            table.column("scale")[rows],
            self._world.allocator.ids[self._moved],
            *self._weights(),
        )

    # --- inside ----------------------------------------------------------------------------------------------------

    def _weights(self) -> tuple[NDArray[np.float32], Entities, Entities]:
        values, places, numbers = [np.zeros(0)], [np.zeros(0, np.intp)], [np.zeros(0, np.uint32)]
        for players in self._players:
            flat = players.places["weights"]
            found = np.flatnonzero(flat != _NOWHERE)
            values.append(players.weights.ravel()[found])
            places.append(flat[found])
            numbers.append(np.tile(players.sampler.weight_numbers, len(players.entities))[found])
        ids = self._world.allocator.ids[np.concatenate(places)]
        return np.concatenate(values).astype(np.float32), ids, np.concatenate(numbers)

    def _clip_times(self, players: _Players, rows: NDArray[np.int32]) -> NDArray[np.float64]:
        """[N] times in the clip itself: on the way back of a ping-pong they run backwards."""
        table, duration = self._world.table(Animation), players.sampler.duration
        loop = table.column("loop")[rows]
        times = _wrapped(table.column("time")[rows], loop, duration)
        return np.where((loop == PING_PONG) & (times > duration), 2.0 * duration - times, times)

    def _bind(self) -> None:
        together: dict[tuple[str, str], list[int]] = {}
        for entity in self._query.entities.tolist():
            animation = self._world.get(Entity(entity), Animation)
            if animation.clips and self._sampler(entity, animation) is not None:
                together.setdefault((animation.clips, animation.clip), []).append(entity)
        self._players = [self._players_of(self._samplers[key], entities) for key, entities in together.items()]
        places = [players.places[name] for players in self._players for name in _MOVED]
        moved = np.unique(np.concatenate(places)) if places else np.zeros(0, np.intp)
        self._moved = moved[moved != _NOWHERE]

    def _sampler(self, entity: int, animation: Animation) -> ClipSampler | None:
        key = (animation.clips, animation.clip)
        if key in self._samplers:
            return self._samplers[key]
        clips = self._clips_of(animation.clips)
        if isinstance(clips, str):
            self._tell(entity, f"plays nothing: {clips}")
            return None
        clip = clips.get(animation.clip) if animation.clip else next(iter(clips.values()), None)
        if clip is None:
            names = ", ".join(f"'{name}'" for name in list(clips)[:12]) or "none"
            self._tell(entity, f"plays nothing: there is no clip '{animation.clip}' among its clips; there are {names}")
            return None
        sampler = self._samplers[key] = ClipSampler(clip)
        return sampler

    def _clips_of(self, reference: str) -> dict[str, Clip] | str:
        if reference not in self._clips:
            try:
                self._clips[reference] = {clip.name: clip for clip in decode_clips(self._assets.get(reference))}
            except AssetError as error:
                self._clips[reference] = str(error)
        return self._clips[reference]

    def _players_of(self, sampler: ClipSampler, entities: list[int]) -> _Players:
        places: dict[Property, list[int]] = {name: [] for name in PROPERTIES}
        for entity in entities:
            below = self._places_below(entity)
            lost = {target for targets in sampler.targets.values() for target in targets if target not in below}
            for name in PROPERTIES:
                can = self._can_morph if name == "weights" else self._can_move
                found = (below.get(target, _NOWHERE) for target in sampler.targets[name])
                places[name] += [place if place != _NOWHERE and can(place) else _NOWHERE for place in found]
            if lost:
                some = ", ".join(sorted("'" + "/".join(target) + "'" for target in lost)[:4])
                self._tell(entity, f"has nobody below it at {some}, which its clip moves")
        columns = {name: np.array(found, np.intp) for name, found in places.items()}
        weights = np.zeros((len(entities), len(sampler.weight_numbers)))
        return _Players(sampler, np.array(entities, np.uint32), columns, weights)

    def _can_move(self, place: int) -> bool:
        """Whether something says where the entity stands, and physics does not."""
        world = self._world
        return bool(world.table(Transform).row_of[place] != NO_ROW and world.table(RigidBody).row_of[place] == NO_ROW)

    def _can_morph(self, place: int) -> bool:
        return bool(self._world.table(Morph).row_of[place] != NO_ROW)

    def _places_below(self, entity: int) -> dict[tuple[str, ...], int]:
        """Everybody below an entity, and itself, by the names that lead there; the first of equal ones."""
        hierarchy = self._world.hierarchy
        places = hierarchy.subtree_places(hierarchy.require(entity))
        paths: dict[int, tuple[str, ...]] = {int(places[0]): ()}
        found: dict[tuple[str, ...], int] = {(): int(places[0])}
        names, parents = hierarchy.names(places[1:]), hierarchy.parent[places[1:]].tolist()
        for place, name, parent in zip(places[1:].tolist(), names, parents, strict=True):
            paths[place] = (*paths[parent], name)
            found.setdefault(paths[place], place)
        return found

    def _tell(self, entity: int, what: str) -> None:
        if (entity, what) not in self._told:
            self._told.add((entity, what))
            self._problems.append(Problem(entity, f"{self._world.describe(Entity(entity))} {what}"))


def _may_bind_otherwise(changes: WorldChanges) -> bool:
    names = {name for _, name in changes.set}
    anew = (changes.overflowed, changes.structure, changes.added, changes.removed, changes.renamed, changes.switched)
    return any(anew) or Animation.__name__ in names


def _wrapped(times: NDArray[np.float64], loop: NDArray[np.uint8], duration: float) -> NDArray[np.float64]:
    """[N] times that a clip of that duration can be at: within it, of a ping-pong within the way there and back."""
    if duration <= 0.0:
        return np.zeros_like(times)
    period = np.where(loop == PING_PONG, 2.0 * duration, duration)
    around = np.fmod(times, period)
    around = np.where(around < 0.0, around + period, around)
    return np.where(loop == ONCE, np.clip(times, 0.0, duration), around)
