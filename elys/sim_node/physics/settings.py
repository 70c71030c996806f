"""What can be chosen about physics, with units, and what follows from it for a step."""

from __future__ import annotations

import difflib
import math
from typing import Any, Literal, NamedTuple, get_args

import msgspec
import numpy as np

from elys.common.components import Vec3
from elys.common.errors import PhysicsError
from elys.sim_node.physics.kernels.tables import CONSTANTS, FORCED, MOST_ATTRACTORS, STRENGTH, Table

MOST_STRENGTHS = 8
MOST_THREADS = 64


Rule = Literal["geometric_mean", "minimum", "maximum", "average", "multiply"]
RULES: tuple[Rule, ...] = get_args(Rule)


OnProblem = Literal["continue", "pause"]


SwitchName = Literal[
    "polytopes",
    "overlap_check",
    "solver",
    "joints",
    "shared_solver",
    "strong_solver",
    "bounces",
    "rolling",
    "locked_axes",
    "gyroscopic",
    "attractors",
    "continuous_collision",
    "contact_events",
    "triggers",
    "sleepers",
]
SWITCHES: tuple[SwitchName, ...] = get_args(SwitchName)


class Attractor(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A point that attracts all bodies, by their gravity_scale: a = strength r / (r^2 + softening^2)^(3/2)."""

    position: Vec3 = (0.0, 0.0, 0.0)  # [m]
    strength: float = 0.0  # G M [m^3/s^2]: surface gravity times the squared radius of a planet; negative repels
    softening: float = 0.0  # within about this distance the pull fades instead of growing without end [m]

    def __post_init__(self) -> None:
        if not all(math.isfinite(number) for number in (*self.position, self.strength, self.softening)):
            raise PhysicsError(f"An Attractor must be made of finite numbers, not {self!r}")
        if self.softening < 0.0:
            raise PhysicsError(f"Attractor.softening must be 0 or more, not {self.softening!r}")


class PhysicsSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a world is simulated. The defaults suit things from a hand to a house in size."""

    gravity: Vec3 = (0.0, -9.81, 0.0)  # [m/s^2]
    substeps: int = 8  # parts of a step; contacts are solved in each. Half of it in islands of very many bodies
    threads: int = 1  # that work on a step together where it is large; what comes out is the same bit for bit
    strengths: int = 5  # how often substeps may be doubled for islands that need it, that and one
    contact_overlap: float = 1.1e-3  # more than this no contact of a small island shall give way [m]
    contact_stiffness: float = (
        0.125  # frequency of a contact as a share of the substeps'; twice that against what cannot move
    )
    contact_damping: float = 5.0  # damping ratio of that push; half of it against what cannot move
    push_speed: float = 3.0  # overlap is never removed faster [m/s]
    events: bool = True  # whether contacts and visits to triggers are told: about 40 ns for each contact and step
    sleeping: bool = True  # whether islands at rest fall asleep
    sleep_speed: float = 0.05  # what moves more slowly [m/s]
    sleep_spin: float = 0.1  # and turns more slowly [rad/s]
    sleep_time: float = 0.5  # for so long falls asleep [s]
    bounce_speed: float = 0.01  # slower approaches do not bounce [m/s]
    contact_margin: float = 0.02  # gap up to which contacts are kept [m]
    friction_rule: Rule = "geometric_mean"  # how the coefficients of two colliders make that of a pair
    restitution_rule: Rule = "minimum"
    recycle_distance: float = 0.01  # a manifold is kept while its bodies moved less against each other [m]
    recycle_angle: float = 0.01  # and each turned less [rad]
    attractors: tuple[Attractor, ...] = ()  # point gravity, beside the gravity that is the same everywhere
    # Limits that are never silent. Faster than 2000 m/s is no bullet and no shell; what is so fast has nearly always
    # exploded. Up to 1000 rad/s, 160 turns a second, a step at 60 Hz still turns a body to eight digits.
    max_linear_speed: float = 2000.0  # [m/s]
    max_angular_speed: float = 1000.0  # [rad/s]
    on_problem: OnProblem = (
        "continue"  # or pause: whether a running simulation stops its clock when a step finds a problem
    )
    forced: tuple[SwitchName, ...] = ()  # stages that a step does though nothing needs them: to prove that, see plan.py

    def __post_init__(self) -> None:
        numbers = {
            name: value for name in self.__struct_fields__ if isinstance(value := getattr(self, name), (int, float))
        }
        for name in ("friction_rule", "restitution_rule"):
            if getattr(self, name) not in RULES:
                raise PhysicsError(
                    f"PhysicsSettings.{name} must be one of {', '.join(RULES)}, not {getattr(self, name)!r}"
                )
        for name, value in numbers.items():
            if not (math.isfinite(value) and value >= 0.0):
                raise PhysicsError(f"PhysicsSettings.{name} must be a finite number of 0 or more, not {value!r}")
        if not all(math.isfinite(g) for g in self.gravity):
            raise PhysicsError(f"PhysicsSettings.gravity must be three finite numbers, not {self.gravity!r}")
        if len(self.attractors) > MOST_ATTRACTORS:
            raise PhysicsError(
                f"PhysicsSettings.attractors may be up to {MOST_ATTRACTORS}, not {len(self.attractors)}: leave out the weakest"
            )
        if self.on_problem not in get_args(OnProblem):
            raise PhysicsError(f"PhysicsSettings.on_problem must be continue or pause, not {self.on_problem!r}")
        _refuse_unknown(self.forced)
        if not 1 <= self.substeps <= 64:
            raise PhysicsError(f"PhysicsSettings.substeps must be from 1 to 64, not {self.substeps}")
        if not 1 <= self.threads <= MOST_THREADS:
            raise PhysicsError(f"PhysicsSettings.threads must be from 1 to {MOST_THREADS}, not {self.threads}")
        if not 1 <= self.strengths <= MOST_STRENGTHS:
            raise PhysicsError(f"PhysicsSettings.strengths must be from 1 to {MOST_STRENGTHS}, not {self.strengths}")
        if not 0.0 < self.contact_stiffness <= 0.25:
            raise PhysicsError(
                f"PhysicsSettings.contact_stiffness must be above 0 and at most 0.25, not {self.contact_stiffness}"
            )
        if self.contact_margin <= 0.0:
            raise PhysicsError("PhysicsSettings.contact_margin must be above 0, for instance 0.02 m")


def _refuse_unknown(forced: tuple[str, ...]) -> None:
    for name in forced:
        if name not in SWITCHES:
            close = difflib.get_close_matches(name, SWITCHES, n=1)
            remedy = f"did you mean '{close[0]}'?" if close else f"there are {', '.join(SWITCHES)}"
            raise PhysicsError(f"PhysicsSettings.forced names no switch '{name}'; {remedy}")


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


class SceneTraits(NamedTuple):
    """What occurs in a world at all: what does not costs nothing."""

    can_bounce: bool  # some collider has restitution
    can_roll: bool  # some collider resists rolling or spinning
    can_lock: bool  # some body has a locked axis


def step_constants(settings: PhysicsSettings, dt: float, traits: SceneTraits) -> Table:
    """The settings as the kernels read them, for a step of `dt` seconds."""
    constants: np.ndarray[Any, Any] = np.zeros(1, CONSTANTS)
    row = constants[0]
    row["time"] = dt
    row["gravity"] = settings.gravity
    strength = math.sqrt(sum(g * g for g in settings.gravity))
    row["down"] = np.asarray(settings.gravity) / strength if strength > 0.0 else 0.0
    row["margin"] = settings.contact_margin
    row["fattening"] = 0.5 * settings.contact_margin
    row["recycle_distance"] = settings.recycle_distance
    row["recycle_angle"] = settings.recycle_angle
    row["bounce_speed"] = settings.bounce_speed
    row["sleep_speed"] = settings.sleep_speed
    row["sleep_spin"] = settings.sleep_spin
    row["sleep_time"] = settings.sleep_time
    row["overlap"] = settings.contact_overlap
    row["friction_rule"] = RULES.index(settings.friction_rule)
    row["restitution_rule"] = RULES.index(settings.restitution_rule)
    forced = settings.forced
    row["can_bounce"] = FORCED if "bounces" in forced else traits.can_bounce
    row["can_roll"] = traits.can_roll or "rolling" in forced
    row["can_lock"] = traits.can_lock or "locked_axes" in forced
    row["gyroscopic"] = "gyroscopic" in forced
    row["attractor_count"] = len(settings.attractors)
    if not settings.attractors and "attractors" in forced:  # one that pulls at nobody
        row["attractor_count"], row["attractors"][4] = 1, 1.0
    for place, attractor in enumerate(settings.attractors):
        numbers = (*attractor.position, attractor.strength, attractor.softening**2)
        row["attractors"][5 * place : 5 * place + 5] = numbers
    row["max_linear_speed"] = settings.max_linear_speed
    row["max_angular_speed"] = settings.max_angular_speed
    return constants


def step_strengths(settings: PhysicsSettings, dt: float) -> Table:
    """The strengths that islands may be solved with in a step of `dt` seconds: each has twice the substeps of the last.

    The first has half of what the settings say, and is for islands of very many bodies. Forced, all are the strongest.
    """
    strengths: np.ndarray[Any, Any] = np.zeros(1 + settings.strengths, STRENGTH)
    for doublings, row in enumerate(strengths):
        if "strong_solver" in settings.forced:
            doublings = settings.strengths
        substeps = max((settings.substeps << doublings) // 2, 1)
        substep = dt / substeps
        # Stiffer than an eighth of the substep rate the push overshoots and stacks drift.
        frequency = settings.contact_stiffness / substep
        row["substeps"] = substeps
        row["substep"] = substep
        row["softness"] = 1.0 / (2.0 * math.pi * frequency) ** 2
        row["push_speed"] = settings.push_speed
        row["soft"] = soft_constraint(frequency, settings.contact_damping, substep)
        row["firm"] = soft_constraint(2.0 * frequency, 0.5 * settings.contact_damping, substep)
        row["relax_every"] = 2 if substeps % 2 == 0 else 1
    return strengths
