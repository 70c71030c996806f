"""How physics sees the world, as line segments: what a tool draws over a picture of it.

Each kind of line is one function from a world's tables to lines; `LINES` names them all. Boxes are where bodies are now, but for
fat ones, which are those that the last step worked with.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.force_lines import (
    ASKED,
    CONTACT,
    JOINT,
    WEIGHT,
    Forces,
    asked_forces,
    contact_forces,
    force_segments,
    joint_forces,
    weights,
)
from elys.sim_node.physics.joint_lines import joint_lines
from elys.sim_node.physics.joints import JointTable
from elys.sim_node.physics.kernels.placement import place_colliders
from elys.sim_node.physics.kernels.tables import DYNAMIC, PLANE, STATIC
from elys.sim_node.physics.kernels.tree import FAR
from elys.sim_node.physics.settings import PhysicsSettings

Array = np.ndarray[Any, Any]

NORMAL_LENGTH: Final = 0.2  # [m]
CROSS_SIZE: Final = 0.03  # [m] half of it, where a contact point is marked
# Corner k of a box takes its upper side along axis d where bit d of k is set; an edge changes one bit.
_EDGES: Final = np.array([(k, k | 1 << d) for d in range(3) for k in range(8) if not k & 1 << d])
_UPPER: Final = np.array([[k >> d & 1 for d in range(3)] for k in range(8)], bool)


class Lines(NamedTuple):
    """L line segments."""

    positions: Array  # (L, 2, 3) float32 [m], world space
    colors: Array  # (L,) uint8: what each kind says with it
    entities: Array  # (L, 2) uint32: whose it is; 0 for nobody
    values: Array = np.zeros(0, np.float32)  # (L,) float32 where a kind measures something, else (0,)

    def with_more(self, more: Lines) -> Lines:
        """These and then more of the same kind."""
        return Lines(*(np.concatenate(pair) for pair in zip(self, more, strict=True)))


class Tables(NamedTuple):
    """What a world is made of."""

    bodies: BodyTable
    colliders: ColliderTable
    contacts: ContactStore
    joints: JointTable
    settings: PhysicsSettings


def debug_lines(tables: Tables, kind: str) -> Lines:
    """The lines of one kind of `LINES`; PhysicsError names those there are."""
    if kind not in LINES:
        raise PhysicsError(f"There are no debug lines {kind!r}: ask for {', '.join(LINES)}")
    return LINES[kind](tables)


def _boxes(tables: Tables) -> Lines:
    """The smallest boxes of colliders, coloured by the motion of their bodies: 0 dynamic, 1 kinematic, 2 static."""
    rows = _placed(tables)
    return box_lines(rows["box"], tables.bodies.rows["motion"][rows["body"]], rows["entity"])


def _fat_boxes(tables: Tables) -> Lines:
    """The boxes that pairs are found with, coloured likewise."""
    is_drawable = _drawable(tables)
    proxies, entities = tables.colliders.proxies[is_drawable], tables.colliders.rows["entity"][is_drawable]
    return box_lines(proxies["fat_box"], tables.bodies.rows["motion"][proxies["body"]], entities)


def _contacts(tables: Tables) -> Lines:
    """A cross (colour 0) at each point that touches or carries an impulse, and its normal (1), both with the impulse [N s]."""
    contacts = tables.contacts.contact_points(tables.bodies.rows, tables.colliders.rows)
    point = contacts.point[:, None, :]
    arms = CROSS_SIZE * np.eye(3)
    crosses = np.stack([point - arms, point + arms], axis=2).reshape(-1, 2, 3)
    normals = np.stack([contacts.point, contacts.point + NORMAL_LENGTH * contacts.normal], axis=1)
    between = np.stack([contacts.entity_a, contacts.entity_b], axis=1)
    lines = _lines(
        np.concatenate([crosses, normals]),
        np.repeat([0, 1], [len(crosses), len(normals)]),
        np.concatenate([np.repeat(between, 3, axis=0), between]),
    )
    impulse = contacts.normal_impulse.astype(np.float32)
    return lines._replace(values=np.concatenate([np.repeat(impulse, 3), impulse]))


def _islands(tables: Tables) -> Lines:
    """The smallest boxes of what moves, with the number of the island of bodies that hold on to one another, awake or asleep.

    Who draws them joins those of an island, for it alone knows who of it is to be seen.
    """
    rows = _placed(tables)
    rows = rows[tables.bodies.rows["motion"][rows["body"]] == DYNAMIC]
    _, island = np.unique(island_of(tables)[rows["body"]], return_inverse=True)
    lines = box_lines(rows["box"], island % 256, rows["entity"])
    return lines._replace(values=np.repeat(island, len(_EDGES)).astype(np.float32))


def _sleeping(tables: Tables) -> Lines:
    """The smallest boxes of what sleeps, in the colour of its island."""
    rows = _placed(tables)
    rows = rows[tables.bodies.rows["asleep"][rows["body"]] != 0]
    _, island = np.unique(island_of(tables)[rows["body"]], return_inverse=True)
    return box_lines(rows["box"], island % 256, rows["entity"])


def _axes(tables: Tables) -> Lines:
    """Principal axes of what moves, at its centre of mass and as long as its farthest point is away: 0 x, 1 y, 2 z."""
    rows = tables.bodies.rows
    rows = rows[rows["motion"] != STATIC]
    axes = [quaternion.rotate(rows["rotation"], np.broadcast_to(axis, (len(rows), 3))) for axis in np.eye(3)]
    ends = rows["position"][:, None] + rows["extent"][:, None, None] * np.stack(axes, axis=1)
    starts = np.broadcast_to(rows["position"][:, None], ends.shape)
    segments = np.stack([starts, ends], axis=2).reshape(-1, 2, 3)
    return _lines(segments, np.tile([0, 1, 2], len(rows)), np.repeat(_alone(rows["entity"]), 3, axis=0))


def _joints(tables: Tables) -> Lines:
    """What holds: from centres of mass to anchors (colour 0), the axis at the anchor of b (1), limits (2)."""
    return _lines(*joint_lines(tables.joints.rows, tables.bodies.rows))


def _forces(tables: Tables) -> Lines:
    """What pushes what moves, by the colours of force_lines.py, and how hard [N]."""
    bodies, settings = tables.bodies, tables.settings
    return lines_of_forces(
        {
            WEIGHT: weights(bodies, settings.gravity, settings.attractors),
            CONTACT: contact_forces(bodies, tables.colliders, tables.contacts),
            JOINT: joint_forces(bodies, tables.joints),
            ASKED: asked_forces(bodies),
        }
    )


def lines_of_forces(forces: dict[int, Forces]) -> Lines:
    """Forces by their colours."""
    segments, entities, strengths = zip(*map(force_segments, forces.values()), strict=True)
    colors = np.repeat(list(forces), [len(found) for found in segments])
    lines = _lines(np.concatenate(segments), colors, np.concatenate(entities))
    return lines._replace(values=np.concatenate(strengths).astype(np.float32))


# Every kind there is, and so every key of the topic.
LINES: Final[dict[str, Callable[[Tables], Lines]]] = {
    "boxes": _boxes,
    "fat_boxes": _fat_boxes,
    "contacts": _contacts,
    "islands": _islands,
    "sleeping": _sleeping,
    "axes": _axes,
    "joints": _joints,
    "forces": _forces,
}


def box_lines(boxes: Array, colors: Array, entities: Array) -> Lines:
    """The twelve edges of boxes (B, 6) of lower and upper corners [m], in colours (B,), of entities (B,)."""
    corners = np.where(_UPPER, boxes[:, None, 3:], boxes[:, None, :3])
    count = len(_EDGES)
    edges = corners[:, _EDGES].reshape(-1, 2, 3)
    return _lines(edges, np.repeat(colors, count), np.repeat(_alone(entities), count, axis=0))


def island_of(tables: Tables) -> Array:
    """(N,) the lowest row of the bodies that each body holds on to, through contacts, joints or in one sleep."""
    bodies, contacts = tables.bodies.rows, tables.contacts
    pairs = contacts.pairs[contacts.touching[: contacts.touching_count]]
    of_pairs = np.stack([tables.colliders.rows["body"][pairs[side]] for side in ("a", "b")], axis=1)
    links = tables.joints.links
    a, b = np.concatenate([of_pairs, links[(links >= 0).all(1)]]).T
    both = (bodies["motion"][a] == DYNAMIC) & (bodies["motion"][b] == DYNAMIC)
    asleep = np.flatnonzero(bodies["asleep"] != 0)
    first = np.concatenate([a[both], asleep])
    second = np.concatenate([b[both], bodies["next_asleep"][asleep]])
    label = np.arange(len(bodies))
    while True:
        # Both ends' representatives take the lower of their labels, and everybody that of the representative.
        low = np.minimum(label[first], label[second])
        joined = label.copy()
        np.minimum.at(joined, label[first], low)
        np.minimum.at(joined, label[second], low)
        joined = joined[joined]
        if np.array_equal(joined, label):
            return label
        label = joined


def _placed(tables: Tables) -> Array:
    """Rows of the drawable colliders as their bodies' poses place them: those of the table stand as before the last step."""
    rows = tables.colliders.rows[_drawable(tables)]
    listed = np.arange(len(rows), dtype=np.int32)
    place_colliders(tables.bodies.rows, rows, listed, len(rows), tables.colliders.geometry.arrays)
    return rows


def _drawable(tables: Tables) -> Array:
    """Which colliders have boxes, as (C,) bool: they were in a step, and end somewhere."""
    colliders = tables.colliders
    return np.asarray((colliders.proxies["fat_box"][:, 0] != FAR) & (colliders.rows["kind"] != PLANE))


def _alone(entities: Array) -> Array:
    """(N, 2) of lines that belong to one entity each (N,)."""
    return np.stack([entities, np.zeros_like(entities)], axis=1)


def _lines(positions: Array, colors: Array, entities: Array) -> Lines:
    return Lines(positions.astype(np.float32), colors.astype(np.uint8), entities.astype(np.uint32))
