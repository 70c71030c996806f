"""The scene as the bus last told of it: what viewers, editors and recordings read instead of a world of their own.

    Snapshot ──apply_snapshot──▶ ┌────────┐ ──to_snapshot──▶ Snapshot (for who joins a replay)
    SceneDelta ──apply_delta───▶ │ mirror │ ──listeners────▶ MirrorUpdate: what changed, for incremental readers
    StateFrame ──keep_frame────▶ └────────┘ ──world_pose───▶ where an entity is now

State frames are kept as they are and looked up; they are not written into components 60 times a second.
`elys.bus.following` keeps a mirror up to date over a session.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import msgspec
import numpy as np

from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    SceneChange,
    SceneDelta,
    SettingsSet,
    Snapshot,
    Spawned,
)
from elys.bus.messages.state_frame import StateFrame
from elys.bus.snapshot_columns import check_tree, decode_components, encode_components, is_known
from elys.bus.transports.transport import Closer
from elys.common.components import Component, Quat, Transform, Vec3, component_from
from elys.common.components.columns import StringTable
from elys.common.errors import ComponentError, MessageError
from elys.common.math import poses
from elys.common.scene import SceneSettings

_IDENTITY = Transform()


@dataclass(slots=True, kw_only=True)
class MirrorEntity:
    """One entity as the bus last told of it. `children` are ids in order; `parent` is 0 for a root."""

    id: int
    name: str
    parent: int
    enabled: bool
    prefab: str
    children: list[int] = field(default_factory=list)
    components: dict[str, Component] = field(default_factory=dict)
    pose_sequence: int = 0  # the last delta that said where it stands: older state frames do not know of it


@dataclass(frozen=True, slots=True, kw_only=True)
class MirrorUpdate:
    """What a listener hears after the mirror changed: everything anew (`reset`), or these changes in order.

    `removed` are the ids that are gone, those below a despawned entity included.
    """

    reset: bool
    changes: tuple[SceneChange, ...] = ()
    removed: tuple[int, ...] = ()


class WorldPose(NamedTuple):
    """Where an entity is in the world: position [m], rotation x y z w, scale along its own axes."""

    position: Vec3
    rotation: Quat
    scale: Vec3


class SceneMirror:
    """Entities by id, roots in order, settings, and which delta (`epoch`, `sequence`) it has come to."""

    def __init__(self) -> None:
        self.entities: dict[int, MirrorEntity] = {}
        self.roots: list[int] = []
        self.settings = SceneSettings()
        self.scene = ""
        self.epoch = 0
        self.sequence = -1
        self.revision = 0  # how many edits it contains
        self.content = 0  # what names all that was edited; the same number, the same content
        self.tick = 0
        self.simulation_time = 0.0
        self.latest_frame: StateFrame | None = None
        self._listeners: list[Callable[[MirrorUpdate], None]] = []
        self._rows: dict[int, int] = {}  # entity -> row of the latest frame; made when first asked for
        self._rows_of: bytes | None = None

    def listen(self, listener: Callable[[MirrorUpdate], None]) -> Closer:
        """Calls `listener` after every change; the returned function ends it."""
        self._listeners.append(listener)

        def close() -> None:
            if listener in self._listeners:
                self._listeners.remove(listener)

        return close

    # --- reading ---------------------------------------------------------------------------------------------------

    def children_of(self, parent: int) -> list[int]:
        """The ids below `parent` in order; 0 for the roots."""
        return self.roots if parent == 0 else self.entities[parent].children

    def world_enabled(self, entity: int) -> bool:
        """Whether the entity and all above it are switched on."""
        while entity:
            here = self.entities[entity]
            if not here.enabled:
                return False
            entity = here.parent
        return True

    def descendants(self, entity: int) -> list[int]:
        """The entity and all below it, parents before children."""
        found = [entity]
        for current in found:
            found.extend(self.entities[current].children)
        return found

    def in_order(self) -> list[MirrorEntity]:
        """All entities, parents before children and siblings in order."""
        found, waiting = [], list(reversed(self.roots))
        while waiting:
            entity = self.entities[waiting.pop()]
            found.append(entity)
            waiting.extend(reversed(entity.children))
        return found

    def world_pose(self, entity: int) -> WorldPose:
        """Where the entity is: a body where the latest state frame says, anything else where its local transforms put it."""
        chain = [entity]
        while self.entities[chain[-1]].parent:
            chain.append(self.entities[chain[-1]].parent)
        position: Vec3 = (0.0, 0.0, 0.0)
        rotation: Quat = (0.0, 0.0, 0.0, 1.0)
        scale: Vec3 = (1.0, 1.0, 1.0)
        for current in reversed(chain):
            local = self.local_pose(current)
            row = self.frame_row(current)
            if row >= 0 and (frame := self.latest_frame) is not None:
                position, rotation = tuple(frame.position[row].tolist()), tuple(frame.rotation[row].tolist())
            else:
                position, rotation = poses.compose(position, rotation, scale, local.position, local.rotation)
            scale = poses.stretch(scale, local.scale)
        return WorldPose(position, rotation, scale)

    def local_pose(self, entity: int) -> Transform:
        """Where the entity is relative to its parent: what is animated as the latest state frame says."""
        local = self.entities[entity].components.get("Transform", _IDENTITY)
        assert isinstance(local, Transform)
        frame = self.latest_frame
        if frame is None or not len(frame.local_entity) or frame.epoch != self.epoch:
            return local
        rows = np.flatnonzero(frame.local_entity == entity)
        if not len(rows) or frame.delta_sequence < self.entities[entity].pose_sequence:
            return local
        columns = (frame.local_position, frame.local_rotation, frame.local_scale)
        position, rotation, scale = (tuple(column[rows[0]].tolist()) for column in columns)
        return Transform(position=position, rotation=rotation, scale=scale)

    def frame_row(self, entity: int) -> int:
        """The row of the latest frame that says where a body is; -1 if none does, or the body was moved since."""
        frame = self.latest_frame
        if frame is None or frame.epoch != self.epoch:
            return -1
        if self._rows_of is None:
            self._rows = {body: row for row, body in enumerate(frame.entity.tolist())}
            self._rows_of = frame.entity.tobytes()
        row = self._rows.get(entity, -1)
        if row >= 0 and frame.delta_sequence < self.entities[entity].pose_sequence:
            return -1
        return row

    # --- being told ------------------------------------------------------------------------------------------------

    def keep_frame(self, frame: StateFrame) -> None:
        """Takes the newest state frame."""
        if self._rows_of is not None and frame.entity.tobytes() != self._rows_of:
            self._rows_of = None
        self.latest_frame = frame

    def apply_snapshot(self, snapshot: Snapshot) -> None:
        """Becomes what the snapshot says.

        Raises:
            MessageError: it contradicts itself or a component's declaration; the mirror is as it was.
        """
        ids, parents, switches = check_tree(snapshot)
        components = decode_components(snapshot)
        entities = {
            entity: MirrorEntity(
                id=entity, name=name, parent=parent, enabled=enabled, prefab=prefab, pose_sequence=snapshot.sequence
            )
            for entity, name, parent, enabled, prefab in zip(
                ids, snapshot.names, parents, switches, snapshot.prefabs, strict=True
            )
        }
        for name, owners, values in components:
            for owner, value in zip(owners, values, strict=True):
                if owner not in entities:
                    raise MessageError(f"this snapshot gives a {name} to entity {owner}, which is not in it")
                entities[owner].components[name] = value
        roots: list[int] = []
        for entity, parent in zip(ids, parents, strict=True):
            (entities[parent].children if parent else roots).append(entity)
        self.entities, self.roots = entities, roots
        self.settings, self.scene = snapshot.settings, snapshot.scene
        self.epoch, self.sequence = snapshot.epoch, snapshot.sequence
        self.revision, self.content = snapshot.revision, snapshot.content
        self.tick, self.simulation_time = snapshot.tick, snapshot.simulation_time
        self._tell(MirrorUpdate(reset=True))

    def apply_delta(self, delta: SceneDelta) -> None:
        """Follows the next delta.

        Raises:
            MessageError: it is not the next one, asks for a resync, or speaks of what is not there. Take a new snapshot then:
                changes before the faulty one have been followed.
        """
        if delta.epoch != self.epoch or delta.sequence != self.sequence + 1 or delta.resync:
            raise MessageError(
                f"delta {delta.sequence} of run {delta.epoch} does not follow {self.sequence} of run {self.epoch}"
            )
        removed: list[int] = []
        for change in delta.changes:
            self._follow(change, delta.sequence, removed)
        self.sequence, self.tick = delta.sequence, delta.tick
        self.revision, self.content = delta.revision, delta.content
        self._tell(MirrorUpdate(reset=False, changes=delta.changes, removed=tuple(removed)))

    def to_snapshot(self, *, frame: StateFrame | None = None) -> Snapshot:
        """The inverse of `apply_snapshot`; with a frame, its bodies stand and move as it says."""
        if frame is not None:
            return _placed(self, frame).to_snapshot()
        ordered = self.in_order()
        values: dict[str, tuple[list[int], list[Component]]] = {}
        for entity in ordered:
            for name, component in entity.components.items():
                owners, owned = values.setdefault(name, ([], []))
                owners.append(entity.id)
                owned.append(component)
        strings = StringTable()
        components = encode_components(values, strings)
        return Snapshot(
            epoch=self.epoch,
            tick=self.tick,
            simulation_time=self.simulation_time,
            sequence=self.sequence,
            scene=self.scene,
            settings=self.settings,
            entities=np.array([entity.id for entity in ordered], "<u4").tobytes(),
            parents=np.array([entity.parent for entity in ordered], "<u4").tobytes(),
            enabled=bytes(entity.enabled for entity in ordered),
            names=tuple(entity.name for entity in ordered),
            prefabs=tuple(entity.prefab for entity in ordered),
            strings=strings.texts,
            components=components,
            revision=self.revision,
            content=self.content,
        )

    # --- inside ----------------------------------------------------------------------------------------------------

    def _tell(self, update: MirrorUpdate) -> None:
        for listener in tuple(self._listeners):
            listener(update)

    def _follow(self, change: SceneChange, sequence: int, removed: list[int]) -> None:
        match change:
            case Spawned():
                self._spawn(change, sequence)
            case Despawned():
                gone = self.descendants(self._entity(change.entity).id)
                siblings = self.children_of(self.entities[change.entity].parent)
                if (
                    siblings[-1] == change.entity
                ):  # many are ended from the last on: looked for, each would cost all others
                    siblings.pop()
                else:
                    siblings.remove(change.entity)
                for entity in gone:
                    del self.entities[entity]
                removed.extend(gone)
            case ComponentSet():
                owner = self._entity(change.entity)
                if is_known(change.component):
                    owner.components[change.component] = _component(change.component, change.values)
                if change.component == "Transform":
                    owner.pose_sequence = sequence
            case ComponentRemoved():
                self._entity(change.entity).components.pop(change.component, None)
            case Renamed():
                self._entity(change.entity).name = change.name
            case Reparented():
                self._reparent(change, sequence)
            case EnabledSet():
                self._entity(change.entity).enabled = change.enabled
            case SettingsSet():
                self.settings = change.settings

    def _spawn(self, change: Spawned, sequence: int) -> None:
        if change.entity in self.entities or change.entity == 0:
            raise MessageError(f"entity {change.entity} is spawned while it is there")
        siblings = self.roots if change.parent == 0 else self._entity(change.parent).children
        entity = MirrorEntity(
            id=change.entity,
            name=change.name,
            parent=change.parent,
            enabled=change.enabled,
            prefab=change.prefab,
            pose_sequence=sequence,
        )
        for name, values in change.components.items():
            if is_known(name):
                entity.components[name] = _component(name, values)
        self.entities[change.entity] = entity
        siblings.append(change.entity)

    def _reparent(self, change: Reparented, sequence: int) -> None:
        entity = self._entity(change.entity)
        ancestor = change.parent
        while ancestor:
            if ancestor == change.entity:
                raise MessageError(f"entity {change.entity} is put below itself")
            ancestor = self._entity(ancestor).parent
        self.children_of(entity.parent).remove(change.entity)
        siblings = self.children_of(change.parent)
        siblings.insert(change.index if 0 <= change.index <= len(siblings) else len(siblings), change.entity)
        entity.parent = change.parent
        entity.pose_sequence = sequence

    def _entity(self, entity: int) -> MirrorEntity:
        try:
            return self.entities[entity]
        except KeyError:
            raise MessageError(f"there is no entity {entity} to change") from None


def _placed(mirror: SceneMirror, frame: StateFrame) -> SceneMirror:
    """A copy of the mirror whose bodies' Transform and RigidBody say what the frame says."""
    placed = copy.copy(mirror)
    placed.keep_frame(frame)
    placed.entities = dict(mirror.entities)
    placed.tick, placed.simulation_time = frame.tick, frame.simulation_time
    rotations, linear, angular = (
        column.tolist() for column in (frame.rotation, frame.linear_velocity, frame.angular_velocity)
    )
    for row, (body, position) in enumerate(zip(frame.entity.tolist(), frame.position.tolist(), strict=True)):
        if body not in mirror.entities or placed.frame_row(body) != row:
            continue
        entity = copy.copy(mirror.entities[body])
        components = dict(entity.components)
        entity.components = components
        placed.entities[body] = entity
        pose: tuple[Vec3, Quat] = tuple(position), tuple(rotations[row])
        if entity.parent:
            pose = poses.local_pose(*placed.world_pose(entity.parent), *pose)
        before = components.get("Transform", Transform())
        components["Transform"] = msgspec.structs.replace(before, position=pose[0], rotation=pose[1])
        if "RigidBody" in components:
            components["RigidBody"] = msgspec.structs.replace(
                components["RigidBody"], linear_velocity=tuple(linear[row]), angular_velocity=tuple(angular[row])
            )
    return placed


def _component(name: str, values: dict[str, object]) -> Component:
    try:
        return component_from(name, values)
    except ComponentError as error:
        raise MessageError(f"this delta is wrong: {error}") from error
