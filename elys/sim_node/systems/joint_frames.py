"""Where joints hold: from Joint components, in the spaces of entities, to what physics takes, in the spaces of bodies.

Entities may be stretched and stand below their body; bodies are stiff and know no scale.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Joint
from elys.common.math import quaternion
from elys.common.math.matrix import inverse_affine, transform_points
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.physics import JOINT_KINDS

Values = NDArray[Any]

DISTANCE: Final = JOINT_KINDS.index("distance")
MOTOR: Final = JOINT_KINDS.index("motor")


class Ends:
    """Both ends of N joints in the world: the joints' own entities, and those they are joined to, 0 for the world."""

    def __init__(self, world: World, entities: Entities, others: Entities) -> None:
        self.own_affine, self.own_rotation = _places(world, entities)
        self.other_affine, self.other_rotation = _places(world, others)


def _places(world: World, entities: Entities) -> tuple[Values, Values]:
    """World transforms [N, 3, 4] and rotations [N, 4] of entities; of 0 those of the world itself."""
    affine = np.tile(np.eye(3, 4), (len(entities), 1, 1))
    rotation = np.tile(quaternion.IDENTITY, (len(entities), 1))
    held = np.flatnonzero(entities)
    affine[held] = world.transforms.world_affines(entities[held])
    turned = world.transforms.world_poses(entities[held]).rotation.astype(np.float64)
    rotation[held] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return affine, rotation


def fitted(joint: Joint, ends: Ends, row: int) -> dict[str, Any]:
    """What `fit` makes of a joint's fields, as the two stand now; LinAlgError if the other is squeezed flat."""
    changes: dict[str, Any] = {"fit": False}
    anchor = transform_points(ends.own_affine[row], np.asarray(joint.anchor))
    if joint.kind == "distance":
        across = transform_points(ends.other_affine[row], np.asarray(joint.other_anchor)) - anchor
        length = float(np.sqrt((across * across).sum()))
        if joint.spring_frequency > 0.0:
            changes["spring_rest"] = joint.spring_rest or length
        elif not joint.limited:
            changes |= {"limited": True, "lower": length, "upper": length}
        return changes
    local = transform_points(inverse_affine(ends.other_affine[row]), anchor)
    rest = quaternion.multiply(quaternion.conjugate(ends.other_rotation[row]), ends.own_rotation[row])
    changes["other_anchor"] = tuple(local.tolist())
    changes["rest_rotation"] = tuple(rest.tolist())
    return changes


def frames(
    world: World, entities: Entities, others: Entities, own_bodies: Entities, other_bodies: Entities
) -> dict[str, Values]:
    """Anchors, axes and rest rotations of N joints, `a` being the other's body and `b` the joint's own."""
    ends = Ends(world, entities, others)
    table = world.table(Joint)
    rows = table.rows(entities)
    own_anchor = transform_points(ends.own_affine, table.column("anchor")[rows])
    other_anchor = transform_points(ends.other_affine, table.column("other_anchor")[rows])
    anchor_b, b_from_own = _in_bodies(world, own_bodies, entities, own_anchor, ends.own_rotation)
    anchor_a, a_from_other = _in_bodies(world, other_bodies, others, other_anchor, ends.other_rotation)
    other_from_own = table.column("rest_rotation")[rows]
    a_from_b = quaternion.multiply(quaternion.multiply(a_from_other, other_from_own), quaternion.conjugate(b_from_own))
    axis = quaternion.rotate(quaternion.multiply(a_from_other, other_from_own), table.column("axis")[rows])
    # A motor's velocities are along the axes of its frame, which are to be those of the other.
    axis[table.column("kind")[rows] == MOTOR] = (1.0, 0.0, 0.0)
    return {"anchor_a": anchor_a, "anchor_b": anchor_b, "axis_a": axis, "rest_rotation": a_from_b}


def _in_bodies(
    world: World, bodies: Entities, entities: Entities, points: Values, rotations: Values
) -> tuple[Values, Values]:
    """Points [N, 3] and rotations [N, 4] of entities in the spaces of their bodies; an entity's own body is not turned in it."""
    affine, body_rotation = _places(world, bodies)
    body_from_world = quaternion.conjugate(body_rotation)
    turned = quaternion.multiply(body_from_world, rotations)
    turned[bodies == entities] = quaternion.IDENTITY
    return quaternion.rotate(body_from_world, points - affine[:, :, 3]), turned
