"""Cameras that follow: behind what they follow or in its head, and never inside a wall.

The eyes are above the target's place. In third person a ball goes from there to the shoulder and on backwards: where it meets
something, the camera stays before it at once; when the way is free again it goes back little by little.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components import CameraRig, Character, Transform
from elys.common.ids import Entity
from elys.sim_node.character.kernels import turn_views
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.physics.capsules import KinematicCapsules
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.systems.play_animations import Animated

FIRST: Final = 1  # as the column of CameraRig.view has it
_CLEAR: Final = 1e-3  # [m] kept before what is met
_JUMP: Final = 2.0  # [m] eyes that are farther from where they belong do not follow, they are there

Places = NDArray[np.float64]


class Cameras:
    """The camera rigs of a world."""

    def __init__(self, world: World, physics: PhysicsWorld) -> None:
        self._world = world
        self._physics = physics
        self._capsules = KinematicCapsules(physics)
        self._query = world.query(CameraRig, Transform, enabled_only=True)
        self._known: Entities = np.zeros(0, np.uint32)

    @property
    def is_needed(self) -> bool:
        """Whether there is any."""
        return len(self._query) > 0

    def aim(self, dt: float) -> None:
        """Puts all cameras where they belong at the end of a tick of `dt` [s]; logs no change."""
        table = self._world.table(CameraRig)
        entities = self._query.entities
        targets = table.column("target")[table.rows(entities)]
        alive = self._world.allocator.are_alive(targets) & (targets != 0)
        entities, targets = entities[alive], targets[alive]
        if not len(entities):
            return
        rows = table.rows(entities)
        self._turn_along(rows, targets, dt)
        least, most = table.column("least_pitch")[rows], table.column("most_pitch")[rows]
        table.column("pitch")[rows] = np.clip(table.column("pitch")[rows], least, np.maximum(least, most))
        rotation, axes = np.zeros((len(rows), 4)), np.zeros((len(rows), 2, 3))
        turn_views(table.column("yaw")[rows], table.column("pitch")[rows], rotation, axes)
        eyes = self._eyes(rows, targets, dt)
        places = self._behind(rows, targets, eyes, axes, dt)
        self._world.transforms.set_world_poses(entities, places, rotation.astype(np.float32))

    def stopped(self) -> list[Entity]:
        """Who lives and is aimed no more since this was last asked: frames tell no longer where they are."""
        if not len(self._known) and not self.is_needed:
            return []
        before, self._known = self._known, self._query.entities.copy()
        gone = np.setdiff1d(before, self._known).tolist()
        return [Entity(entity) for entity in gone if self._world.is_alive(entity)]

    def animated(self) -> Animated | None:
        """Where the cameras are, as frames tell of what clips move; None where there are none."""
        if not self.is_needed:
            return None
        table, entities = self._world.table(Transform), self._query.entities
        rows = table.rows(entities)
        nothing = np.zeros(0, np.uint32)
        return Animated(
            table.column("position")[rows].astype(np.float32),
            table.column("rotation")[rows],
            table.column("scale")[rows],
            entities,
            np.zeros(0, np.float32),
            nothing,
            nothing,
        )

    # --- inside ----------------------------------------------------------------------------------------------------

    def _turn_along(self, rows: NDArray[np.int32], targets: Entities, dt: float) -> None:
        """Who stands on something that turns sees the world turn: the rig goes along."""
        table, characters = self._world.table(CameraRig), self._world.table(Character)
        walkers = characters.rows(targets)
        turning = (walkers >= 0) & table.column("turns_with_ground")[rows]
        if not turning.any():
            return
        grounds = np.where(turning, characters.column("ground")[np.maximum(walkers, 0)], 0).astype(np.uint32)
        bodies = self._capsules.body_rows(grounds)
        spins = self._physics.bodies.angular_velocity
        for place in np.flatnonzero(bodies >= 0).tolist():
            table.column("yaw")[rows[place]] += float(spins[bodies[place], 1]) * dt

    def _eyes(self, rows: NDArray[np.int32], targets: Entities, dt: float) -> Places:
        """(N, 3) where the eyes are: at once along the level, up and down a little later."""
        table, characters = self._world.table(CameraRig), self._world.table(Character)
        wanted: Places = self._world.transforms.world_poses(targets).position.copy()
        walkers = characters.rows(targets)
        wanted[:, 1] += table.column("height")[rows]
        walks = walkers >= 0
        stature, height = (characters.column(name)[walkers[walks]] for name in ("stature", "height"))
        wanted[walks, 1] -= np.where(stature > 0.0, height - stature, 0.0)
        rate = table.column("follow_rate")[rows] * dt
        share = np.where(rate > 0.0, rate / (1.0 + rate), 1.0)
        eyes = table.column("eye")[rows]
        near = (np.abs(wanted - eyes) <= _JUMP).all(axis=1) & (table.column("reach")[rows] >= 0.0)
        wanted[near, 1] = (eyes[:, 1] + share * (wanted[:, 1] - eyes[:, 1]))[near]
        table.column("eye")[rows] = wanted
        return wanted

    def _behind(self, rows: NDArray[np.int32], targets: Entities, eyes: Places, axes: Places, dt: float) -> Places:
        """(N, 3) where the cameras are."""
        table = self._world.table(CameraRig)
        is_third = table.column("view")[rows] != FIRST
        sideways = np.where(is_third, table.column("shoulder")[rows], 0.0)
        wanted = np.where(is_third, table.column("distance")[rows], 0.0)
        radius = table.column("radius")[rows]
        signs = np.where(sideways < 0.0, -1.0, 1.0)
        aside = np.minimum(
            self._free(targets, eyes, signs[:, None] * axes[:, 1], radius, np.abs(sideways)), np.abs(sideways)
        )
        shoulders = eyes + (signs * aside)[:, None] * axes[:, 1]
        free = self._free(targets, shoulders, -axes[:, 0], radius, wanted)
        reach = table.column("reach")[rows]
        rate = table.column("return_rate")[rows] * dt
        back = np.where(reach < 0.0, wanted, reach + rate / (1.0 + rate) * (wanted - reach))
        reach = np.minimum(np.minimum(free, wanted), np.where(is_third, back, 0.0))
        table.column("reach")[rows] = reach
        return np.asarray(shoulders - reach[:, None] * axes[:, 0])

    def _free(self, targets: Entities, origins: Places, ways: Places, radius: Places, limits: Places) -> Places:
        """(N,) how far balls get from origins along unit vectors, the targets' own bodies aside."""
        asked = np.flatnonzero(limits > 0.0)
        free = limits.copy()
        if len(asked):
            own = np.where(self._physics.has(targets[asked]), targets[asked], 0)
            hits = self._physics.cast_sphere(
                origins[asked], ways[asked], radius[asked], limits[asked] + _CLEAR, own_body=own
            )
            free[asked] = np.minimum(limits[asked], np.maximum(hits.distance - _CLEAR, 0.0))
        return free
