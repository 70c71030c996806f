"""Who goes by root motion in a world, and how far in a tick; root_motion.py has the geometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.clip import Clip
from elys.common.components import RigidBody, RootMotion, Transform
from elys.common.ids import Entity
from elys.common.math import quaternion
from elys.sim_node.animation.binding import Binding
from elys.sim_node.animation.clip_library import ClipKey
from elys.sim_node.animation.clip_times import Way
from elys.sim_node.animation.rest_poses import RestPoses
from elys.sim_node.animation.root_motion import (
    Floats64,
    Frame,
    Ground,
    RootTrack,
    frame_of,
    held,
    mean,
    of_entity,
    rotation_of,
    standing,
)
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.entities import Entities, Indices
from elys.sim_node.ecs.world import World

TELL = 1  # place among the choices of RootMotion.mode


class Driven(NamedTuple):
    """Bodies [N] that go by root motion: velocities in the world [m/s], [rad/s]; `rises` where the vertical one counts."""

    entity: Entities
    linear: Floats64
    angular: Floats64
    rises: NDArray[np.bool_]


class Walker(NamedTuple):
    """An entity with RootMotion whose clips may move it.

    Attributes:
        node: place of the one whose motion it takes. chain: those from below it down to that one.
    """

    entity: int
    node: int
    path: tuple[str, ...]
    frame: Frame
    is_told: bool
    chain: frozenset[int]


class _Stretch(NamedTuple):
    """Voices [G] whose root motion is worked out together, and which of the walkers each belongs to."""

    track: RootTrack
    frame: Frame
    duration: float
    voices: Indices
    owner: Indices


class RootWalks:
    """Root motion of a world.

    Attributes:
        entity: [N] who has RootMotion, rising. gone, rotation: how far each went in the last tick, in the world [m], and how it
            turned in its own space.
    """

    def __init__(self) -> None:
        self.entity = np.zeros(0, np.uint32)
        self.gone = np.zeros((0, 3))
        self.rotation = np.zeros((0, 4))
        self._walkers: list[Walker] = []
        self._stretches: list[_Stretch] = []
        self._held: list[tuple[Frame, Indices]] = []
        self._tracks: dict[tuple[ClipKey, tuple[str, ...]], RootTrack] = {}

    def __len__(self) -> int:
        return len(self._walkers)

    def is_touched(self, changes: WorldChanges) -> bool:
        """Whether somebody edited how a node rests, or one above it."""
        edited = {entity for entity, component in changes.set if component == Transform.__name__}
        return bool(edited) and any(edited & one.chain for one in self._walkers)

    def places(self, world: World) -> Indices:
        """Those whose Transforms are written."""
        rigid = world.table(RigidBody).row_of
        found = [int(world.hierarchy.require(Entity(one.entity))) for one in self._walkers if not one.is_told]
        return np.array([place for place in found if rigid[place] == NO_ROW], np.intp)

    def bind(self, world: World, walkers: list[Walker], voices: list[tuple[int, int, ClipKey, Clip]]) -> None:
        """Makes these all there are; `voices` are rows with their entity, by clip."""
        self._walkers = sorted(walkers, key=lambda one: one.entity)
        number = {one.entity: place for place, one in enumerate(self._walkers)}
        together: dict[object, list[tuple[int, int, ClipKey, Clip]]] = {}
        for voice, entity, key, clip in voices:
            walker = self._walkers[number[entity]]
            together.setdefault((key, walker.path, _alike(walker.frame)), []).append((voice, number[entity], key, clip))
        nodes: dict[object, tuple[Frame, list[int]]] = {}
        for walker in self._walkers:
            nodes.setdefault(_alike(walker.frame), (walker.frame, []))[1].append(walker.node)
        self._held = [(frame, np.array(places, np.intp)) for frame, places in nodes.values()]
        self._stretches = []
        for several in together.values():
            _, owner, key, clip = several[0]
            walker = self._walkers[owner]
            track = self._tracks.setdefault((key, walker.path), RootTrack(clip, walker.path))
            rows, owners = (np.array([one[part] for one in several], np.intp) for part in (0, 1))
            self._stretches.append(_Stretch(track, walker.frame, clip.duration, rows, owners))
        ids = np.array([one.entity for one in self._walkers], np.uint32)
        if not np.array_equal(ids, self.entity):
            known = {entity: row for row, entity in enumerate(self.entity.tolist())}
            gone, rotation = np.zeros((len(ids), 3)), np.tile(quaternion.IDENTITY, (len(ids), 1))
            for row, entity in enumerate(ids.tolist()):
                if entity in known:
                    gone[row], rotation[row] = self.gone[known[entity]], self.rotation[known[entity]]
            self.entity, self.gone, self.rotation = ids, gone, rotation

    def hold(self, world: World) -> None:
        """Takes out of the nodes' poses what the entities do instead."""
        table = world.table(Transform)
        position, rotation = table.column("position"), table.column("rotation")
        for frame, nodes in self._held:
            rows = table.row_of[nodes]
            position[rows], rotation[rows] = held(position[rows], rotation[rows].astype(np.float64), frame)

    def walk(self, world: World, way: Way, loop: NDArray[np.uint8], shares: Floats64, seconds: float) -> Driven | None:
        """Moves the entities by what their voices did; returns the bodies among them, which physics is to move."""
        motions, of_voice, owners = [], [], []
        for stretch in self._stretches:
            rows = stretch.voices
            part = way.of(rows)
            motions.append(
                of_entity(stretch.track.gone(part, loop[rows], stretch.duration, stretch.frame), stretch.frame)
            )
            of_voice.append(rows)
            owners.append(stretch.owner)
        count = len(self._walkers)
        together = standing(count)
        if motions:
            several = Ground(*(np.concatenate(parts) for parts in zip(*motions, strict=True)))
            together = mean(several, shares[np.concatenate(of_voice)], np.concatenate(owners), count)
        return self._move(world, together, seconds)

    def _move(self, world: World, motion: Ground, seconds: float) -> Driven | None:
        poses = world.transforms.world_poses(self.entity)
        self.rotation = rotation_of(motion.turn)
        self.gone = np.asarray(
            quaternion.rotate(poses.rotation.astype(np.float64), motion.place * poses.scale.astype(np.float64)),
            np.float64,
        )
        places = world.hierarchy.require_parents(self.entity)
        is_body = world.table(RigidBody).row_of[places] != NO_ROW
        moves = np.array([not one.is_told for one in self._walkers], np.bool_)
        self._write(world, places[moves & ~is_body], motion, np.flatnonzero(moves & ~is_body))
        chosen = np.flatnonzero(moves & is_body)
        if not len(chosen):
            return None
        up = np.asarray(quaternion.rotate(poses.rotation[chosen].astype(np.float64), (0.0, 1.0, 0.0)), np.float64)
        rises = np.array([self._walkers[row].frame.rises for row in chosen.tolist()], np.bool_)
        speed = _angle(motion.turn[chosen]) / seconds
        return Driven(self.entity[chosen], self.gone[chosen] / seconds, speed[:, None] * up, rises)

    def _write(self, world: World, places: Indices, motion: Ground, rows: Indices) -> None:
        if not len(places):
            return
        table = world.table(Transform)
        at = table.row_of[places]
        position, rotation, scale = (table.column(name) for name in ("position", "rotation", "scale"))
        turn = rotation[at].astype(np.float64)
        position[at] += quaternion.rotate(turn, motion.place[rows] * scale[at].astype(np.float64))
        if (motion.turn[rows, 0] != 0.0).any():
            rotation[at] = quaternion.normalize(quaternion.multiply(turn, rotation_of(motion.turn[rows])))
        world.transforms.mark_dirty(places)


