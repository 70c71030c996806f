"""Boxes as sets of inequalities, and every question about them as a linear program: slow, and with no formula of its own."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation


def halfspaces(center, rotation, half):
    """(6, 3) and (6,): the points x of a box have A x <= b."""
    axes = Rotation.from_quat(rotation).as_matrix().T
    matrix = np.concatenate([axes, -axes])
    return matrix, matrix @ np.asarray(center) + np.tile(half, 2)


def depth_of_overlap(first, second):
    """The largest r such that some point lies r inside both boxes (center, rotation, half); negative when they are apart."""
    matrix, bound = (np.concatenate(parts) for parts in zip(halfspaces(*first), halfspaces(*second), strict=True))
    with_depth = np.column_stack([matrix, np.ones(len(matrix))])
    solved = linprog([0, 0, 0, -1], with_depth, bound, bounds=[(None, None)] * 4)
    return -solved.fun


def ray_interval(origin, direction, box):
    """(entry, exit) along a ray, or None; `direction` of unit length."""
    matrix, bound = halfspaces(*box)
    lines, rest = (matrix @ direction)[:, None], bound - matrix @ origin
    ends = [linprog([sign], lines, rest, bounds=[(0, None)]) for sign in (1, -1)]
    return (ends[0].fun, -ends[1].fun) if ends[0].status == 0 else None


def time_of_impact(moving, displacement, still):
    """The smallest fraction t in [0, 1] at which the moved box shares a point with the other, or None."""
    matrix_a, bound_a = halfspaces(*moving)
    matrix_b, bound_b = halfspaces(*still)
    # Unknown: the point x in space and t; x - t d lies in the box that moves, x in the other.
    rows = np.block([[matrix_a, -(matrix_a @ displacement)[:, None]], [matrix_b, np.zeros((6, 1))]])
    solved = linprog([0, 0, 0, 1], rows, np.concatenate([bound_a, bound_b]), bounds=[(None, None)] * 3 + [(0, 1)])
    return solved.fun if solved.status == 0 else None
