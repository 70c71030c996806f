"""Mass, centre of mass and inertia of bodies from their shapes.

A body's mass is shared among its shapes by volume. What the shapes do not fill, and where they overlap, is not considered:
overlapping shapes count twice, as if they stood beside each other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from elys.common.math.quaternion import IDENTITY, from_matrix, to_matrix
from elys.sim_node.physics.kernels.tables import SPHERE

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
    shape: Array  # (C,) BOX or SPHERE
    half_extents: Array  # (C, 3) [m]
    position: Array  # (C, 3) [m]
    rotation: Array  # (C, 4)


def mass_properties(shapes: Shapes, body_count: int) -> MassProperties:
    """Centre of mass, principal axes and moments of every body, per kilogram of its mass."""
    body = shapes.body
    share = _shares(shapes, body_count)
    center = np.zeros((body_count, 3))
    for k in range(3):
        center[:, k] = np.bincount(body, share * shapes.position[:, k], body_count)
    own = _own_moments(shapes)
    turn = to_matrix(shapes.rotation)
    away = shapes.position - center[body]
    # Steiner: the tensor of a shape about the body's centre of mass.
    steiner = (away**2).sum(1)[:, None, None] * np.eye(3) - away[:, :, None] * away[:, None, :]
    tensor = np.zeros((body_count, 3, 3))
    np.add.at(tensor, body, share[:, None, None] * ((turn * own[:, None, :]) @ turn.transpose(0, 2, 1) + steiner))
    axes, inertia = _principal_axes(tensor)

    # Exact where no tensor needs to be diagonalised: one shape alone has its own axes.
    counts = np.bincount(body, minlength=body_count)
    alone = np.flatnonzero(counts[body] == 1)
    axes[body[alone]] = shapes.rotation[alone]
    inertia[body[alone]] = own[alone]
    round_ones = alone[shapes.shape[alone] == SPHERE]
    axes[body[round_ones]] = IDENTITY
    axes[counts == 0] = IDENTITY
    inertia[counts == 0] = 0.4 * SHAPELESS_RADIUS**2
    return MassProperties(center, axes, inertia)


def _shares(shapes: Shapes, body_count: int) -> Array:
    half = shapes.half_extents
    volume = np.where(shapes.shape == SPHERE, 4.0 / 3.0 * math.pi * half[:, 0] ** 3, 8.0 * half.prod(1))
    return np.asarray(volume / np.bincount(shapes.body, volume, body_count)[shapes.body])


def _own_moments(shapes: Shapes) -> Array:
    """Of each shape about its own centre, per kilogram: 2/5 r^2 of a ball, 1/12 (y^2 + z^2) of a box of full sides x y z."""
    squared = (2.0 * shapes.half_extents) ** 2
    box = (squared.sum(1, keepdims=True) - squared) / 12.0
    ball = 0.4 * shapes.half_extents**2
    return np.where((shapes.shape == SPHERE)[:, None], ball, box)


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
