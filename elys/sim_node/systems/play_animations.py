"""play_animations: clips at the time of the simulation, into the Transforms of what they name.

Components say what is played; `Voices` are the clips that are heard, with those that still fade out. Who plays is bound to the
entities that channels name, anew where the tree or the components change. What physics moves is left to physics. A tick is
`advance`: times and weights go on, poses are written, markers told, root motion done. See docs/animation.md.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.session import Event
from elys.common.assets.store import AssetStore
from elys.common.components import Animation, AnimationBlend, AnimationLayer, AnimationMarkers, RootMotion, Transform
from elys.common.ids import Entity
from elys.sim_node.animation.binding import Binding
from elys.sim_node.animation.clip_library import ClipLibrary
from elys.sim_node.animation.clip_times import Way, clip_times, ends_met, go_on, wrapped
from elys.sim_node.animation.crew import NOBODY, Crew, crew_of
from elys.sim_node.animation.markers import MarkerTable, marked_voices
from elys.sim_node.animation.players import Layer, layers_of, tent_weights, tents, wanted_by
from elys.sim_node.animation.posing import Part, Poser
from elys.sim_node.animation.rest_poses import RestPoses
from elys.sim_node.animation.root_walks import Driven, RootWalks, find_walker
from elys.sim_node.animation.voices import Voice, Voices, changed
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.entities import Entities, Indices
from elys.sim_node.ecs.world import World
from elys.sim_node.physics.states import Problem

# What decides which clips are bound to whom, beside the tree; of Animation.loop the voices keep a copy.
_DECIDING: Final = (
    (Animation, ("clips", "clip", "loop")),
    (AnimationBlend, ("mix", "by")),
    (AnimationLayer, ("on", "order", "mode", "mask")),
    (AnimationMarkers, ("markers",)),
    (RootMotion, ("node", "turn", "height", "mode")),
)


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


class Animations:
    """Who plays what in a world.

    Attributes:
        voices, rest, walks: what a state holds.
    """

    def __init__(self, world: World, assets: AssetStore) -> None:
        self._world = world
        self._query = world.query(Animation, enabled_only=True)
        self.library = ClipLibrary(assets)
        self._binding = Binding(world, self._tell)
        self.voices = Voices()
        self.rest = RestPoses()
        self.walks = RootWalks()
        self._crew: Crew = NOBODY
        self._poser: Poser | None = None
        self._markers = MarkerTable(())
        self._moved: Indices = np.zeros(0, np.intp)  # places, rising
        self._written = np.zeros(0)  # [N] what Animation.time was when this last wrote it
        self._seen: tuple[object, ...] = ()
        self._driven: Driven | None = None
        self._events: list[Event] = []
        self._problems: list[Problem] = []
        self._told: set[tuple[int, str]] = set()

    @property
    def is_needed(self) -> bool:
        """Whether anybody plays a clip, or did so until now."""
        return bool(len(self._query) or len(self.voices) or len(self._moved))

    def take_problems(self) -> list[Problem]:
        """What could not be played, or only in part, since this was last asked."""
        problems, self._problems = self._problems, []
        return problems

    def take_events(self) -> list[Event]:
        """The markers that came by since this was last asked, in order."""
        events, self._events = self._events, []
        return events

    def take_driven(self) -> Driven | None:
        """The bodies that physics is to move by root motion in this tick."""
        driven, self._driven = self._driven, None
        return driven

    def follow(self, changes: WorldChanges) -> list[Entity]:
        """Binds clips anew where that may have changed, and poses what they move.

        Returns the entities that live and are moved no more: frames tell no longer where they are.
        """
        if not self.is_needed:
            return []
        before = self._world.allocator.ids[self._moved]
        self.rest.follow(self._world, changes)
        is_touched = self._binding.is_touched(changes)
        if is_touched:
            self._binding.forget()
        if is_touched or self._deciding() != self._seen:
            self._bind()
        elif self.walks.is_touched(changes):
            self._plan()
        self._take_times()
        self.pose()
        stopped = np.setdiff1d(before, self._world.allocator.ids[self._moved]).tolist()
        return [Entity(entity) for entity in stopped if entity and self._world.is_alive(entity)]

    def advance(self, seconds: float) -> None:
        """Lets the time of all clips go on, and poses what they move."""
        if not len(self.voices):
            return
        self._weigh()
        self.voices.fade(seconds)
        way = self._go_on(seconds)
        self._events += self._met(way)
        if len(self.walks):
            self._driven = self.walks.walk(self._world, way, self.voices.loop, self._shares(), seconds)
        if self.voices.drop_gone():
            self._plan()
        self.pose()

    def pose(self) -> None:
        """Writes what the clips say at their times; logs no change."""
        if self._poser is None:
            return
        self._poser.pose(self._times(), self._shares(in_layers=True))
        if len(self.walks):
            self.walks.hold(self._world)

    def bind_anew(self) -> None:
        """The world was put back to another time: who plays what is found anew; nothing is moved but weights."""
        self._binding.forget()
        self._bind()
        if self._poser is not None:
            self._poser.pose(self._times(), self._shares(in_layers=True), only_weights=True)

    def animated(self) -> Animated:
        """What clips move, as it is now."""
        if self._poser is None:
            return _NOTHING_ANIMATED
        table = self._world.table(Transform)
        rows = table.row_of[self._moved]
        return Animated(
            table.column("position")[rows].astype(np.float32),
            table.column("rotation")[rows],
            table.column("scale")[rows],
            self._world.allocator.ids[self._moved],
            self._poser.weights.astype(np.float32),
            *self._poser.weight_places,
        )

    # --- a tick ----------------------------------------------------------------------------------------------------

    def _weigh(self) -> None:
        """Clips of a mix by value become what the value says."""
        crew = self._crew
        if len(crew.by_value):
            table = self._world.table(AnimationBlend)
            owners = crew.entities[crew.owner[crew.by_value]]
            values = table.column("value")[table.rows(owners)].astype(np.float64)
            self.voices.target[crew.by_value] = tent_weights(values, crew.tent)

    def _go_on(self, seconds: float) -> Way:
        """Brings players and voices to the end of the tick; the ways of voices [V]."""
        crew, voices, table = self._crew, self.voices, self._world.table(Animation)
        rows = table.rows(crew.entities)
        loop, goes = table.column("loop")[rows], table.column("playing")[rows]
        steps = np.where(goes, table.column("speed")[rows].astype(np.float64) * seconds, 0.0) * self._pace()
        way = go_on(table.column("time")[rows], steps, loop, crew.reference)
        table.column("time")[rows] = self._written = way.end
        passes = table.column("passes")
        passes[rows] = np.minimum(passes[rows] + ends_met(way, loop), np.iinfo(np.int32).max)
        ratio = self._ratio()
        wanted = voices.is_wanted
        voices.rate = np.where(wanted, steps[crew.owner] / seconds * ratio, voices.rate)
        own = go_on(voices.time, np.where(goes[crew.owner], voices.rate * seconds, 0.0), voices.loop, crew.duration)
        theirs = way.of(crew.owner)
        found = Way(
            np.where(wanted, theirs.start * ratio, own.start),
            np.where(wanted, theirs.end * ratio, own.end),
            np.where(wanted, theirs.laps, own.laps),
            np.where(wanted, theirs.goes_on, own.goes_on),
            np.where(wanted, theirs.ended, own.ended),
        )
        voices.time = found.end
        return found

    def _pace(self) -> NDArray[np.float64]:
        """[N] seconds of the longest clip for each second: clips in step take as long as their weighted mean."""
        crew, voices = self._crew, self.voices
        if crew.is_single.all():
            return np.ones(len(crew.entities))
        weight = np.where(voices.is_wanted, voices.weight, 0.0)
        total = np.bincount(crew.owner, weight, len(crew.entities))
        mean = np.bincount(crew.owner, weight * crew.duration, len(crew.entities))
        is_mixed = ~crew.is_single & (total > 0.0) & (mean > 0.0)
        return np.where(is_mixed, crew.reference * total / np.where(is_mixed, mean, 1.0), 1.0)

    def _ratio(self) -> NDArray[np.float64]:
        """[V] seconds of a voice's clip for each of its player's."""
        reference = self._crew.reference[self._crew.owner]
        return self._crew.duration / np.where(reference > 0.0, reference, 1.0)

    def _met(self, way: Way) -> list[Event]:
        if not len(self._markers):
            return []
        crew, voices = self._crew, self.voices
        wanted = np.where(voices.is_wanted, voices.weight, -1.0)
        most = np.full(len(crew.entities), -1.0)
        np.maximum.at(most, crew.owner, wanted)
        heaviest = np.flatnonzero(voices.is_wanted & (wanted >= most[crew.owner]))
        is_heard = np.zeros(len(voices), np.bool_)
        is_heard[heaviest[np.unique(crew.owner[heaviest], return_index=True)[1]]] = True
        return self._markers.met(way, voices.loop, crew.duration, is_heard, self._world)

    def _shares(self, *, in_layers: bool = False) -> NDArray[np.float64]:
        """[V] what part of what its player plays each voice is; of layers times how much there is of them."""
        crew, weight = self._crew, self.voices.weight
        total = np.bincount(crew.owner, weight, len(crew.entities))[crew.owner]
        share = np.where(total > 0.0, weight / np.where(total > 0.0, total, 1.0), 0.0)
        if in_layers and len(crew.layers):
            table = self._world.table(AnimationLayer)
            factor = np.ones(len(crew.entities))
            factor[crew.layers] = table.column("weight")[table.rows(crew.entities[crew.layers])]
            share = share * factor[crew.owner]
        return share

    def _times(self) -> NDArray[np.float64]:
        """[V] s in the clips themselves."""
        return clip_times(self.voices.time, self.voices.loop, self._crew.duration)

    def _take_times(self) -> None:
        """Voices that are wanted stand where Animation.time says."""
        crew, voices = self._crew, self.voices
        if not len(voices):
            return
        table = self._world.table(Animation)
        rows = table.rows(crew.entities)
        times = wrapped(table.column("time")[rows], table.column("loop")[rows], crew.reference)
        voices.time = np.where(voices.is_wanted, times[crew.owner] * self._ratio(), voices.time)

    # --- who plays what --------------------------------------------------------------------------------------------

    def _deciding(self) -> tuple[object, ...]:
        tables = [(self._world.table(kind), fields) for kind, fields in _DECIDING]
        columns = [table.column(field).tobytes() for table, fields in tables for field in fields]
        return (self._query.version, *(table.structure_version for table, _ in tables), *columns)

    def _bind(self) -> None:
        """Voices become what the components want."""
        world, table = self._world, self._world.table(Animation)
        present = self.voices.by_entity()
        before = dict(zip(self._crew.entities.tolist(), self._written.tolist(), strict=True))
        voices: list[Voice] = []
        for entity in self._query.entities.tolist():
            wanted = wanted_by(world, entity, self.library, self._tell)
            row = int(table.rows(np.array([entity], np.uint32))[0])
            weights = dict(wanted.clips)
            if wanted.is_by_value:
                blend = world.get(Entity(entity), AnimationBlend)
                tent = np.array(tents(list(weights.values()))).reshape(-1, 3)
                shares = tent_weights(np.full(len(tent), blend.value), tent)
                weights = dict(zip(weights, shares.tolist(), strict=True))
            loop, fade = int(table.column("loop")[row]), float(table.column("fade")[row])
            mine = present.get(entity, [])
            now = changed(mine, entity, weights, fade=fade, loop=loop)
            for voice in now:
                if voice.is_wanted:
                    voice.loop = loop
            if now is not mine and mine and before.get(entity) == table.column("time")[row]:
                self._keep_step(row, now, mine)
            voices += now
        self.voices.put(voices)
        self._plan()
        self._seen = self._deciding()

    def _keep_step(self, row: int, now: list[Voice], mine: list[Voice]) -> None:
        """A clip that goes on in another mix goes on from where it is, although the longest may be another one now."""
        old = next((voice for voice in mine if voice.is_wanted and any(voice is other for other in now)), None)
        if old is None:
            return
        length = self.library.sampler(old.key).duration
        longest = max(self.library.sampler(voice.key).duration for voice in now if voice.is_wanted)
        if length > 0.0:
            self._world.table(Animation).column("time")[row] = old.time * longest / length

    def _plan(self) -> None:
        """All that follows from the voices there are, and from the tree."""
        world = self._world
        players = list(dict.fromkeys(self.voices.entity.tolist()))
        layers = layers_of(world, players, self._tell)
        self._crew = crew_of(world, self.voices, self.library, players, layers)
        table = world.table(Animation)
        self._written = table.column("time")[table.rows(self._crew.entities)]
        parts = self._parts(layers)
        self._poser = Poser(world, parts, self.rest) if parts else None
        self._bind_walks(players, layers)
        self._markers = MarkerTable(marked_voices(world, self.voices, players, self._tell))
        moved = [self._poser.moved if self._poser is not None else np.zeros(0, np.intp), self.walks.places(world)]
        self._moved = np.unique(np.concatenate(moved))

    def _parts(self, layers: dict[int, Layer]) -> list[Part]:
        counts = np.bincount(self._crew.owner, minlength=len(self._crew.entities)).tolist()
        count = dict(zip(self._crew.entities.tolist(), counts, strict=True))
        below_layers = {layer.root for layer in layers.values() if layer.number}
        parts = []
        for voice, (entity, key) in enumerate(zip(self.voices.entity.tolist(), self.voices.keys, strict=True)):
            layer = layers.get(entity)
            if layer is None:
                continue
            sampler = self.library.sampler(key)
            places = self._binding.places(layer.root, key, sampler, layer.mask)
            is_alone = not layer.number and count[entity] == 1 and entity not in below_layers
            parts.append(Part(voice, layer.root, layer.number, layer.is_added, is_alone, key, sampler, places))
        return parts

    def _bind_walks(self, players: list[int], layers: dict[int, Layer]) -> None:
        walkers = {}
        for entity in players:
            if entity in layers and not layers[entity].number and self._world.has(Entity(entity), RootMotion):
                walker = find_walker(self._world, entity, self._binding, self.rest, self._tell)
                if walker is not None:
                    walkers[entity] = walker
        if not walkers and not len(self.walks) and not len(self.walks.entity):
            return
        voices = [
            (voice, entity, key, self.library.sampler(key).clip)
            for voice, (entity, key) in enumerate(zip(self.voices.entity.tolist(), self.voices.keys, strict=True))
            if entity in walkers
        ]
        self.walks.bind(self._world, list(walkers.values()), voices)

    def _tell(self, entity: int, what: str) -> None:
        if (entity, what) not in self._told:
            self._told.add((entity, what))
            self._problems.append(Problem(entity, f"{self._world.describe(Entity(entity))} {what}"))
