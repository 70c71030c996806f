"""The overlays of a scene: followed in the mirror, so that a text that changes costs that text and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple, cast

import numpy as np

from elys.bus.messages.scene import ComponentRemoved, ComponentSet, Despawned, EnabledSet, Reparented, Spawned
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.common.components import Overlay, OverlayBar, OverlayImage, OverlayPanel, OverlayText
from elys.common.components.overlay import OVERLAY_COMPONENTS
from elys.render_node.render_world import RenderWorld

Point = tuple[float, float, float]
FIRST_PLAYER: Final = 1  # whose views those are of which nobody says anything
_KINDS: Final = frozenset(OVERLAY_COMPONENTS)
_WHERE: Final = Overlay()


@dataclass(slots=True)
class OverlayNode:
    """An entity that is drawn over the picture; `parent` is the row of the nearest one above it, -1 for none."""

    entity: int
    parent: int
    overlay: Overlay
    panel: OverlayPanel | None
    bar: OverlayBar | None
    image: OverlayImage | None
    text: OverlayText | None


class Overlays(NamedTuple):
    """What a picture shows of them."""

    nodes: tuple[OverlayNode, ...] = ()  # those that are switched on, parents first
    points: Mapping[int, Point] = {}  # [m] where those are that are followed
    player: int = FIRST_PLAYER

    def __bool__(self) -> bool:
        return bool(self.nodes)


NO_OVERLAYS: Final = Overlays()


@dataclass(slots=True)
class OverlayBoard:
    """Keeps the overlays of a mirror.

    Attributes:
        version: rises when any of them changes.
    """

    mirror: SceneMirror
    version: int = 0
    _nodes: tuple[OverlayNode, ...] = ()
    _rows: dict[int, int] = field(default_factory=dict)
    _is_outdated: bool = True

    def __post_init__(self) -> None:
        self.mirror.listen(self._note)

    def shown(self, world: RenderWorld, *, player: int = FIRST_PLAYER) -> Overlays:
        """What a picture of the world, as it is placed now, shows to a player."""
        nodes = self._current()
        if not nodes:
            return NO_OVERLAYS
        wanted = {node.overlay.follow for node in nodes if node.overlay.follow}
        return Overlays(nodes, self._points(world, wanted) if wanted else {}, player)

    @property
    def follows(self) -> bool:
        """Whether any of them is where something in the world is."""
        return any(node.overlay.follow for node in self._current())

    @property
    def images(self) -> tuple[str, ...]:
        """All images that are named."""
        found = (node.image.image for node in self._current() if node.image is not None)
        return tuple(dict.fromkeys(name for name in found if name))

    def _points(self, world: RenderWorld, wanted: set[int]) -> dict[int, Point]:
        bodies = world.bodies()
        points: dict[int, Point] = {}
        for row in np.flatnonzero(np.isin(bodies.entity, np.fromiter(wanted, np.uint32))).tolist():
            points[int(bodies.entity[row])] = cast(Point, tuple(bodies.position[row].tolist()))
        for entity in wanted - points.keys():
            if entity in self.mirror.entities:
                points[entity] = self.mirror.world_pose(entity).position
        return points

    def _current(self) -> tuple[OverlayNode, ...]:
        if self._is_outdated:
            self._is_outdated = False
            self._nodes = _nodes_of(self.mirror)
            self._rows = {node.entity: row for row, node in enumerate(self._nodes)}
        return self._nodes

    def _note(self, update: MirrorUpdate) -> None:
        if update.reset:
            self._outdate()
            return
        for change in update.changes:
            match change:
                case ComponentSet(component=component, entity=entity) if component in _KINDS:
                    self._take(entity, component)
                case ComponentRemoved(component=component) if component in _KINDS:
                    self._outdate()
                case Spawned(components=components) if not _KINDS.isdisjoint(components):
                    self._outdate()
                case Despawned() | Reparented() | EnabledSet() if self._nodes:
                    self._outdate()

    def _outdate(self) -> None:
        self._is_outdated = True
        self.version += 1

    def _take(self, entity: int, component: str) -> None:
        """A value that is another: nothing else has to be looked at, unless it is new here."""
        row = self._rows.get(entity, -1)
        if self._is_outdated or row < 0:
            self._outdate()
            return
        self.version += 1
        components = self.mirror.entities[entity].components
        fresh = _node(entity, self._nodes[row].parent, components)
        node = self._nodes[row]
        node.overlay, node.panel, node.bar = fresh.overlay, fresh.panel, fresh.bar
        node.image, node.text = fresh.image, fresh.text


def _nodes_of(mirror: SceneMirror) -> tuple[OverlayNode, ...]:
    """All that are switched on, in the tree's order."""
    owners = [entity.id for entity in mirror.entities.values() if not _KINDS.isdisjoint(entity.components)]
    if not owners:
        return ()
    chosen = {entity for entity in owners if mirror.world_enabled(entity)}
    rows: dict[int, int] = {}
    nodes: list[OverlayNode] = []
    for found in mirror.in_order():
        if found.id not in chosen:
            continue
        above = found.parent
        while above and above not in rows:
            above = mirror.entities[above].parent
        rows[found.id] = len(nodes)
        nodes.append(_node(found.id, rows.get(above, -1), found.components))
    return tuple(nodes)


def _node(entity: int, parent: int, components: Mapping[str, object]) -> OverlayNode:
    return OverlayNode(
        entity,
        parent,
        cast(Overlay, components.get("Overlay", _WHERE)),
        cast("OverlayPanel | None", components.get("OverlayPanel")),
        cast("OverlayBar | None", components.get("OverlayBar")),
        cast("OverlayImage | None", components.get("OverlayImage")),
        cast("OverlayText | None", components.get("OverlayText")),
    )
