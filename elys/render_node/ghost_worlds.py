"""Ghosts as a renderer wants them: what moves in other runs, where it is at the instant that is seen of this one.

A ghost is a world of its own, of nothing but its bodies and what rides on them, placed at the time at which the scene is seen. A
body that is where its other self is, is not drawn twice: only what has parted is seen. Without ghosts there is nothing here to be
asked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.ghost_track import GhostTrack
from elys.bus.messages.ghosts import Color
from elys.bus.mirror import SceneMirror
from elys.common.components import Component
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_tables import SceneTables, tables_of
from elys.render_node.timeline import Timeline, rows_in

SAME_PLACE: Final = 1e-3  # [m] within which a body has not parted from itself; compact recordings are off by less
SAME_ROTATION: Final = 4e-3  # [rad] likewise
_SHAPE: Final = frozenset(("MeshRenderer", "Material", "Skin", "Morph"))


class Parting(NamedTuple):
    """The K bodies of a ghost that are elsewhere than in the scene."""

    entity: NDArray[np.uint32]  # (K,)
    here: NDArray[np.float64]  # (K, 3) [m] in the scene; NaN of those that it has not
    there: NDArray[np.float64]  # (K, 3) [m] of the ghost

    @property
    def distance(self) -> NDArray[np.float64]:
        """[K] m; NaN of those that are in the ghost alone."""
        return np.asarray(np.linalg.norm(self.there - self.here, axis=1))


class ShownGhost(NamedTuple):
    """A ghost in one picture."""

    title: str
    color: Color
    world: RenderWorld
    left_out: tuple[int, ...]  # entities of it, with all below them, that are not drawn
    parting: Parting
    body_count: int


class GhostWorlds:
    """The worlds of a session's or a recording's ghosts."""

    def __init__(self, on_ready: Callable[[], None] = lambda: None) -> None:
        """`on_ready` hears, on any thread, that a mesh has come."""
        self._on_ready = on_ready
        self._worlds: dict[int, _GhostWorld] = {}

    def shown(self, tracks: Mapping[str, GhostTrack], scene: RenderWorld, *, settled: bool = False) -> list[ShownGhost]:
        """The ghosts that have begun by the time at which the scene is placed; with `settled`, all their meshes are here."""
        tracked = {id(track): track for track in tracks.values()}
        for gone in [key for key in self._worlds if key not in tracked]:
            self._worlds.pop(gone).close()
        shown = []
        for key, track in tracked.items():
            if key not in self._worlds:
                self._worlds[key] = _GhostWorld(track, self._on_ready)
            found = self._worlds[key].shown(scene, settled=settled)
            if found is not None:
                shown.append(found)
        return shown

    def close(self) -> None:
        """Lets go of all."""
        for world in self._worlds.values():
            world.close()
        self._worlds.clear()


class _GhostWorld:
    """One of them."""

    def __init__(self, track: GhostTrack, on_ready: Callable[[], None]) -> None:
        self.track = track
        self.world = RenderWorld(DrawableAssets(track.fetch, on_ready=on_ready), environment=False)
        self._told: tuple[object, ...] = ()

    def shown(self, scene: RenderWorld, *, settled: bool) -> ShownGhost | None:
        now = scene.seen_time
        pair = self.track.around(now) if now is not None else None
        if pair is None or now is None:
            return None
        before, after = pair
        self._follow_scene(np.union1d(before.entity, before.local_entity))
        self.world.take_pair(before, after)
        if settled:
            for batch in self.world.batches:
                self.world.assets.mesh(batch.mesh)
            self.world.assets.settle()
        gap = after.simulation_time - before.simulation_time
        offset = self._offset(now, before.simulation_time, gap)
        self.world.place(simulation_time=before.simulation_time + offset)
        parting, same = _parted(scene, self.world)
        return ShownGhost(
            title=self.track.title,
            color=self.track.color,
            world=self.world,
            left_out=tuple(same.tolist()),
            parting=parting,
            body_count=len(after.entity),
        )

    def close(self) -> None:
        self.world.assets.close()

    def _offset(self, now: float, start: float, gap: float) -> float:
        return min(max(self.track.own_time(now) - start, 0.0), gap)

    def _follow_scene(self, moving: NDArray[np.uint32]) -> None:
        mirror = self.track.mirror
        told = (id(mirror), mirror.epoch, mirror.sequence, moving.tobytes())
        if told != self._told:
            self._told = told
            self.world.set_scene(_moving_tables(mirror, moving))


def _moving_tables(mirror: SceneMirror, moving: NDArray[np.uint32]) -> SceneTables:
    """Of entities that move and all below them, with what they stand under; nothing else of it is drawn, and nothing shines."""
    ordered = mirror.in_order()
    moves, needed = set(moving.tolist()), set()
    for entity in ordered:
        if entity.parent in moves:
            moves.add(entity.id)
    for entity in reversed(ordered):
        if entity.id in moves or entity.id in needed:
            needed |= {entity.id, entity.parent}
    if any("Skin" in entity.components for entity in ordered if entity.id in moves):
        needed = {entity.id for entity in ordered}  # joints are found by their names, wherever they stand
    kept = [entity for entity in ordered if entity.id in needed]

    def worn(entity: int, components: Mapping[str, Component]) -> dict[str, Component]:
        drawn = _SHAPE if entity in moves else frozenset[str]()
        return {name: value for name, value in components.items() if name == "Transform" or name in drawn}

    return tables_of(
        [entity.id for entity in kept],
        [entity.parent for entity in kept],
        [worn(entity.id, entity.components) for entity in kept],
        enabled=[entity.enabled for entity in kept],
        pose_sequence=[entity.pose_sequence for entity in kept],
        names=[entity.name for entity in kept],
    )


def _parted(scene: RenderWorld, ghost: RenderWorld) -> tuple[Parting, NDArray[np.uint32]]:
    """The bodies of a ghost that are elsewhere than in the scene, as both are placed, and those that are not."""
    entities, there, turned = _poses(ghost.timeline, ghost.standing.fraction)
    bodies, here, rotation = _poses(scene.timeline, scene.standing.fraction)
    rows, known = rows_in(bodies, entities)
    place = np.full((len(entities), 3), np.nan)
    angle = np.zeros(len(entities))
    if len(bodies):
        place[known] = here[rows[known]]
        # The vector part of the turn between both, twice its length for small ones.
        dot = np.abs(np.einsum("ij,ij->i", rotation[rows].astype(np.float64), turned.astype(np.float64)))
        angle = np.where(known, 2.0 * np.arccos(np.clip(dot, 0.0, 1.0)), 0.0)
    is_same = known & (np.linalg.norm(there - place, axis=1) <= SAME_PLACE) & (angle <= SAME_ROTATION)
    parted = ~is_same
    return Parting(entities[parted], place[parted], there[parted]), entities[is_same]


def _poses(timeline: Timeline, fraction: float) -> tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.float32]]:
    """Bodies (N,) of the newest frame, their positions (N, 3) and rotations (N, 4)."""
    newest = timeline.newest
    if newest is None:
        return np.zeros(0, np.uint32), np.zeros((0, 3)), np.zeros((0, 4), np.float32)
    position, rotation, _ = timeline.poses(newest.entity, fraction)
    return newest.entity, position, rotation
