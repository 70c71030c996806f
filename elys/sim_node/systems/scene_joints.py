"""Joints follow components: what a Joint says is what physics holds together, as soon as both bodies are there.

The component is the truth. What a joint takes from how its bodies stand when they are first joined is written into it, so that
bodies that are made anew, saved scenes and snapshots are joined as they were.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.components import Joint, declaration_of
from elys.common.errors import PhysicsError
from elys.common.ids import NO_ENTITY, Entity, index_of
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.physics import JOINT_KINDS, BrokenJoint, PhysicsWorld
from elys.sim_node.physics.states import Problem
from elys.sim_node.systems.joint_frames import DISTANCE, Ends, fitted, frames

Values = NDArray[Any]

GEAR: Final = JOINT_KINDS.index("gear")
# What can change without joining anew.
_DRIVE: Final = (
    *("limited", "lower", "upper", "swing_limit"),
    *("spring_frequency", "spring_damping", "spring_rest", "spring_limit"),
    *("motor_speed", "motor_limit", "drive_velocity", "drive_spin", "drive_force", "drive_torque"),
)


class HeldJoint(NamedTuple):
    """A joint as physics has it."""

    kind: str
    own_body: int
    other_body: int  # 0 for the world
    geared: tuple[int, int]  # joints that a gear couples
    build: tuple[Any, ...]  # the fields that only joining anew changes
    drive: tuple[Any, ...]


class SceneJoints:
    """Keeps the joints of physics equal to the components of the world. A joint's id is that of the entity that carries it."""

    def __init__(self, world: World, physics: PhysicsWorld, body_of: Callable[[Entity], int]) -> None:
        """`body_of` gives the body that an entity is, or is part of, 0 where physics has none."""
        self._world = world
        self._physics = physics
        self._body_of = body_of
        self._joints = world.query(Joint, enabled_only=True)
        self._held: dict[int, HeldJoint] = {}
        self._waiting: dict[int, str] = {}  # what is not joined, and why
        self._released: dict[int, float] = {}  # what went with its bodies, and how far it had turned
        self._problems: list[Problem] = []

    def take_problems(self) -> list[Problem]:
        """What could not be joined since this was last asked."""
        problems, self._problems = self._problems, []
        return problems

    @property
    def ends(self) -> set[int]:
        """The bodies that joints hold."""
        return {body for held in self._held.values() for body in (held.own_body, held.other_body)}

    def release(self, bodies: set[int]) -> None:
        """Bodies are about to be taken out of physics, and with them their joints: they are joined again when they come back."""
        gone = [joint for joint, held in self._held.items() if held.own_body in bodies or held.other_body in bodies]
        self._forget(gone)

    def follow(self, touched: set[int] | None) -> None:
        """Makes joints what components say, of the entities touched, or of all with None, and of what waits for a body."""
        present = set(self._joints.entities.tolist())
        gone = [joint for joint in self._held if joint not in present]
        self._remove(gone)
        for joint in [joint for joint in self._waiting if joint not in present]:
            del self._waiting[joint]
        due = present if touched is None else present & (touched | self._waiting.keys() | self._released.keys())
        self._join(sorted(due, key=index_of))
        # A gear on a joint that was made anew went with it.
        self._join(sorted(present & self._released.keys() - self._held.keys(), key=index_of))
        self._released.clear()

    def take_broken(self) -> list[BrokenJoint]:
        """The joints that broke since this was last asked; their components say so from now on."""
        broken = [
            joint
            for joint in self._physics.take_broken_joints()
            if self._world.is_alive(joint.joint) and self._world.has(Entity(joint.joint), Joint)
        ]
        for joint in broken:
            entity = Entity(joint.joint)
            self._world.set(entity, msgspec.structs.replace(self._world.get(entity, Joint), broken=True))
        return broken

    # --- which there shall be ----------------------------------------------------------------------------------------

    def _join(self, entities: Sequence[int]) -> None:
        """Joins, changes or parts what the Joints of entities say."""
        wanted: list[tuple[int, HeldJoint]] = []
        for entity in entities:
            joint = self._world.get(Entity(entity), Joint)
            if joint.broken:
                self._remove([entity])
                self._waiting.pop(entity, None)
                continue
            held = self._described(Entity(entity), joint)
            if isinstance(held, str):
                self._remove([entity])
                self._wait(entity, held)
                continue
            is_fitted = self._fit(Entity(entity), joint)
            if is_fitted:
                now = self._world.get(Entity(entity), Joint)
                held = held._replace(build=_build(now), drive=_drive(now))
            known = self._held.get(entity)
            if known is not None and known._replace(drive=()) == held._replace(drive=()):
                if known.drive != held.drive:
                    self._change(entity, held)
                continue
            self._remove([entity])
            if is_fitted:
                self._released.pop(entity, None)  # the angle begins anew
            wanted.append((entity, held))
        for is_gear in (False, True):  # gears find the joints that they couple
            chosen = [(entity, held) for entity, held in wanted if bool(held.geared[0]) == is_gear]
            if chosen:
                self._add(chosen)

    def _described(self, entity: Entity, joint: Joint) -> HeldJoint | str:
        """What physics shall have, or why it cannot."""
        if joint.kind == "gear":
            for name, geared in (("joint_a", joint.joint_a), ("joint_b", joint.joint_b)):
                if not self._world.is_alive(geared) or not self._world.has(Entity(geared), Joint):
                    return (
                        f"its {name} is no entity with a Joint; choose one with a hinge, slider, distance or cone_twist"
                    )
            return HeldJoint(joint.kind, 0, 0, (joint.joint_a, joint.joint_b), _build(joint), _drive(joint))
        own = self._body_of(entity)
        if not own:
            return "it is part of no body; give it a RigidBody or a Collider, or put it below one that has"
        other = NO_ENTITY
        if joint.other:
            if not self._world.is_alive(joint.other):
                return f"entity {index_of(joint.other)}, which it is to be joined to, is not there any more; choose another"
            other = Entity(self._body_of(Entity(joint.other)))
            if not other:
                whom = self._world.describe(Entity(joint.other))
                return f"{whom} has no body; give it a RigidBody or a Collider, or enable it"
        if own == other:
            return f"both ends are the same body, that of {self._world.describe(other)}; choose another"
        return HeldJoint(joint.kind, own, other, (0, 0), _build(joint), _drive(joint))

    def _fit(self, entity: Entity, joint: Joint) -> bool:
        """Writes into a joint that asks for it what it takes from how the two stand."""
        if not joint.fit or joint.kind == "gear":
            return False
        ends = Ends(self._world, np.array([entity], np.uint32), np.array([joint.other], np.uint32))
        try:
            changes = fitted(joint, ends, 0)
        except np.linalg.LinAlgError:
            changes = {"fit": False}  # squeezed flat: it has no place but its middle
        self._world.set(entity, msgspec.structs.replace(joint, **changes))
        return True

    # --- making them -------------------------------------------------------------------------------------------------

    def _add(self, wanted: Sequence[tuple[int, HeldJoint]]) -> None:
        entities = np.array([entity for entity, _ in wanted], np.uint32)
        description = self._description(entities, [held for _, held in wanted])
        try:
            self._physics.add_joints(entities, **description)
        except PhysicsError as error:
            if len(wanted) == 1:
                self._wait(int(entities[0]), str(error))
                return
            for one in wanted:
                self._add([one])
            return
        for entity, held in wanted:
            self._held[entity] = held
            self._waiting.pop(entity, None)

    def _change(self, entity: int, held: HeldJoint) -> None:
        self._held[entity] = held
        try:
            self._physics.set_joints([entity], **self._drives(np.array([entity], np.uint32)))
        except PhysicsError as error:
            self._tell(entity, f"is joined as before: {error}")

    def _description(self, entities: Entities, held: Sequence[HeldJoint]) -> dict[str, Any]:
        table = self._world.table(Joint)
        rows = table.rows(entities)
        kinds = [JOINT_KINDS[kind] for kind in table.column("kind")[rows].tolist()]
        column = {
            name: table.column(name)[rows] for name in ("frequency", "damping_ratio", "ratio", "collide_connected")
        }
        description = {"kind": kinds, **column, **self._drives(entities)}
        for name in ("break_force", "break_torque"):
            description[name] = _or_endless(table.column(name)[rows])
        if held[0].geared[0]:
            description["joint_a"] = np.array([one.geared[0] for one in held], np.uint32)
            description["joint_b"] = np.array([one.geared[1] for one in held], np.uint32)
            return description
        own = np.array([one.own_body for one in held], np.uint32)
        other = np.array([one.other_body for one in held], np.uint32)
        turned = [self._released.get(entity, 0.0) for entity in entities.tolist()]
        named = table.column("other")[rows]
        return {
            **description,
            "entity_a": other,
            "entity_b": own,
            "turned": turned,
            **frames(self._world, entities, named, own, other),
        }

    def _drives(self, entities: Entities) -> dict[str, Values]:
        """What acts on the coordinates of joints, as physics takes it."""
        table = self._world.table(Joint)
        rows = table.rows(entities)
        limited = table.column("limited")[rows]
        least = np.where(table.column("kind")[rows] == DISTANCE, 0.0, -np.inf)
        same = ("swing_limit", "spring_frequency", "spring_damping", "spring_rest", "motor_speed", "motor_limit")
        velocity = [table.column(name)[rows] for name in ("drive_velocity", "drive_spin")]
        return {
            **{name: table.column(name)[rows].astype(np.float64) for name in (*same, "drive_force", "drive_torque")},
            "lower": np.where(limited, table.column("lower")[rows], least),
            "upper": np.where(limited, table.column("upper")[rows], np.inf),
            "spring_limit": _or_endless(table.column("spring_limit")[rows]),
            "drive_velocity": np.concatenate(velocity, axis=1),
        }

    # --- taking them away --------------------------------------------------------------------------------------------

    def _remove(self, joints: Iterable[int]) -> None:
        """Takes those of the joints out of physics that are there."""
        leaving = [joint for joint in joints if joint in self._held]
        if leaving:
            self._forget(leaving)
            self._physics.remove_joints(np.array(leaving, np.uint32))

    def _forget(self, joints: Sequence[int]) -> None:
        """Joints are about to leave physics, and with them the gears that couple them."""
        if not joints:
            return
        leaving = set(joints)
        leaving |= {gear for gear, held in self._held.items() if not leaving.isdisjoint(held.geared)}
        states = self._physics.joints
        coordinate = dict(zip(states.joint.tolist(), states.coordinate.tolist(), strict=True))
        for joint in sorted(leaving):
            turns = self._held.pop(joint).kind in ("hinge", "cone_twist")
            self._released[joint] = coordinate[joint] if turns else 0.0

    def _wait(self, entity: int, why: str) -> None:
        """Tells why an entity's joint is not there, once for each reason."""
        if self._waiting.get(entity) != why:
            self._tell(entity, f"joins nothing: {why}")
        self._waiting[entity] = why

    def _tell(self, entity: int, what: str) -> None:
        self._problems.append(Problem(entity, f"{self._world.describe(Entity(entity))} {what}"))


def _build(joint: Joint) -> tuple[Any, ...]:
    return tuple(getattr(joint, field.name) for field in declaration_of(Joint).fields if field.name not in _DRIVE)


def _drive(joint: Joint) -> tuple[Any, ...]:
    return tuple(getattr(joint, name) for name in _DRIVE)


def _or_endless(column: Values) -> Values:
    """In a component 0 stands for no bound."""
    return np.where(column > 0.0, column.astype(np.float64), np.inf)
