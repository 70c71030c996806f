"""A small real host: it holds a scene, answers commands and tells of changes as a simulation does, without physics."""

from __future__ import annotations

import socket
import time
from typing import Any, Literal

import msgspec
import numpy as np

from elys.bus import topics
from elys.bus.edit_parts import edits_of
from elys.bus.messages import commands as c
from elys.bus.messages import history as h
from elys.bus.messages import scene as s
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.prefab_service import serve_prefabs
from elys.bus.session import Session
from elys.common.components import component_from, values_of
from elys.common.errors import EditConflict, ElysError, EntityError, RequestError
from elys.common.ids import entity_of, generation_of, index_of
from elys.common.math import poses
from elys.common.scene import EntityRecord
from elys.editor_node.scene_mirror import EditorScene
from elys.sim_node.edit_history import EditHistory
from tests.unit.editor_node.inverses import inverse_of


class SceneHost:
    """Applies commands at once, one delta each; `SceneMirror` is the authority."""

    def __init__(self, session: Session, *, epoch: int = 1) -> None:
        self.session = session
        self.mirror = SceneMirror()
        self.mirror.epoch, self.mirror.sequence = epoch, 0
        self.tick = 0
        self.playing = False
        self.rate = 1.0
        self.kind: Literal["simulation", "replay"] = "simulation"
        self.received: list[c.Command] = []
        self.path = ""
        self.history = EditHistory(self)
        self._free: list[int] = []
        self._used = 0
        session.serve(topics.COMMAND, self._take)
        session.serve(topics.SNAPSHOT, self._give_snapshot)
        session.serve(topics.HISTORY, self._give_history)
        serve_prefabs(session, lambda path: any(e.prefab == path for e in self.mirror.entities.values()))
        self.publish_status()

    def load(self, records: list[EntityRecord]) -> tuple[int, ...]:
        changes, entities = self._spawn(c.Spawn(records=tuple(records)))
        self._publish(changes)
        return entities

    def publish_status(self) -> None:
        self.session.publish(
            topics.STATUS,
            SessionStatus(
                epoch=self.mirror.epoch,
                kind=self.kind,
                scene="yard",
                tick=self.tick,
                simulation_time=self.tick / 60.0,
                playing=self.playing,
                tick_rate=60.0,
                rate=self.rate,
                realtime_factor=1.0 if self.playing else 0.0,
                entity_count=len(self.mirror.entities),
            ),
        )

    def publish_frame(self, positions: dict[int, tuple[float, float, float]]) -> None:
        """A state frame that says where these bodies are, unturned and at rest."""
        count = len(positions)
        rotation = np.zeros((count, 4), np.float32)
        rotation[:, 3] = 1.0
        frame = StateFrame(
            epoch=self.mirror.epoch,
            tick=self.tick,
            simulation_time=self.tick / 60.0,
            published_at=time.time_ns(),
            delta_sequence=self.mirror.sequence,
            state_hash=0,
            playing=self.playing,
            position=np.array(list(positions.values()), np.float64).reshape(count, 3),
            rotation=rotation,
            linear_velocity=np.zeros((count, 3), np.float32),
            angular_velocity=np.zeros((count, 3), np.float32),
            entity=np.array(list(positions), np.uint32),
        )
        self.mirror.keep_frame(frame)
        self.session.publish(topics.STATE, frame)

    async def _give_snapshot(self, _: s.SnapshotRequest, __: str) -> s.Snapshot:
        return self.mirror.to_snapshot()

    async def _give_history(self, request: h.HistoryRequest, _: str) -> h.HistoryReply:
        author = self.history.attach(request.person, request.node, alive=self.session.nodes)
        told = self.history.told_to(author)
        return msgspec.structs.replace(told, path=self.path, machine=socket.gethostname())

    async def _take(self, request: c.CommandRequest, _: str) -> c.CommandReply:
        self.received.extend(edits_of(request.command) or (request.command,))
        try:
            entities, new_ids = self._apply(request)
        except ElysError as error:
            is_conflict = isinstance(error, EditConflict)
            return c.CommandReply(accepted=False, tick=self.tick, reason=str(error), is_conflict=is_conflict)
        self._publish([])
        record = c.CommandRecord(tick=self.tick, origin=request.origin, command=request.command, accepted=True)
        self.session.publish(topics.COMMANDS, record)
        return c.CommandReply(
            accepted=True,
            tick=self.tick,
            entities=entities,
            sequence=self.mirror.sequence,
            content=self.history.content,
            new_ids=new_ids,
        )

    def _apply(self, request: c.CommandRequest) -> tuple[tuple[int, ...], dict[int, int]]:
        command = request.command
        match command:
            case c.Undo(force=force):
                done = self.history.undo(request.author, force=force)
            case c.Redo(force=force):
                done = self.history.redo(request.author, force=force)
            case c.NoteSaved(path=path, content=content):
                self.path, self.history.saved = path, content
                return (), {}
            case c.LoadScene():
                self._publish([s.Despawned(entity=root) for root in self.mirror.roots])
                self._publish([s.SettingsSet(settings=command.settings)])
                self.path = command.path
                self.history.forget()
                return self.load(list(command.records)), {}
            case _ if edits_of(command):
                done = self.history.perform(
                    command,
                    author=request.author,
                    writer=request.author or request.origin,
                    label=request.label,
                    stroke=request.stroke,
                    made_from=request.made_from,
                )
            case _:
                self._publish(self._changes(command)[0])
                return (), {}
        return done.entities, done.new_ids

    @property
    def _scene(self) -> EditorScene:
        """The mirror as it is this moment: nothing tells this one of changes."""
        scene = EditorScene(self.session)
        scene.mirror = self.mirror
        return scene

    # As EditHistory edits it

    def apply(self, edits: tuple[c.Edit, ...]) -> tuple[tuple[int, ...], tuple[c.Edit, ...]]:
        made: list[int] = []
        inverses: list[c.Edit] = []
        try:
            for edit in edits:
                back = inverse_of(edit, self._scene)
                changes, entities = self._changes(edit)
                self._publish(changes)
                if isinstance(edit, c.Spawn):
                    tops = [e for e, record in zip(entities, edit.records, strict=True) if record.parent < 0]
                    back = tuple(c.Despawn(entity=entity) for entity in reversed(tops))
                made += entities
                inverses[:0] = back
        except ElysError:
            for edit in inverses:
                self._publish(self._changes(edit)[0])
            raise
        return tuple(made), tuple(inverses)

    def named(self, entity: int) -> str:
        return self._scene.name_of(entity)

    def below(self, entity: int) -> list[int]:
        return self.mirror.descendants(entity) if entity in self.mirror.entities else []

    def edited(self, part: tuple[int, str]) -> None:
        return None

    def recall(self, part: tuple[int, str], memory: None) -> None:
        pass

    def _tell(self, request: c.CommandRequest, *, reason: str = "") -> None:
        record = c.CommandRecord(
            tick=self.tick, origin=request.origin, command=request.command, accepted=not reason, reason=reason
        )
        self.session.publish(topics.COMMANDS, record)

    def _publish(self, changes: list[s.SceneChange]) -> None:
        is_told = self.mirror.revision == self.history.revision and self.mirror.content == self.history.content
        if not changes and is_told:
            return
        delta = s.SceneDelta(
            epoch=self.mirror.epoch,
            sequence=self.mirror.sequence + 1,
            tick=self.tick,
            changes=tuple(changes),
            revision=self.history.revision,
            content=self.history.content,
        )
        self.mirror.apply_delta(delta)
        self.session.publish(topics.DELTA, delta)

    def _changes(self, command: c.Command) -> tuple[list[s.SceneChange], tuple[int, ...]]:
        entity = getattr(command, "entity", 0)
        if entity and entity not in self.mirror.entities:
            raise EntityError(f"there is no entity {entity}")
        match command:
            case c.SetComponent(component=name, values=values):
                return [self._set(entity, name, values)], ()
            case c.AddComponent(component=name, values=values):
                component = component_from(name, values)
                return [s.ComponentSet(entity=entity, component=name, values=values_of(component))], ()
            case c.RemoveComponent(component=name):
                return [s.ComponentRemoved(entity=entity, component=name)], ()
            case c.Spawn():
                return self._spawn(command)
            case c.Despawn():
                self._free += self.mirror.descendants(entity)
                return [s.Despawned(entity=entity)], ()
            case c.Rename(name=name):
                return [s.Renamed(entity=entity, name=name)], ()
            case c.Reparent():
                return self._reparent(command), ()
            case c.SetEnabled(enabled=enabled):
                return [s.EnabledSet(entity=entity, enabled=enabled)], ()
            case c.SetSettings(settings=settings):
                return [s.SettingsSet(settings=settings)], ()
            case c.SetPlaying(playing=playing):
                self.playing = playing
            case c.StepTicks(count=count):
                self.tick += count
            case c.SetRate(rate=rate):
                self.rate = rate
            case c.Grab() | c.Release():
                pass  # nothing moves here
            case _:
                raise RequestError("that is for replays")
        self.publish_status()
        return [], ()

    def _set(self, entity: int, name: str, values: dict[str, Any]) -> s.ComponentSet:
        current = self.mirror.entities[entity].components.get(name)
        if current is None:
            raise EntityError(f"entity {entity} has no {name}")
        changed = component_from(name, values, base=current)
        return s.ComponentSet(entity=entity, component=name, values=values_of(changed))

    def _spawn(self, command: c.Spawn) -> tuple[list[s.SceneChange], tuple[int, ...]]:
        if command.parent and command.parent not in self.mirror.entities:
            raise EntityError(f"there is no entity {command.parent}")
        entities = command.entities  # which come back, if nobody has taken their places
        if not entities or any(index_of(e) in {index_of(other) for other in self.mirror.entities} for e in entities):
            entities = tuple(self._new_id() for _ in command.records)
        self._free = [entity for entity in self._free if index_of(entity) not in set(map(index_of, entities))]
        changes: list[s.SceneChange] = []
        tops = []
        for entity, record in zip(entities, command.records, strict=True):
            parent = entities[record.parent] if record.parent >= 0 else command.parent
            if record.parent < 0:
                tops.append(entity)
            components = {name: values_of(component_from(name, values)) for name, values in record.components.items()}
            for key, target in record.references.items():
                component, _, field = key.partition(".")
                components[component][field] = entities[target]
            changes.append(
                s.Spawned(
                    entity=entity,
                    name=record.name,
                    parent=parent,
                    enabled=record.enabled,
                    components=components,
                    prefab=record.prefab,
                )
            )
        if command.index >= 0:
            changes += [
                s.Reparented(entity=entity, parent=command.parent, index=command.index + offset)
                for offset, entity in enumerate(tops)
            ]
        return changes, entities

    def _reparent(self, command: c.Reparent) -> list[s.SceneChange]:
        if command.parent in self.mirror.descendants(command.entity):
            raise EntityError("an entity cannot come below itself")
        siblings = [e for e in self.mirror.children_of(command.parent) if e != command.entity]
        index = command.index if 0 <= command.index <= len(siblings) else len(siblings)
        changes: list[s.SceneChange] = [s.Reparented(entity=command.entity, parent=command.parent, index=index)]
        if command.keep_world_pose and "Transform" in self.mirror.entities[command.entity].components:
            pose = self.mirror.world_pose(command.entity)
            position, rotation = pose.position, pose.rotation
            if command.parent:
                above = self.mirror.world_pose(command.parent)
                position, rotation = poses.local_pose(*above, position, rotation)
            changes.append(self._set(command.entity, "Transform", {"position": position, "rotation": rotation}))
        return changes

    def _new_id(self) -> int:
        if self._free:
            old = self._free.pop()
            return entity_of(index_of(old), generation_of(old) + 1)
        self._used += 1
        return entity_of(self._used, 0)


def tree_of(mirror: SceneMirror, entity: int = 0) -> list[Any]:
    """The scene below an entity without its ids, for comparing."""
    return [
        (
            e.name,
            e.enabled,
            e.prefab,
            {name: msgspec.structs.asdict(value) for name, value in sorted(e.components.items())},
            tree_of(mirror, e.id),
        )
        for e in (mirror.entities[child] for child in mirror.children_of(entity))
    ]