def find_walker(
    world: World, entity: int, binding: Binding, rest: RestPoses, tell: Callable[[int, str], None]
) -> Walker | None:
    """The walker that an entity with RootMotion is; tells why it is none."""
    component = world.get(Entity(entity), RootMotion)
    path = tuple(filter(None, component.node.split("/")))
    below = binding.below(entity)
    if not path or path not in below:
        tell(entity, f"goes nowhere: RootMotion.node names '{component.node}', which is not below it")
        return None
    if not world.has(Entity(entity), Transform):
        tell(entity, "goes nowhere: give it a Transform")
        return None
    chain, ids = [], set[int]()
    table = world.table(Transform)
    for length in range(1, len(path) + 1):
        place = below[path[:length]]
        row = int(table.row_of[place])
        if row == NO_ROW:
            continue
        values = [table.column(name)[row].astype(np.float64) for name in ("position", "rotation", "scale")]
        ids.add(int(world.allocator.ids[place]))
        if rest.knows(int(world.allocator.ids[place])):
            values = [rest.of(name, world.allocator.ids[[place]])[0] for name in ("position", "rotation", "scale")]
        chain.append((values[0], values[1], values[2]))
    if not chain or any((scale == 0.0).any() for _, _, scale in chain):
        tell(entity, f"goes nowhere: '{component.node}' has no Transform, or one above it is squeezed flat")
        return None
    frame = frame_of(chain, turns=component.turn, rises=component.height)
    return Walker(entity, below[path], path, frame, component.mode == "tell", frozenset(ids))


def _alike(frame: Frame) -> tuple[object, ...]:
    """The same for frames of the same numbers."""
    return (*(part.tobytes() for part in (*frame[:3], *frame.rest)), frame.turns, frame.rises)


def _angle(turn: Floats64) -> Floats64:
    """[N] rad of turns (N, 2) that are small, as those of a tick: the series of 2 arcsin, to 1e-9 below half a radian."""
    y = np.where(turn[:, 1] < 0.0, -turn[:, 0], turn[:, 0])
    q = y * y
    return 2.0 * y * (1.0 + q * (1.0 / 6.0 + q * (3.0 / 40.0 + q * (15.0 / 336.0 + q * (105.0 / 3456.0)))))
