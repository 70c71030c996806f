"""Joints as line segments: what holds what, where, about which axis, and how far it lets go."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.sim_node.physics.kernels.tables import CONE, DISTANCE, GEAR, HINGE, SLIDER

Array = np.ndarray[Any, Any]

ARM, AXIS, LIMIT = 0, 1, 2  # colours
LENGTH: Final = 0.3  # [m] of an axis, and the radius of an arc
APART: Final = 1e-4  # [m] nearer anchors are one
_ARC_STEPS: Final = 16


def joint_lines(joints: Array, bodies: Array) -> tuple[Array, Array, Array]:
    """Segments (L, 2, 3) [m], their colours (L,) and the entities (L, 2) that are joined, of the joint rows that hold.

    - ARM: from each body's centre of mass to its anchor, and from anchor to anchor where they are apart.
    - AXIS: through the anchor of b, along the axis of a's side.
    - LIMIT: of a hinge and of a twist the arc from the lower to the upper angle, of a slider the way of b's anchor, of a distance
      joint the upper length from a's anchor towards b's, of a cone its rim.
    """
    rows = joints[(joints["broken"] == 0) & (joints["kind"] != GEAR)]
    anchors, frames, centers = _placed(rows, bodies)
    arms, of_arms = _arms(rows, anchors, centers)
    axes, of_axes = _axes(rows, anchors, frames)
    limits = [_limits(row, anchors[place], frames[place, 0]) for place, row in enumerate(rows)]
    of_limits = np.repeat(np.arange(len(rows)), [len(lines) for lines in limits])
    segments = [arms, axes, np.concatenate(limits) if limits else np.zeros((0, 2, 3))]
    return (
        np.concatenate(segments),
        np.repeat([ARM, AXIS, LIMIT], [len(part) for part in segments]),
        rows["entity"][np.concatenate([of_arms, of_axes, of_limits])],
    )


def _placed(rows: Array, bodies: Array) -> tuple[Array, Array, Array]:
    """Anchors (J, 2, 3), frames (J, 2, 4) and centres of mass (J, 2, 3) in the world; the world's centre is at its anchor."""
    anchors = rows["local_anchor"].reshape(-1, 2, 3).copy()
    frames = rows["local_rotation"].reshape(-1, 2, 4).copy()
    centers = anchors.copy()
    for side in range(2):
        held = rows["body"][:, side] >= 0
        body = bodies[rows["body"][held, side]]
        centers[held, side] = body["position"]
        anchors[held, side] = body["position"] + quaternion.rotate(body["rotation"], anchors[held, side])
        frames[held, side] = quaternion.multiply(body["rotation"], frames[held, side])
    return anchors, frames, centers


def _arms(rows: Array, anchors: Array, centers: Array) -> tuple[Array, Array]:
    """Segments, and the places of their joints among the rows."""
    held = rows["body"] >= 0
    apart = np.linalg.norm(anchors[:, 1] - anchors[:, 0], axis=1) > APART
    arms = np.concatenate([np.stack([centers, anchors], axis=2)[held], anchors[apart]])
    return arms, np.concatenate([np.nonzero(held)[0], np.flatnonzero(apart)])


def _axes(rows: Array, anchors: Array, frames: Array) -> tuple[Array, Array]:
    """The same."""
    turning = np.isin(rows["kind"], (HINGE, SLIDER, CONE))
    along = quaternion.rotate(frames[turning, 0], np.broadcast_to([1.0, 0.0, 0.0], (int(turning.sum()), 3)))
    middle = anchors[turning, 1]
    return np.stack([middle - LENGTH * along, middle + LENGTH * along], axis=1), np.flatnonzero(turning)


def _limits(row: Array, anchors: Array, frame: Array) -> Array:
    kind, lower, upper = row["kind"], float(row["lower"]), float(row["upper"])
    lines = [np.zeros((0, 2, 3))]
    if kind == DISTANCE and math.isfinite(upper):
        across = anchors[1] - anchors[0]
        length = float(np.linalg.norm(across))
        if length > 0.0:
            lines.append(np.stack([anchors[0], anchors[0] + across * (upper / length)])[None])
    if kind == SLIDER and math.isfinite(lower) and math.isfinite(upper):
        axis = quaternion.rotate(frame, np.array([1.0, 0.0, 0.0]))
        lines.append(np.stack([anchors[0] + lower * axis, anchors[0] + upper * axis])[None])
    if kind in (HINGE, CONE) and math.isfinite(lower) and math.isfinite(upper):
        angles = np.linspace(max(lower, upper - 2.0 * math.pi), upper, _ARC_STEPS + 1)
        arc = LENGTH * np.stack([np.zeros_like(angles), np.cos(angles), np.sin(angles)], axis=1)
        points = np.concatenate([np.zeros((1, 3)), arc, np.zeros((1, 3))])
        lines.append(_polyline(anchors[1] + quaternion.rotate(frame, points)))
    if kind == CONE:
        around = np.linspace(0.0, 2.0 * math.pi, _ARC_STEPS + 1)
        swing = float(row["swing_limit"])
        rim = np.stack(
            [np.full_like(around, math.cos(swing)), math.sin(swing) * np.cos(around), math.sin(swing) * np.sin(around)],
            axis=1,
        )
        lines.append(_polyline(anchors[1] + LENGTH * quaternion.rotate(frame, rim)))
    return np.concatenate(lines)


def _polyline(points: Array) -> Array:
    return np.stack([points[:-1], points[1:]], axis=1)
