"""Debug drawing: which lines and letters explain a scene, from what the bus tells of it.

    DEBUG_LINES ──take_lines────┐
    STATE ────────take_state────┤                 ┌─> lines of the chosen kinds, where things are seen now
    CONTACTS ─────take_contacts─┴─> DebugDrawing ─┴─> labels

What physics itself says goes before what can be told of a scene without it: a recording holds no lines, and shows the boxes of
what is drawn, joints from their components and contacts as they began.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, Final, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.physics import ContactBatch, DebugLines
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import Debug
from elys.bus.mirror import SceneMirror
from elys.common.components import Joint
from elys.common.errors import ElysError
from elys.common.math import quaternion
from elys.render_node import marks
from elys.render_node.data_colors import entity_colors
from elys.render_node.ghost_worlds import ShownGhost
from elys.render_node.marks import Label, Lines, Marks
from elys.render_node.parting_marks import parting_marks
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_tables import Rows
from elys.render_node.trails import ContactLog, Trails, trail_lines

DEBUG_KINDS: Final[tuple[Debug, ...]] = get_args(Debug)
# The topic's key of each kind that the simulation itself knows.
PHYSICS_LINES: Final[dict[Debug, str]] = {
    "aabb": "boxes",
    "contacts": "contacts",
    "forces": "forces",
    "joints": "joints",
    "islands": "islands",
    "sleeping": "sleeping",
}
ONLY_SIMULATED: Final[frozenset[Debug]] = frozenset(("forces", "islands", "sleeping"))
MOST_AXES: Final = 2000
NUMBERED: Final = 8  # contacts and forces whose strength stands beside them, the strongest
STRONGEST: Final = 0.6  # [m] of the line of the strongest impulse or force
NORMAL_LENGTH: Final = 0.2  # [m]
CROSS_SIZE: Final = 0.03  # [m]
AXIS_LENGTH: Final = 0.3  # [m] of a joint's axis
ARROW_TIME: Final = 0.2  # [s] of motion that a velocity's arrow spans
LARGE: Final = 3.0  # times as large as most things are
EDGE_COUNT: Final = 12  # of a box
SLOWEST: Final = 0.01  # [m/s] that has an arrow
# Weight, contacts, joints, what was asked for, and hands: as the simulation numbers them.
FORCE_COLORS: Final = (marks.STATIC, marks.IMPULSE, marks.ARM, marks.TURNED_BOX, marks.ARROW)


class _PhysicsLines(NamedTuple):
    """Lines as the simulation sent them: positions (L, 2, 3), colors (L,), values (L,) or (0,), entities (L, 2) or (0, 2)."""

    epoch: int
    tick: int
    positions: NDArray[np.float32]
    colors: NDArray[np.uint8]
    values: NDArray[np.float32]
    entities: NDArray[np.uint32]

    def only(self, meant: NDArray[np.bool_]) -> _PhysicsLines:
        """Those of the lines (L,)."""
        values = self.values[meant] if len(self.values) else self.values
        return self._replace(
            positions=self.positions[meant], colors=self.colors[meant], values=values, entities=self.entities[meant]
        )


class DebugDrawing:
    """Makes marks of one session or recording."""

    def __init__(self, mirror: SceneMirror) -> None:
        self._mirror = mirror
        self._lines: dict[str, _PhysicsLines] = {}
        self._trails = Trails()
        self._contacts = ContactLog()

    # --- feeding ---------------------------------------------------------------------------------------------------

    def take_lines(self, key: str, message: DebugLines) -> None:
        """Takes lines of physics by the key of their topic; what is no whole lines is passed over."""
        positions = np.frombuffer(message.positions[: len(message.positions) // 24 * 24], "<f4").reshape(-1, 2, 3)
        colors = np.frombuffer(message.colors, np.uint8)
        values = np.frombuffer(message.values[: len(message.values) // 4 * 4], "<f4")
        entities = np.frombuffer(message.entities[: len(message.entities) // 8 * 8], "<u4").reshape(-1, 2)
        lengths = (0, len(positions))
        if len(colors) != len(positions) or len(values) not in lengths or len(entities) not in lengths:
            return
        if np.isfinite(positions).all():
            self._lines[key] = _PhysicsLines(message.epoch, message.tick, positions, colors, values, entities)

    def take_state(self, frame: StateFrame) -> None:
        """Remembers where bodies were."""
        self._trails.take(frame)

    def take_contacts(self, batch: ContactBatch) -> None:
        """Remembers what touches; the mirror must stand at the batch's tick."""
        self._contacts.take(batch, self._mirror)

    def forget(self) -> None:
        """Starts anew, as for another host."""
        self._lines.clear()
        self._trails.forget()
        self._contacts.forget()

    def told_tick(self, key: str) -> int:
        """Of which tick the lines of a key are; -1 where there are none of this run."""
        told = self._lines.get(key)
        return told.tick if told is not None and told.epoch == self._mirror.epoch else -1

    def drop_lines(self, key: str) -> None:
        """Forgets lines that nobody keeps up to date any more."""
        self._lines.pop(key, None)

    # --- drawing ---------------------------------------------------------------------------------------------------

    def marks(
        self,
        world: RenderWorld,
        kinds: Collection[Debug],
        entities: tuple[int, ...] = (),
        *,
        hidden: tuple[int, ...] = (),
        notes: tuple[str, ...] = (),
        ghosts: Sequence[ShownGhost] = (),
    ) -> Marks:
        """What is to be drawn over the world as it is placed, of some entities and what is below them, or of all; but of nobody
        who is switched off, or `hidden` with all below. `ghosts` are the other runs that are seen with it.
        """
        if not kinds:
            return Marks(notes=notes)
        scope = _Scope(world, entities, hidden)
        parts: list[Lines] = []
        labels: list[Label] = []
        for kind in DEBUG_KINDS:
            if kind in kinds and kind in _MAKERS:
                _MAKERS[kind](self, scope, parts, labels)
        if ghosts and "divergence" in kinds:
            lines, lengths, told = parting_marks(ghosts, self._mirror.entities, scope.has)
            parts, labels, notes = parts + lines, labels + lengths, notes + told
        return Marks(lines=Lines.joined(parts), labels=tuple(labels), notes=notes, grid="grid" in kinds)

    def _told(self, kind: Debug, scope: _Scope) -> _PhysicsLines | None:
        """What physics says of those who are meant; None where it does not, or where it cannot be told whose lines these are."""
        told = self._lines.get(PHYSICS_LINES[kind])
        if told is None or told.epoch != self._mirror.epoch:
            return None
        if scope.is_everybody or not len(told.positions):
            return told
        return told.only(scope.between(told.entities)) if len(told.entities) else None

    def _aabb(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        told = self._told("aabb", scope)
        if told is not None:
            palette = np.array((marks.DYNAMIC, marks.KINEMATIC, marks.STATIC), np.uint8)
            parts.append(Lines.of(told.positions, palette[np.minimum(told.colors, 2)]))
            return
        edges = marks.box_edges(marks.box_corners(*scope.world.boxes(scope.rows)))
        moving = np.isin(scope.world.entity[scope.rows], scope.world.bodies().entity)
        color = np.array((marks.STATIC, marks.DYNAMIC), np.uint8)[moving.astype(np.intp)]
        parts.append(Lines.of(edges, np.repeat(color, 12, axis=0)))

    def _obb(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        world, rows = scope.world, scope.rows
        corners = marks.box_corners(*world.local_boxes(rows))
        corners = np.einsum("nij,nkj->nki", world.linear[rows], corners) + world.position[rows, None]
        parts.append(Lines.of(marks.box_edges(corners), marks.TURNED_BOX))

    def _contact(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        told = self._told("contacts", scope)
        if told is not None:
            normals = told.positions[told.colors == 1].astype(np.float64)
            point, normal = normals[:, 0], (normals[:, 1] - normals[:, 0]) / NORMAL_LENGTH
            impulse = told.values[told.colors == 1].astype(np.float64) if len(told.values) else np.zeros(len(point))
        else:
            point, normal, impulse = self._contacts.touching(self._mirror, scope.means)
        strongest = float(impulse.max(initial=0.0))
        length = STRONGEST * impulse / strongest if strongest > 0.0 else impulse
        strong = length > CROSS_SIZE
        ends = np.stack([point, point + length[:, None] * normal], axis=1)
        parts.append(Lines.of(ends[strong], marks.IMPULSE, width=3.2, hidden=0.8))
        normals = np.stack([point, point + NORMAL_LENGTH * normal], axis=1)
        parts.append(Lines.of(normals, marks.NORMAL, hidden=0.8))
        parts.append(Lines.of(marks.crosses(point, CROSS_SIZE), marks.POINT, width=2.0, hidden=1.0))
        labels += [
            Label(f"{impulse[row]:.3g} N s", _place(ends[row, 1]), marks.IMPULSE)
            for row in _strongest(impulse)
            if strong[row]
        ]

    def _forces(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        told = self._told("forces", scope)
        if told is None or not len(told.values):
            return
        starts, strength = told.positions[:, 0].astype(np.float64), told.values.astype(np.float64)
        ways = (told.positions[:, 1] - starts) / NORMAL_LENGTH
        tips = starts + (STRONGEST * strength / strength.max())[:, None] * ways
        kinds = np.minimum(told.colors, len(FORCE_COLORS) - 1)
        colors = np.tile(np.array(FORCE_COLORS, np.uint8)[kinds], (3, 1))  # a shaft and two barbs
        parts.append(Lines.of(marks.arrows(starts, tips), colors, width=2.4, hidden=0.8))
        labels += [
            Label(_newtons(strength[row]), _place(tips[row]), FORCE_COLORS[kinds[row]]) for row in _strongest(strength)
        ]

    def _joints(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        told = self._told("joints", scope)
        if told is not None:
            palette = np.array((marks.ARM, marks.HINGE, marks.LIMIT), np.uint8)
            parts.append(Lines.of(told.positions, palette[np.minimum(told.colors, 2)], width=2.0, hidden=0.7))
            return
        arms, axes = _joint_lines(self._mirror, scope.means)
        parts.append(Lines.of(arms, marks.ARM, width=2.0, hidden=0.7))
        parts.append(Lines.of(axes, marks.HINGE, width=2.0, hidden=0.7))

    def _paths(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        bodies = scope.world.bodies()
        kept = scope.has(bodies.entity)
        ways, whose = self._trails.ways(bodies.entity[kept], bodies.position[kept], bodies.time)
        parts.append(trail_lines(ways, entity_colors(whose)))

    def _velocity(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        entity, position, velocity, *_ = scope.world.bodies()
        kept = scope.has(entity) & (np.linalg.norm(velocity, axis=1) > SLOWEST)
        tips = position[kept] + velocity[kept] * ARROW_TIME
        parts.append(Lines.of(marks.arrows(position[kept], tips), marks.ARROW, width=2.0, hidden=0.6))

    def _axes(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        world, rows = scope.world, scope.one_each[:MOST_AXES]
        linear = world.linear[rows].astype(np.float64)
        size = np.linalg.norm(linear, axis=1, keepdims=True)
        reach = 1.2 * world.radius[rows].astype(np.float64)
        reach = np.minimum(reach, LARGE * float(np.median(reach))) if len(rows) else reach  # a floor's are no longer
        axes = linear / np.where(size > 0, size, 1.0) * reach[:, None, None]
        start = np.repeat(world.position[rows], 3, axis=0)
        ends = np.stack([start, start + np.swapaxes(axes, 1, 2).reshape(-1, 3)], axis=1)
        parts.append(Lines.of(ends, np.tile(np.array(marks.AXES, np.uint8), (len(rows), 1)), hidden=0.6))
        if scope.is_all:
            origin = np.stack([np.zeros((3, 3)), np.eye(3)], axis=1)
            parts.append(Lines.of(origin, np.array(marks.AXES, np.uint8), width=3.0, hidden=0.6))
            for letter, tip, color in zip("xyz", np.eye(3), marks.AXES, strict=True):
                labels.append(Label(letter, _place(tip), color))

    def _labels(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        world, known = scope.world, self._mirror.entities
        rows = scope.one_each
        lower, upper = world.boxes(rows)
        for entity, low, high in zip(world.entity[rows].tolist(), lower.tolist(), upper.tolist(), strict=True):
            if entity in known and known[entity].name:
                place = ((low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2)
                labels.append(Label(known[entity].name, place))

    def _islands(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        told = self._told("islands", scope)
        if told is None or not len(told.values):
            return
        # A box an island, around those of it that are meant.
        names, island = np.unique(told.values[::EDGE_COUNT], return_inverse=True)
        ends = told.positions.reshape(-1, EDGE_COUNT * 2, 3).astype(np.float64)
        lower, upper = np.full((len(names), 3), np.inf), np.full((len(names), 3), -np.inf)
        np.minimum.at(lower, island, ends.min(axis=1))
        np.maximum.at(upper, island, ends.max(axis=1))
        colors = entity_colors(told.colors[::EDGE_COUNT][np.unique(island, return_index=True)[1]].astype(np.uint32) + 1)
        parts.append(Lines.of(marks.box_edges(marks.box_corners(lower, upper)), np.repeat(colors, EDGE_COUNT, axis=0)))

    def _sleeping(self, scope: _Scope, parts: list[Lines], labels: list[Label]) -> None:
        told = self._told("sleeping", scope)
        if told is not None:
            parts.append(Lines.of(told.positions, entity_colors(told.colors.astype(np.uint32) + 1)))


class _Scope:
    """Of whom something is drawn."""

    def __init__(self, world: RenderWorld, entities: tuple[int, ...], hidden: tuple[int, ...]) -> None:
        self.world = world
        self.is_all = not entities
        self._below = world.entities_below(entities) if entities else np.zeros(0, np.uint32)
        self._absent = np.union1d(world.switched_off, world.entities_below(hidden))
        self.is_everybody = self.is_all and not len(self._absent)
        self._chosen = frozenset(self._below.tolist())
        self._unseen = frozenset(self._absent.tolist())
        measured = world.measured_rows
        self.rows: Rows = measured[self.has(world.entity[measured])]  # instances

    @property
    def one_each(self) -> Rows:
        """The first instance of each entity."""
        _, first = np.unique(self.world.entity[self.rows], return_index=True)
        return self.rows[first]

    def has(self, entity: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Which of the entities (N,) are meant."""
        meant = np.ones(len(entity), np.bool_) if self.is_all else np.isin(entity, self._below)
        return meant & ~np.isin(entity, self._absent) if len(self._absent) else meant

    def between(self, entities: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Which of the lines between entities (L, 2) are meant: one of both is, and none is out of sight. 0 is nobody."""
        chosen = np.ones(len(entities), np.bool_) if self.is_all else np.isin(entities, self._below).any(axis=1)
        return np.asarray(chosen & ~np.isin(entities, self._absent).any(axis=1))

    def means(self, entities: Collection[int]) -> bool:
        """The same for what is between a few."""
        return (self.is_all or not self._chosen.isdisjoint(entities)) and self._unseen.isdisjoint(entities)


def _strongest(values: NDArray[np.float64]) -> list[int]:
    """Where the largest stand, beside which letters are to be read."""
    return np.argsort(-values, kind="stable")[:NUMBERED].tolist()


def _newtons(strength: float) -> str:
    return f"{strength / 1e3:.3g} kN" if strength >= 1e3 else f"{strength:.3g} N"


_Maker = Callable[[DebugDrawing, _Scope, list[Lines], list[Label]], None]
# In the order in which they are drawn, which is that of DEBUG_KINDS; the grid is a pass of its own.
_MAKERS: Final[dict[Debug, _Maker]] = {
    "aabb": DebugDrawing._aabb,
    "obb": DebugDrawing._obb,
    "contacts": DebugDrawing._contact,
    "forces": DebugDrawing._forces,
    "joints": DebugDrawing._joints,
    "trajectories": DebugDrawing._paths,
    "velocity": DebugDrawing._velocity,
    "axes": DebugDrawing._axes,
    "labels": DebugDrawing._labels,
    "islands": DebugDrawing._islands,
    "sleeping": DebugDrawing._sleeping,
}


def parsed_kinds(text: str) -> tuple[Debug, ...]:
    """The kinds that a list with commas names, in their own order; ElysError names those there are."""
    wanted = {word.strip() for word in text.split(",") if word.strip()}
    unknown = sorted(wanted.difference(DEBUG_KINDS))
    if unknown:
        raise ElysError(f"there is no debug drawing '{unknown[0]}': there are {', '.join(DEBUG_KINDS)}")
    return tuple(kind for kind in DEBUG_KINDS if kind in wanted)


def _joint_lines(mirror: SceneMirror, means: Callable[[Collection[int]], bool]) -> tuple[NDArray[Any], NDArray[Any]]:
    """From joints' components: arms (L, 2, 3) from who is held to the anchors, and axes (K, 2, 3) of those that have one."""
    arms: list[tuple[Any, Any]] = []
    axes: list[tuple[Any, Any]] = []
    for entity, found in mirror.entities.items():
        joint: Any = found.components.get("Joint")
        if not isinstance(joint, Joint) or not means((entity, joint.other)):
            continue
        own = mirror.world_pose(entity)
        rotation = np.asarray(own.rotation, np.float64)
        anchor = own.position + quaternion.rotate(rotation, np.multiply(own.scale, joint.anchor))
        arms.append((own.position, anchor))
        if joint.other in mirror.entities:
            other = mirror.world_pose(joint.other)
            turned = quaternion.rotate(np.asarray(other.rotation), np.multiply(other.scale, joint.other_anchor))
            there = anchor if joint.fit and joint.kind != "distance" else other.position + turned
            arms += [(there, other.position), (anchor, there)]
        elif not joint.fit:
            arms.append((anchor, joint.other_anchor))
        if joint.kind in ("hinge", "slider", "cone_twist"):
            along = quaternion.rotate(rotation, np.asarray(joint.axis, np.float64))
            along = along / max(float(np.linalg.norm(along)), 1e-9) * AXIS_LENGTH
            axes.append((anchor - along, anchor + along))
    return np.array(arms, np.float64).reshape(-1, 2, 3), np.array(axes, np.float64).reshape(-1, 2, 3)


def _place(point: NDArray[np.floating[Any]]) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])
