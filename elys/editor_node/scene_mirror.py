"""What the bus last said of the scene, as the panels read it: live poses of bodies, the tree flattened to rows, search.

A thin layer over `elys.bus.mirror.SceneMirror`. Nothing here is ever changed by the editor itself.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.scene import ComponentRemoved, ComponentSet, SettingsSet
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorEntity, MirrorUpdate, SceneMirror, WorldPose
from elys.bus.session import Session
from elys.common.assets.primitives import PRIMITIVES
from elys.common.components import Collider, Component, MeshRenderer, RigidBody, Transform
from elys.common.math import matrix
from elys.common.math.poses import local_pose
from elys.common.scene import SceneSettings

OPEN_AT_FIRST: Final = 64  # a root with at most so many children shows them
_GAP: Final = 0.005  # [m] between a new body and what it is put on
_VALUE_CHANGES: Final = (ComponentSet, ComponentRemoved, SettingsSet)
# Radius of the ball around a mesh that is not scaled [m]; imported ones are taken as a metre large.
_MESH_RADIUS: Final[Mapping[str, float]] = {"box": math.sqrt(3.0) / 2.0, "sphere": 0.5, "cylinder": math.sqrt(0.5)}


class Row(NamedTuple):
    """A line of the tree that is to be seen."""

    entity: int
    depth: int
    has_children: bool
    is_open: bool


class _Place(NamedTuple):
    """Where an entity stands: in the whole tree from the top down, and among its siblings."""

    order: int
    sibling_index: int


@dataclass(slots=True)
class _Rows:
    """Rows and what they were made from."""

    key: tuple[Any, ...]
    rows: list[Row]


class EditorScene:
    """The mirror of one session. `follow` must be running for it to change."""

    def __init__(
        self,
        session: Session,
        *,
        on_change: Callable[[], None] = lambda: None,
        on_state: Callable[[], None] = lambda: None,
    ) -> None:
        self.mirror = SceneMirror()
        self.structure_version = 0  # rises when the tree, a name or a switch changes
        self.version = 0  # rises with everything that is heard of the scene, state frames as well
        self.is_known = False  # whether there was a snapshot yet
        self._session = session
        self._on_change = on_change
        self._on_state = on_state
        self._changed = asyncio.Event()
        self._opened: dict[int, bool] = {}  # what the person opened or closed
        self._opened_version = 0
        self._rows = _Rows((), [])
        self._place_of: dict[int, _Place] = {}
        self._places_version = -1

    async def follow(self) -> None:
        """Follows the host's scene until cancelled."""
        stop_state = follow_state(self._session, self.mirror, self._frame_kept)
        stop_scene = await follow_scene(self._session, self.mirror, self._updated)
        try:
            await asyncio.Event().wait()
        finally:
            stop_scene()
            stop_state()

    async def wait_for_change(self) -> None:
        """Returns after the next change of the scene."""
        await self._changed.wait()

    # --- reading ---------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> SceneSettings:
        """What holds for the whole scene."""
        return self.mirror.settings

    @property
    def frame(self) -> StateFrame | None:
        """The newest state frame."""
        return self.mirror.latest_frame

    def exists(self, entity: int) -> bool:
        """Whether the entity lives."""
        return entity in self.mirror.entities

    def name_of(self, entity: int) -> str:
        """Its name; the id where it has none or is gone."""
        found = self.mirror.entities.get(entity)
        return found.name if found is not None else f"#{entity}"

    def parent_of(self, entity: int) -> int:
        """0 for a root."""
        return self.mirror.entities[entity].parent

    def children_of(self, entity: int) -> Sequence[int]:
        """In order; 0 for the roots."""
        return self.mirror.children_of(entity)

    def place_of(self, entity: int) -> tuple[int, int]:
        """Its parent and its index among that one's children."""
        return self.parent_of(entity), self._places()[entity].sibling_index

    def order_of(self, entity: int) -> int:
        """Sorts entities as the tree shows them, from the top down."""
        return self._places()[entity].order

    def ancestors_of(self, entity: int) -> Iterator[int]:
        """Those above it, nearest first."""
        while entity and (entity := self.parent_of(entity)):
            yield entity

    def path_of(self, entity: int) -> tuple[str, ...]:
        """Its name and those above it, from the top down."""
        return tuple(self.name_of(above) for above in (entity, *self.ancestors_of(entity)))[::-1]

    def found_paths(self, paths: Sequence[tuple[str, ...]]) -> list[int]:
        """The first entities that are called so from the top down, for each path that leads to one."""
        names_below: dict[int, dict[str, int]] = {}  # of those that are looked into: there may be thousands of paths

        def below(parent: int) -> dict[str, int]:
            if parent not in names_below:
                # Backwards, so that of several of one name the first stays.
                names_below[parent] = {self.name_of(child): child for child in reversed(self.children_of(parent))}
            return names_below[parent]

        found: list[int] = []
        for path in paths:
            entity = 0
            for name in path:
                entity = below(entity).get(name, 0)
                if not entity:
                    break
            else:
                found.append(entity)
        return found

    def is_enabled(self, entity: int) -> bool:
        """Its own switch."""
        return self.mirror.entities[entity].enabled

    def is_world_enabled(self, entity: int) -> bool:
        """Its own switch and all above."""
        return self.mirror.world_enabled(entity)

    def prefab_of(self, entity: int) -> str:
        """Where an instance's root came from; empty for others."""
        return self.mirror.entities[entity].prefab

    def echo_of(self, entity: int, component: str) -> Component | None:
        """A component as a delta or the snapshot last told of it: another object after every echo."""
        found = self.mirror.entities.get(entity)
        return found.components.get(component) if found is not None else None

    def component_of(self, entity: int, component: str) -> Component | None:
        """A component as it is now: of a body that moves, where the newest state frame says."""
        value = self.echo_of(entity, component)
        if isinstance(value, Transform | RigidBody) and (row := self.mirror.frame_row(entity)) >= 0:
            return self._live(entity, value, row)
        return value

    def components_of(self, entity: int) -> dict[str, Component]:
        """All its components as they are now."""
        components = dict(self.mirror.entities[entity].components)
        if (row := self.mirror.frame_row(entity)) >= 0:
            for name, value in components.items():
                if isinstance(value, Transform | RigidBody):
                    components[name] = self._live(entity, value, row)
        return components

    def world_pose(self, entity: int) -> WorldPose:
        """Where it is now."""
        return self.mirror.world_pose(entity)

    def world_from_local(self, entity: int) -> NDArray[np.float64]:
        """(3, 4)."""
        return np.asarray(matrix.compose_affine(*map(np.array, self.world_pose(entity))), dtype=np.float64)

    def ball_of(self, entity: int) -> tuple[NDArray[np.float64], float]:
        """Centre [m] and radius [m] of a ball around what an entity shows or collides with."""
        pose = self.world_pose(entity)
        stretch = max(abs(factor) for factor in pose.scale)
        radius = 0.35
        renderer, collider = self.echo_of(entity, "MeshRenderer"), self.echo_of(entity, "Collider")
        if isinstance(renderer, MeshRenderer):
            x, y, z = pose.scale
            is_box = renderer.mesh == "box"
            radius = math.hypot(x, y, z) / 2.0 if is_box else _MESH_RADIUS.get(renderer.mesh, 0.7) * stretch
        if isinstance(collider, Collider):
            reach = collider.radius if collider.shape == "sphere" else math.hypot(*collider.size) / 2.0
            radius = max(radius, reach * stretch)
        return np.array(pose.position), radius

    def has_extent(self, entity: int) -> bool:
        """Whether it shows or collides with anything."""
        return self.echo_of(entity, "MeshRenderer") is not None or self.echo_of(entity, "Collider") is not None

    def free_height(self, x: float, y: float, z: float, half: float) -> float:
        """The lowest height [m] from `y` on at which a cube of half edge `half` [m] is in nothing, and not below y = 0.

        Boxes along the axes stand for what is there; imported meshes count as the ball around them.
        """
        y = max(y, half)
        boxes = [self._box_of(entity) for entity in self.mirror.entities if self.has_extent(entity)]
        over = [(low[1], high[1]) for low, high in boxes if low[0] < x + half and high[0] > x - half
                and low[2] < z + half and high[2] > z - half]  # fmt: skip
        # From the lowest up: once above one, nothing that was passed can be in the way again.
        for low, high in sorted(over):
            if low < y + half and high > y - half:
                y = high + half + _GAP
        return y

    def _box_of(self, entity: int) -> tuple[list[float], list[float]]:
        """The corners [m] of a box along the world's axes around what an entity shows and collides with."""
        affine = self.world_from_local(entity)
        center, half = affine[:, 3], np.zeros(3)
        renderer, collider = self.echo_of(entity, "MeshRenderer"), self.echo_of(entity, "Collider")
        if isinstance(renderer, MeshRenderer):
            is_built_in = renderer.mesh in PRIMITIVES
            half = np.abs(affine[:, :3]) @ np.full(3, 0.5) if is_built_in else np.full(3, self.ball_of(entity)[1])
        low, high = center - half, center + half
        if isinstance(collider, Collider):
            size = np.full(3, 2.0 * collider.radius) if collider.shape == "sphere" else np.array(collider.size)
            reach, place = np.abs(affine[:, :3]) @ size / 2.0, affine[:, :3] @ np.array(collider.offset) + center
            low, high = np.minimum(low, place - reach), np.maximum(high, place + reach)
        return low.tolist(), high.tolist()

    def _places(self) -> dict[int, _Place]:
        if self._places_version != self.structure_version:
            self._places_version = self.structure_version
            self._place_of = {}
            waiting = list(enumerate(self.mirror.roots))[::-1]
            while waiting:
                index, entity = waiting.pop()
                self._place_of[entity] = _Place(len(self._place_of), index)
                waiting.extend(list(enumerate(self.children_of(entity)))[::-1])
        return self._place_of

    # --- the tree as rows ------------------------------------------------------------------------------------------

    def set_open(self, entity: int, is_open: bool) -> None:
        """Shows or hides what is below an entity."""
        self._opened[entity] = is_open
        self._opened_version += 1

    def reveal(self, entity: int) -> None:
        """Opens all above an entity."""
        for ancestor in self.ancestors_of(entity):
            if not self._is_open(ancestor):
                self.set_open(ancestor, True)

    def rows(self, search: str = "") -> list[Row]:
        """The lines to be seen, from the top down. With `search` those whose name holds it and all above them;
        "has:Light" finds those with a Light."""
        key = (self.structure_version, self._opened_version, search)
        if self._rows.key != key:
            self._rows = _Rows(key, self._found_rows(search) if search else self._open_rows())
        return self._rows.rows

    def _open_rows(self) -> list[Row]:
        rows: list[Row] = []
        entities = self.mirror.entities
        waiting = [(entity, 0) for entity in reversed(self.mirror.roots)]
        while waiting:
            entity, depth = waiting.pop()
            children = entities[entity].children
            is_open = bool(children) and self._is_open(entity)
            rows.append(Row(entity, depth, bool(children), is_open))
            if is_open:
                waiting.extend((child, depth + 1) for child in reversed(children))
        return rows

    def _found_rows(self, search: str) -> list[Row]:
        shown: set[int] = set()
        for entity in self._found(search):
            while entity and entity not in shown:
                shown.add(entity)
                entity = self.parent_of(entity)
        rows: list[Row] = []
        waiting = [(entity, 0) for entity in reversed(self.mirror.roots) if entity in shown]
        while waiting:
            entity, depth = waiting.pop()
            children = [child for child in self.children_of(entity) if child in shown]
            rows.append(Row(entity, depth, bool(children), bool(children)))
            waiting.extend((child, depth + 1) for child in reversed(children))
        return rows

    def _found(self, search: str) -> list[int]:
        wanted = search.casefold().strip()
        entities: Mapping[int, MirrorEntity] = self.mirror.entities
        if wanted.startswith("has:"):
            part = wanted.removeprefix("has:")
            return [i for i, e in entities.items() if any(part in name.casefold() for name in e.components)]
        return [i for i, e in entities.items() if wanted in e.name.casefold()]

    def _is_open(self, entity: int) -> bool:
        opened = self._opened.get(entity)
        if opened is None:
            found = self.mirror.entities[entity]
            return found.parent == 0 and len(found.children) <= OPEN_AT_FIRST
        return opened

    # --- being told ------------------------------------------------------------------------------------------------

    def _updated(self, update: MirrorUpdate) -> None:
        self.is_known = True
        self.version += 1
        if update.reset or not all(isinstance(change, _VALUE_CHANGES) for change in update.changes):
            self.structure_version += 1
        if update.reset:
            self._opened = {entity: is_open for entity, is_open in self._opened.items() if self.exists(entity)}
        for entity in update.removed:
            self._opened.pop(entity, None)
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()
        self._on_change()

    def _frame_kept(self, frame: StateFrame) -> None:
        self.version += 1
        self._on_state()

    def _live(self, entity: int, value: Transform | RigidBody, row: int) -> Component:
        frame = self.mirror.latest_frame
        assert frame is not None
        if isinstance(value, RigidBody):
            return msgspec.structs.replace(
                value,
                linear_velocity=tuple(frame.linear_velocity[row].tolist()),
                angular_velocity=tuple(frame.angular_velocity[row].tolist()),
            )
        position, rotation = tuple(frame.position[row].tolist()), tuple(frame.rotation[row].tolist())
        parent = self.parent_of(entity)
        if parent:
            position, rotation = local_pose(*self.world_pose(parent), position, rotation)
        return msgspec.structs.replace(value, position=position, rotation=rotation)
