"""What the bus last said of the scene, as the panels read it: live poses of bodies, places in the tree.

A thin layer over `elys.bus.mirror.SceneMirror`. Nothing here is ever changed by the editor itself.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.following import follow_scene, follow_state
from elys.bus.live_values import live_components, live_value
from elys.bus.messages.scene import ComponentRemoved, ComponentSet, Despawned, Reparented, SettingsSet, Spawned
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorUpdate, SceneMirror, WorldPose
from elys.bus.session import Session
from elys.bus.tree.filter import parse_filter
from elys.bus.tree.order import Order
from elys.bus.tree.rows import TreeRows
from elys.common.assets.primitives import PRIMITIVES
from elys.common.components import Collider, Component, MeshRenderer, Transform
from elys.common.math import matrix
from elys.common.scene import SceneSettings
from elys.editor_node.entity_marks import EntityMarks

_GAP: Final = 0.005  # [m] between a new body and what it is put on
_VALUE_CHANGES: Final = (ComponentSet, ComponentRemoved, SettingsSet)
_TREE_CHANGES: Final = (Spawned, Despawned, Reparented)
# Radius of the ball around a mesh that is not scaled [m]; imported ones are taken as a metre large.
_MESH_RADIUS: Final[Mapping[str, float]] = {"box": math.sqrt(3.0) / 2.0, "sphere": 0.5, "cylinder": math.sqrt(0.5)}


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
        self.transforms_version = 0  # rises when somebody sets, gives or takes a Transform; state frames do not count
        self.is_known = False  # whether there was a snapshot yet
        self._session = session
        self._on_change = on_change
        self._on_state = on_state
        self._changed = asyncio.Event()
        self.marks = EntityMarks(self.mirror, on_change=self._marks_changed)
        self.tree = TreeRows(self.mirror, is_marked=self.marks.is_marked)
        self._index_of: dict[int, dict[int, int]] = {}  # of the children of a parent
        self._epoch = 0

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
        return self.parent_of(entity), self._index_among_siblings(entity)

    def order_of(self, entity: int) -> tuple[int, ...]:
        """Sorts entities as the scene has them, from the top down: the index among siblings of all above it and its own."""
        path = [self._index_among_siblings(entity)]
        path.extend(self._index_among_siblings(ancestor) for ancestor in self.ancestors_of(entity))
        return tuple(reversed(path))

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
        return live_value(self.mirror, entity, value) if value is not None else None

    def components_of(self, entity: int) -> dict[str, Component]:
        """All its components as they are now."""
        return live_components(self.mirror, entity)

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
        boxes = [self.box_of(entity) for entity in self._near(x, z, half) if self.has_extent(entity)]
        over = [(low[1], high[1]) for low, high in boxes if low[0] < x + half and high[0] > x - half
                and low[2] < z + half and high[2] > z - half]  # fmt: skip
        # From the lowest up: once above one, nothing that was passed can be in the way again.
        for low, high in sorted(over):
            if low < y + half and high > y - half:
                y = high + half + _GAP
        return y

    def _near(self, x: float, z: float, half: float) -> Iterator[int]:
        """Those that may reach over a square of half edge `half` [m]; all that stand below others, whose poses cost more."""
        frame = self.mirror.latest_frame
        positions = frame.position.tolist() if frame is not None else []
        for entity, found in self.mirror.entities.items():
            transform = found.components.get("Transform")
            if found.parent or not isinstance(transform, Transform):
                yield entity
                continue
            row = self.mirror.frame_row(entity)
            place = positions[row] if row >= 0 else transform.position
            reach = half + max(map(abs, transform.scale)) * (1.0 + _collider_reach(found.components.get("Collider")))
            if abs(place[0] - x) <= reach and abs(place[2] - z) <= reach:
                yield entity

    def box_of(self, entity: int) -> tuple[list[float], list[float]]:
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

    def _index_among_siblings(self, entity: int) -> int:
        """Made for all children of a parent at once, and kept until one of them comes, goes or moves."""
        parent = self.parent_of(entity)
        found = self._index_of.get(parent)
        if found is None:
            found = {child: index for index, child in enumerate(self.children_of(parent))}
            self._index_of[parent] = found
        return found[entity]

    # --- the tree as rows ------------------------------------------------------------------------------------------

    def set_open(self, entity: int, is_open: bool) -> None:
        """Shows or hides what is below an entity."""
        self.tree.set_open(entity, is_open)

    def reveal(self, entity: int) -> None:
        """Opens all above an entity."""
        for ancestor in reversed(list(self.ancestors_of(entity))):
            if not self.tree.is_open(ancestor):
                self.tree.set_open(ancestor, True)

    def rows(self, search: str = "", order: Order = "scene") -> TreeRows:
        """The lines to be seen, from the top down: those that a search finds with all above them, siblings in an order.

        Raises:
            FilterError: the search means nothing.
        """
        return self.tree.show(parse_filter(search), order)

    # --- being told ------------------------------------------------------------------------------------------------

    def _updated(self, update: MirrorUpdate) -> None:
        self.is_known = True
        self.version += 1
        if update.reset or not all(isinstance(change, _VALUE_CHANGES) for change in update.changes):
            self.structure_version += 1
        if update.reset or any(isinstance(change, _TREE_CHANGES) for change in update.changes):
            self._index_of.clear()
        if any(isinstance(c, ComponentSet | ComponentRemoved) and c.component == "Transform" for c in update.changes):
            self.transforms_version += 1
        self.tree.follow(update)
        if update.reset and self.mirror.epoch != self._epoch:
            self._epoch = self.mirror.epoch
            self.marks.forget((*self.marks.own("locked"), *self.marks.own("hidden")))
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()
        self._on_change()

    def _marks_changed(self) -> None:
        self.tree.marks_changed()
        self._on_change()

    def _frame_kept(self, frame: StateFrame) -> None:
        self.version += 1
        self._on_state()


def _collider_reach(collider: Component | None) -> float:
    """How far [m] a collider reaches from where its entity is, at most and before it is scaled."""
    if not isinstance(collider, Collider):
        return 0.0
    extent = collider.radius if collider.shape == "sphere" else math.hypot(*collider.size) / 2.0
    return extent * 2.0 + math.hypot(*collider.offset)
