"""What pushes bodies, as line segments: weight, contacts, joints and what was asked for, where it acts and how hard."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.common.components import Vec3
from elys.common.math import quaternion
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.joints import JointTable
from elys.sim_node.physics.kernels.tables import DYNAMIC, GEAR, POINTS
from elys.sim_node.physics.measures import field_at
from elys.sim_node.physics.settings import Attractor

Array = np.ndarray[Any, Any]

WEIGHT, CONTACT, JOINT, ASKED, HAND = range(5)  # colours
LENGTH: Final = 0.2  # [m] of every segment: it shows which way, its value how hard

Forces = tuple[Array, Array, Array]  # entities (L,) that are pushed, points (L, 3) [m], forces (L, 3) [N]


def force_segments(forces: Forces) -> tuple[Array, Array, Array]:
    """Segments (L, 2, 3) [m], entities (L, 2), 0 for nobody, and strengths (L,) [N] of those that are not zero."""
    entity, point, force = forces
    strength = np.linalg.norm(force, axis=1)
    acts = strength > 0.0
    way = force[acts] / strength[acts, None]
    segments = np.stack([point[acts], point[acts] + LENGTH * way], axis=1)
    return segments, np.stack([entity[acts], np.zeros_like(entity[acts])], axis=1), strength[acts]


def weights(bodies: BodyTable, gravity: Vec3, attractors: tuple[Attractor, ...]) -> Forces:
    """At centres of mass."""
    rows = bodies.rows[bodies.rows["motion"] == DYNAMIC]
    mass = np.divide(1.0, rows["inverse_mass"], out=np.zeros(len(rows)), where=rows["inverse_mass"] > 0.0)
    pull = field_at(rows["position"], gravity, attractors)
    return rows["entity"], rows["position"], (mass * rows["gravity_scale"])[:, None] * pull


def asked_forces(bodies: BodyTable) -> Forces:
    """What `set_forces` asked for, as it acts at centres of mass; what acts in one step alone is forgotten with it."""
    rows = bodies.rows
    asked = np.flatnonzero((rows["pushed"] != 0) & (rows["motion"] == DYNAMIC))
    return rows["entity"][asked], rows["position"][asked], bodies.forces["lasting"][asked, :3]


def contact_forces(bodies: BodyTable, colliders: ColliderTable, contacts: ContactStore) -> Forces:
    """Of each pair of the last substep, friction as well, amid the points that carried it; on both, where forces move them."""
    slots = contacts.live_pairs["slot"]
    slots = slots[(contacts.manifolds["point_count"][slots] > 0) & (contacts.manifolds["impulse_time"][slots] > 0.0)]
    pairs, manifolds = contacts.pairs[slots], contacts.manifolds[slots]
    impulse = np.where(np.arange(POINTS) < manifolds["point_count"][:, None], manifolds["normal_impulse"], 0.0)
    total = impulse.sum(axis=1, dtype=np.float64)
    carries = total > 0.0
    pairs, manifolds, impulse, total = pairs[carries], manifolds[carries], impulse[carries], total[carries]
    push = total[:, None] * manifolds["normal"] + manifolds["friction_impulse"]
    push /= manifolds["impulse_time"][:, None]
    anchors = manifolds["anchors"].reshape(-1, POINTS, 6).astype(np.float64)
    amid = np.einsum("pk,pkc->pc", impulse / total[:, None], anchors)
    rows, found = bodies.rows, []
    for side, sign in enumerate((-1.0, 1.0)):
        body = colliders.rows["body"][pairs["ab"[side]]]
        moves = rows["motion"][body] == DYNAMIC
        point = rows["position"][body] + amid[:, 3 * side : 3 * side + 3]
        found.append((rows["entity"][body[moves]], point[moves], sign * push[moves]))
    return _joined(found)


def joint_forces(bodies: BodyTable, joints: JointTable) -> Forces:
    """Means of the last step, at the anchors; on both, where forces move them."""
    held = joints.rows[(joints.rows["broken"] == 0) & (joints.rows["kind"] != GEAR)]
    impulse = held["step_impulse"][:, :3]
    size = np.linalg.norm(impulse, axis=1)
    rate = np.divide(held["force"], size, out=np.zeros(len(held)), where=size > 0.0)  # [1/s], of the step
    rows, found = bodies.rows, []
    for side, sign in enumerate((-1.0, 1.0)):
        body = held["body"][:, side]
        moves = (body >= 0) & (rows["motion"][body] == DYNAMIC)
        chosen = rows[body[moves]]
        anchor = held["local_anchor"][moves, 3 * side : 3 * side + 3]
        point = chosen["position"] + quaternion.rotate(chosen["rotation"], anchor)
        found.append((chosen["entity"], point, sign * (rate[:, None] * impulse)[moves]))
    return _joined(found)


def _joined(found: list[Forces]) -> Forces:
    entity, point, force = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return entity, point, force
