"""What a step has found to be wrong, as sentences: who, why, and what to do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.kernels.tables import DYNAMIC, TOLD_SPEED
from elys.sim_node.physics.settings import PhysicsSettings
from elys.sim_node.physics.states import Problem

Array = np.ndarray[Any, Any]
Named = Callable[[int], str]  # how an entity is called in a sentence

EXPLOSION = 100.0  # how many times the kinetic energy a step may give what was there, or could have come from outside

CALM = (
    0.3  # speed that pushing out an overlap may give, so that a world at rest does not explode by moving at all [m/s]
)


def not_finite(bodies: BodyTable, rows: Array, named: Named) -> list[Problem]:
    """Bodies in rows whose numbers are not finite any more."""
    return [
        Problem(
            int(entity),
            f"{named(entity)} got numbers that are not finite in a physics step; it stays where it was, without "
            f"motion: look for extreme masses, sizes or velocities there, then set its motion again",
            "not_finite",
        )
        for entity in bodies.rows["entity"][rows]
    ]


def too_fast(bodies: BodyTable, rows: Array, settings: PhysicsSettings, named: Named) -> list[Problem]:
    """Bodies in rows that had to be slowed down."""
    problems = []
    for row in rows:
        entity = int(bodies.rows["entity"][row])
        if bodies.rows["told"][row] & TOLD_SPEED:
            name, limit, unit = "max_linear_speed", settings.max_linear_speed, "m/s"
        else:
            name, limit, unit = "max_angular_speed", settings.max_angular_speed, "rad/s"
        text = (
            f"{named(entity)} became faster than {name} = {limit:g} {unit} and was slowed down to it: look for "
            f"forces without an end, or raise {name} in the settings if it shall be so fast"
        )
        problems.append(Problem(entity, text, "too_fast"))
    return problems


def explosion(bodies: BodyTable, settings: PhysicsSettings, dt: float, named: Named) -> list[Problem]:
    """The world's kinetic energy has grown in one step as no gravity, no blow and no push against overlap makes it grow."""
    report = bodies.report[0]
    if report["most_gained"] < 0:
        return []
    fall = sum(g * g for g in settings.gravity) * dt * dt
    brought = 0.5 * report["mass"] * (fall + report["driven"] + CALM**2)
    if not report["kinetic_after"] > EXPLOSION * (report["kinetic_before"] + brought + report["forced"]):
        return []
    entity = int(bodies.rows["entity"][report["most_gained"]])
    text = (
        f"the kinetic energy grew from {report['kinetic_before']:.3g} to {report['kinetic_after']:.3g} J in one step, most of it "
        f"at {named(entity)}: look for bodies that were put into each other, or for extreme masses there"
    )
    return [Problem(entity, text, "explosion")]


def deep_overlaps(bodies: BodyTable, body_of: Array, pairs: Array, depths: Array, named: Named) -> list[Problem]:
    """Pairs (M,) of colliders on bodies in rows `body_of` that were put into each other by depths (M,) [m].

    Each body that can move is named once, with the other into which it reaches deepest.
    """
    sides = np.stack([body_of[pairs["a"]], body_of[pairs["b"]]], axis=1)
    moves = bodies.rows["motion"][sides] == DYNAMIC
    who = np.where(moves[:, 0], sides[:, 0], sides[:, 1])
    other = np.where(moves[:, 0], sides[:, 1], sides[:, 0])
    problems = []
    told: set[int] = set()
    for place in np.lexsort((who, -depths)):
        entity = int(bodies.rows["entity"][who[place]])
        if entity in told:
            continue
        told.add(entity)
        into = named(bodies.rows["entity"][other[place]])
        text = (
            f"{named(entity)} was put {depths[place]:.3g} m deep into {into}: they are pushed apart slowly; place them "
            f"side by side, or let layer and mask keep them from meeting"
        )
        problems.append(Problem(entity, text, "deep_overlap"))
    return problems
