"""Characters in a world: their bodies follow their sheets, and in each tick a kernel moves all of them at once.

A character's place is decided before the step of physics: where it gets to in the world as that will be at the tick's end,
kinematic bodies moved on. Its body is given the velocity that brings it there, so physics sees a kinematic capsule like any
other, which pushes what it meets, sets off triggers and is told in frames. All that a character remembers is in its component.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Character, Collider, RigidBody, Transform
from elys.common.ids import Entity
from elys.sim_node.character.kernels import foresee_bodies, move_characters
from elys.sim_node.character.kernels.tables import HIT, MOST_PLANES, PLANE, PUSH, Surroundings
from elys.sim_node.character.rows import Rows, capsule_of, read_rows, write_rows
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.physics.capsules import KinematicCapsules
from elys.sim_node.physics.kernels.cast import TOUCH
from elys.sim_node.physics.kernels.tables import Table
from elys.sim_node.physics.states import Problem
from elys.sim_node.physics.world import PhysicsWorld

_PUSHES: Final = 8  # on loose bodies, for each character and tick


class Characters:
    """Who walks in a world."""

    def __init__(self, world: World, physics: PhysicsWorld) -> None:
        self._world = world
        self._physics = physics
        self._capsules = KinematicCapsules(physics)
        self._query = world.query(Character, enabled_only=True)
        self._seen = -1
        self._problems: list[Problem] = []
        self._told: set[tuple[int, str]] = set()

    @property
    def is_needed(self) -> bool:
        """Whether there is any."""
        return len(self._query) > 0

    def take_problems(self) -> list[Problem]:
        """What characters could not be moved since this was last asked, and why."""
        problems, self._problems = self._problems, []
        return problems

    # --- their bodies

    def complete(self) -> None:
        """Gives characters the kinematic bodies and capsules that they lack, or that do not fit their sheets any more."""
        if not self.is_needed:
            return
        if self._query.version == self._seen and not self._misfits():
            return
        self._seen = self._query.version
        for entity in self._query.entities.tolist():
            self._complete(Entity(entity))

    def _misfits(self) -> bool:
        """Whether a capsule is not as its character's sheet says."""
        entities = self._query.entities
        table, colliders = self._world.table(Character), self._world.table(Collider)
        rows, shapes = table.rows(entities), colliders.rows(entities)
        if (shapes < 0).any():
            return True
        height = table.column("height")[rows]
        radius = np.minimum(table.column("radius")[rows], 0.5 * height)
        stature = table.column("stature")[rows]
        half = np.maximum(0.5 * np.where(stature > 0.0, stature, height) - radius, 1e-4)
        found = colliders.column("radius")[shapes], colliders.column("half_length")[shapes]
        return bool((found[0] != radius.astype(np.float32)).any() or (found[1] != half.astype(np.float32)).any())

    def _complete(self, entity: Entity) -> None:
        world = self._world
        if not world.has(entity, Transform):
            world.add(entity, Transform())
        elif any(abs(factor - 1.0) > 1e-6 for factor in world.get(entity, Transform).scale):
            self._tell(
                entity,
                "is stretched, and its sheet is in metres: make its scale 1, and that of what stands below it another",
            )
        if not world.has(entity, RigidBody):
            world.add(entity, RigidBody(motion="kinematic"))
        character = world.get(entity, Character)
        if 0.0 < character.stature != character.height and character.stature > character.height:
            world.table(Character).column("stature")[world.table(Character).rows(np.array([entity], np.uint32))] = 0.0
            character = world.get(entity, Character)
        radius, half = capsule_of(character)
        size = {"shape": "capsule", "radius": radius, "half_length": half, "offset": (0.0, radius + half, 0.0)}
        if not world.has(entity, Collider):
            world.add(entity, Collider(friction=0.0, **size))  # type: ignore[arg-type]
            return
        present = world.get(entity, Collider)
        if not _equal(present, size):
            world.set_fields(entity, Collider, size)

    # --- a tick

    def move(self, dt: float) -> None:
        """Has the next step of physics, which takes `dt` [s], move all characters as they wish."""
        entities, bodies, colliders = self._movable()
        if not len(entities):
            return
        table = self._world.table(Character)
        rows = table.rows(entities)
        characters = read_rows(table, rows, -self._physics.settings.gravity[1])
        characters["entity"], characters["body"], characters["collider"] = entities, bodies, colliders
        feet = self._capsules.feet(bodies)
        characters["position"] = feet
        grounds = table.column("ground")[rows]
        characters["ground"] = self._capsules.body_rows(grounds)
        statures = characters["stature"].copy()
        pushes = self._sweep(characters, dt)
        self._capsules.drive(bodies, (characters["position"] - feet) / dt, characters["rotation"])
        body_entities = self._physics.bodies.entity
        stood_on = np.where(characters["ground"] >= 0, body_entities[np.maximum(characters["ground"], 0)], 0)
        write_rows(table, rows, characters, stood_on.astype(np.uint32))
        if len(pushes):
            self._physics.apply_force(body_entities[pushes["body"]], pushes["force"], pushes["point"])
        changed = np.flatnonzero(statures != characters["stature"])
        if len(changed):
            self._resize(entities[changed], bodies[changed], colliders[changed], characters[changed])

    def _movable(self) -> tuple[Entities, NDArray[np.int64], NDArray[np.int64]]:
        """The characters that have the body of one, with the rows of bodies and capsules."""
        entities = self._query.entities
        bodies, colliders = self._capsules.rows_of(entities)
        here = bodies >= 0
        for entity in entities[~here].tolist():
            self._tell(
                entity,
                "does not walk: its RigidBody must be kinematic and its Collider a capsule; take both away, and they come anew",
            )
        return entities[here], bodies[here], colliders[here]

    def _sweep(self, characters: Rows, dt: float) -> Table:
        """Moves the rows in place; the pushes on loose bodies."""
        tables = self._capsules.opened()
        is_character = np.zeros(len(tables.bodies), np.uint8)
        is_character[characters["body"]] = 1
        moved = np.zeros(len(tables.colliders) + len(characters), np.int32)
        count = foresee_bodies(tables.bodies, tables.colliders, is_character, characters, dt, moved)
        self._capsules.follow_boxes()
        around = Surroundings(
            *tables,
            is_character,
            np.zeros(len(tables.colliders), np.int32),
            np.zeros(MOST_PLANES, PLANE),
            np.zeros(3, HIT),
            np.zeros(1, TOUCH),
            np.zeros(_PUSHES * len(characters), PUSH),
        )
        pushed = move_characters(around, characters, dt)
        self._capsules.put_back(moved[:count])
        return around.pushes[:pushed]

    def _resize(self, entities: Entities, bodies: NDArray[np.int64], colliders: NDArray[np.int64], now: Rows) -> None:
        """Who crouches or stands up has another capsule; the component says so too."""
        half = np.maximum(0.5 * now["stature"] - now["radius"], 1e-4)
        self._capsules.resize(bodies, colliders, half)
        table = self._world.table(Collider)
        rows = table.rows(entities)
        table.column("half_length")[rows] = half
        table.column("offset")[rows, 1] = half + now["radius"]

    def _tell(self, entity: int, what: str) -> None:
        if (entity, what) not in self._told:
            self._told.add((entity, what))
            self._problems.append(Problem(entity, f"{self._world.describe(Entity(entity))} {what}"))


def _equal(present: Collider, size: dict[str, object]) -> bool:
    """Whether a capsule has that size, as precisely as columns keep it."""
    radius, half, offset = size["radius"], size["half_length"], size["offset"]
    assert isinstance(radius, float) and isinstance(half, float) and isinstance(offset, tuple)
    return present.shape == "capsule" and all(
        math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-9)
        for a, b in zip((present.radius, present.half_length, *present.offset), (radius, half, *offset), strict=True)
    )
