"""Speeds that are never exceeded, and never silently: what is cut off is listed, once for each body until it is slower."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import TOLD_SPEED, TOLD_SPIN

LARGEST = 1e38  # above it a number does not fit the 32 bits in which velocities are published, as if it were not finite


@inner
def limit_vector(v, first, most):
    """Shortens three numbers to a length; whether they were longer. What is as good as infinite stays, to be told as such."""
    squared = v[first] * v[first] + v[first + 1] * v[first + 1] + v[first + 2] * v[first + 2]
    if squared <= most * most or not squared < LARGEST:
        return False
    scale = most / math.sqrt(squared)
    for k in range(first, first + 3):
        v[k] *= scale
    return True


@inner
def limit_pair(v, linear, angular):
    """Shortens a linear and an angular vector to lengths; which of them were longer, as bits."""
    bits = TOLD_SPEED if limit_vector(v, 0, linear) else 0
    return bits | (TOLD_SPIN if limit_vector(v, 3, angular) else 0)


@inner
def note_limits(body, now):
    """Remembers what of a body was cut off, as bits; whether that has to be told."""
    before = body.told & (TOLD_SPEED | TOLD_SPIN)
    body.told = (body.told & (255 - TOLD_SPEED - TOLD_SPIN)) | now
    return (now & (255 - before)) != 0


@inner
def measure_drive(body, report):
    """Notes how fast the fastest point of what moves by itself is."""
    v = body.velocity
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    speed += body.extent * math.sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5])
    report.driven = max(report.driven, speed * speed)


@inner
def measure_energy(body, force, row, before, h, report):
    """Adds a held body's energy to the step's report; `before` is its squared speed as the step began."""
    v = body.velocity
    if body.pushed != 0:
        for k in range(3):
            push = h * (force.once[k] + force.lasting[k])
            report.forced += 0.5 * body.inverse_mass * push * push
    half_mass = 0.5 / body.inverse_mass
    after = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    report.mass += 2.0 * half_mass
    report.kinetic_before += half_mass * before
    report.kinetic_after += half_mass * after
    gain = half_mass * (after - before)
    if gain > report.gain:
        report.gain = gain
        report.most_gained = row
