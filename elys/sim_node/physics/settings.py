"""What can be chosen about physics, with units, and what follows from it for a step."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from elys.common.components import Vec3
from elys.common.errors import PhysicsError
from elys.sim_node.physics.kernels.tables import CONSTANTS, Table


class PhysicsSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a world is simulated. The defaults suit things from a hand to a house in size."""

    gravity: Vec3 = (0.0, -9.81, 0.0)  # [m/s^2]
    substeps: int = 4  # parts of a step; contacts are solved in each
    contact_frequency: float = 30.0  # how fast overlap is pushed out [Hz]; twice that against what cannot move
    contact_damping: float = 10.0  # damping ratio of that push; half of it against what cannot move
    push_speed: float = 3.0  # overlap is never removed faster [m/s]
    bounce_speed: float = 0.01  # slower approaches do not bounce [m/s]
    contact_margin: float = 0.02  # gap up to which contacts are kept [m]
    recycle_distance: float = 0.01  # a manifold is kept while its bodies moved less against each other [m]
    recycle_angle: float = 0.01  # and each turned less [rad]

    def __post_init__(self) -> None:
        numbers = {name: getattr(self, name) for name in self.__struct_fields__ if name not in ("gravity", "substeps")}
        for name, value in numbers.items():
            if not (math.isfinite(value) and value >= 0.0):
                raise PhysicsError(f"PhysicsSettings.{name} must be a finite number of 0 or more, not {value!r}")
        if not all(math.isfinite(g) for g in self.gravity):
            raise PhysicsError(f"PhysicsSettings.gravity must be three finite numbers, not {self.gravity!r}")
        if not 1 <= self.substeps <= 64:
            raise PhysicsError(f"PhysicsSettings.substeps must be from 1 to 64, not {self.substeps}")
        if self.contact_margin <= 0.0:
            raise PhysicsError("PhysicsSettings.contact_margin must be above 0, for instance 0.02 m")


def soft_constraint(frequency: float, damping_ratio: float, time_step: float) -> tuple[float, float, float]:
    """How a constraint gives way like a damped spring, whatever the masses.

    Returns the rate at which an error is pushed out [1/s], the share of the effective mass and the share of the
    accumulated impulse given back: Catto, "Soft Constraints" (GDC 2011).
    """
    omega = 2.0 * math.pi * frequency
    a1 = 2.0 * damping_ratio + time_step * omega
    a2 = time_step * omega * a1
    a3 = 1.0 / (1.0 + a2)
    return omega / a1, a2 * a3, a3


def step_constants(settings: PhysicsSettings, dt: float, *, can_bounce: bool) -> Table:
    """The settings as the kernels read them, for a step of `dt` seconds."""
    substep = dt / settings.substeps
    # Stiffer than an eighth of the substep rate the push overshoots and stacks drift.
    frequency = min(settings.contact_frequency, 0.125 / substep)
    constants: np.ndarray[Any, Any] = np.zeros(1, CONSTANTS)
    row = constants[0]
    row["substep"] = substep
    row["substeps"] = settings.substeps
    row["gravity"] = settings.gravity
    row["margin"] = settings.contact_margin
    row["fattening"] = 0.5 * settings.contact_margin
    row["recycle_distance"] = settings.recycle_distance
    row["recycle_angle"] = settings.recycle_angle
    row["push_speed"] = settings.push_speed
    row["bounce_speed"] = settings.bounce_speed
    row["soft"] = soft_constraint(frequency, settings.contact_damping, substep)
    row["firm"] = soft_constraint(2.0 * frequency, 0.5 * settings.contact_damping, substep)
    row["can_bounce"] = can_bounce
    return constants
