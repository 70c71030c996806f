"""Mass, centre of mass and inertia of bodies from their shapes.

A body's mass is shared among its shapes by weight: volume, times density where one is given. What the shapes do not fill,
and where they overlap, is not considered: overlapping shapes count twice, as if they stood beside each other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from elys.common.math.quaternion import IDENTITY, from_matrix, rotate, to_matrix
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, SPHERE

Array = np.ndarray[Any, Any]

# A body without a shape turns like a ball of this radius, so that an angular impulse has an effect.
SHAPELESS_RADIUS = 0.5  # [m]
_ROUNDING = 1e-12


class MassProperties(NamedTuple):
    """Of N bodies, in the entity's space."""

    center: Array  # (N, 3) centre of mass [m]
    axes: Array  # (N, 4) entity_from_principal
    inertia: Array  # (N, 3) about the principal axes through the centre of mass, for a mass of 1 kg [m^2]


class Shapes(NamedTuple):
    """C colliders, in the space of their bodies' entities."""

    body: Array  # (C,) which body each belongs to
    shape: Array  # (C,) BOX to HEIGHT_FIELD
    half_extents: Array  # (C, 3) as in COLLIDER [m]
    position: Array  # (C, 3) of the centre of mass [m]
    rotation: Array  # (C, 4)
    weight: Array  # (C,) volume, times density where one counts
    tensor: Array  # (C, 3, 3) of 1 kg about the centre of mass, in the shape's axes [m^2]


def mass_properties(shapes: Shapes, body_count: int) -> MassProperties:
    """Centre of mass, principal axes and moments of every body, per kilogram of its mass."""
    body = shapes.body
    total = np.bincount(body, shapes.weight, body_count)
    share = shapes.weight / np.where(total > 0.0, total, 1.0)[body]
    center = np.zeros((body_count, 3))
    for k in range(3):
        center[:, k] = np.bincount(body, share * shapes.position[:, k], body_count)
    turn = to_matrix(shapes.rotation)
    away = shapes.position - center[body]
    # Steiner: the tensor of a shape about the body's centre of mass.
    steiner = (away**2).sum(1)[:, None, None] * np.eye(3) - away[:, :, None] * away[:, None, :]
    tensor = np.zeros((body_count, 3, 3))
    own = turn @ shapes.tensor @ turn.transpose(0, 2, 1)
    np.add.at(tensor, body, share[:, None, None] * (own + steiner))
    axes, inertia = _principal_axes(tensor)

    # Exact where no tensor needs to be diagonalised: a shape alone that is even along its own axes has those.
    counts = np.bincount(body, minlength=body_count)
    plain = shapes.shape <= CYLINDER
    alone = np.flatnonzero((counts[body] == 1) & plain)
    axes[body[alone]] = shapes.rotation[alone]
    inertia[body[alone]] = np.einsum("nii->ni", shapes.tensor[alone])
    round_ones = alone[shapes.shape[alone] == SPHERE]
    axes[body[round_ones]] = IDENTITY
    axes[total == 0.0] = IDENTITY
    inertia[total == 0.0] = 0.4 * SHAPELESS_RADIUS**2
    return MassProperties(center, axes, inertia)


def volumes(kind: Array, half_extents: Array) -> Array:
    """Volumes [m^3] of boxes, balls, capsules and cylinders (C,); 0 of other kinds."""
    radius, half = half_extents[:, 0], half_extents[:, 1]
    disc = math.pi * radius**2
    return np.select(
        [kind == BOX, kind == SPHERE, kind == CAPSULE, kind == CYLINDER],
        [
            8.0 * half_extents.prod(1),
            4.0 / 3.0 * disc * radius,
            disc * (2.0 * half + 4.0 / 3.0 * radius),
            2.0 * disc * half,
        ],
        0.0,
    )


def tensors(kind: Array, half_extents: Array) -> Array:
    """Inertia (C, 3, 3) about the centre for 1 kg [m^2] of boxes, balls, capsules and cylinders; 0 of other kinds."""
    squared = (2.0 * half_extents) ** 2
    box = (squared.sum(1, keepdims=True) - squared) / 12.0
    ball = 0.4 * half_extents**2
    r, h = half_extents[:, 0], half_extents[:, 1]
    wide = r**2 / 4.0 + h**2 / 3.0
    cylinder = np.stack([wide, 0.5 * r**2, wide], 1)
    # A capsule is a cylinder with two half balls, whose own centres lie 3/8 of the radius outside of its ends.
    caps = 4.0 / 3.0 * r / (2.0 * h + 4.0 / 3.0 * r)
    wide_caps = 0.4 * r**2 + h**2 + 0.75 * h * r
    capsule = (1.0 - caps)[:, None] * cylinder + caps[:, None] * np.stack([wide_caps, 0.4 * r**2, wide_caps], 1)
    choice = [(kind == which)[:, None] for which in (BOX, SPHERE, CAPSULE, CYLINDER)]
    moments = np.select(choice, [box, ball, capsule, cylinder], 0.0)
    return np.asarray(moments[:, :, None] * np.eye(3))


def moved_centers(position: Array, rotation: Array, center: Array) -> Array:
    """Where centres (C, 3) in the shapes' own spaces are in the entities'."""
    return np.asarray(position + rotate(rotation, center))


def _principal_axes(tensor: Array) -> tuple[Array, Array]:
    diagonal = np.einsum("nii->ni", tensor).copy()
    axes = np.tile(IDENTITY, (len(tensor), 1))
    off = abs(tensor[:, [0, 0, 1], [1, 2, 2]]).max(1, initial=0.0)
    turned = np.flatnonzero(off > _ROUNDING * diagonal.max(1, initial=0.0))
    if turned.size:
        moments, vectors = np.linalg.eigh(tensor[turned])
        vectors[np.linalg.det(vectors) < 0.0, :, 2] *= -1.0
        diagonal[turned] = moments
        axes[turned] = from_matrix(vectors)
    return axes, diagonal
