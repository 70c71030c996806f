"""Forces, torques and impulses from outside, on many bodies at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.common.math import quaternion
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.kernels.tables import DYNAMIC

Array = np.ndarray[Any, Any]


def wrenches(bodies: BodyTable, rows: Array, force: Array, torque: Array, point: Array | None) -> Array:
    """Forces (M, 3) at centres of mass or at points (M, 3) in world space, with torques (M, 3), as (M, 6) about the centres."""
    if point is not None:
        torque = torque + np.cross(point - bodies.rows["position"][rows], force)
    return np.concatenate([force, torque], axis=1)


def push_once(bodies: BodyTable, rows: Array, wrench: Array) -> None:
    """Adds to what acts on bodies, of which one may come several times, during the next step: (M, 6) [N] and [N m]."""
    np.add.at(bodies.forces["once"], rows, np.where(_is_dynamic(bodies, rows)[:, None], wrench, 0.0))
    bodies.mark_pushed(rows)


def push_always(bodies: BodyTable, rows: Array, wrench: Array) -> None:
    """Says what acts on bodies until it is said anew: (M, 6) [N] and [N m]."""
    bodies.forces["lasting"][rows] = np.where(_is_dynamic(bodies, rows)[:, None], wrench, 0.0)
    bodies.mark_pushed(rows)


def strike(bodies: BodyTable, rows: Array, impulse: Array) -> None:
    """Changes momentum [N s] and angular momentum [N m s] of bodies at once: (M, 6)."""
    table = bodies.rows
    change = np.empty_like(impulse)
    change[:, :3] = table["inverse_mass"][rows, None] * impulse[:, :3]
    change[:, :3][_locked(bodies, rows)[:, :3]] = 0.0
    change[:, 3:] = spin_changes(bodies, rows, impulse[:, 3:])
    table["velocity"][rows] += change


def motion_at(bodies: BodyTable, rows: Array, point: Array) -> tuple[Array, Array]:
    """Velocities (M, 3) [m/s] of points (M, 3) of bodies, and the least mass (M,) [kg] that a force feels there.

    That is 1 / (1/m + r^2 / I) for the arm r and the least moment of inertia I; 0 where nothing moves the body.
    """
    table = bodies.rows[rows]
    arm = point - table["position"]
    ease = table["inverse_mass"] + (arm * arm).sum(axis=1) * table["inverse_inertia"].max(axis=1)
    mass = np.divide(1.0, ease, out=np.zeros(len(ease)), where=ease > 0.0)
    return table["velocity"][:, :3] + np.cross(table["velocity"][:, 3:], arm), mass


def spin_changes(bodies: BodyTable, rows: Array, impulse: Array) -> Array:
    """(M, 3) how angular impulses (M, 3) change angular velocities [rad/s]; nothing about locked axes."""
    rotation = bodies.rows["rotation"][rows]
    inverse = bodies.rows["inverse_inertia"][rows]
    local = quaternion.rotate(quaternion.conjugate(rotation), impulse)
    change = quaternion.rotate(rotation, inverse * local)
    locked = _locked(bodies, rows)[:, 3:]
    held = np.flatnonzero(locked.any(1) & (inverse > 0.0).all(1))
    turn = quaternion.to_matrix(rotation[held])
    inertia = turn @ ((1.0 / inverse[held])[:, :, None] * turn.transpose(0, 2, 1))
    free = ~locked[held]
    # The free part of the inertia alone counts: ones on the diagonal keep the rest solvable, and apart.
    inertia = np.where(free[:, :, None] & free[:, None, :], inertia, np.eye(3))
    change[held] = np.where(
        free, np.linalg.solve(inertia, np.where(free, impulse[held], 0.0)[:, :, None])[:, :, 0], 0.0
    )
    return np.asarray(change)


def _locked(bodies: BodyTable, rows: Array) -> Array:
    """(M, 6) bool, which axes are locked."""
    return (bodies.rows["locked"][rows, None] >> np.arange(6) & 1).astype(bool)


def _is_dynamic(bodies: BodyTable, rows: Array) -> Array:
    return np.asarray(bodies.rows["motion"][rows] == DYNAMIC)
