"""What pushes bodies from afar: gravity of the world, points that attract, forces from outside.

Point gravity pulls with a = GM r / (r^2 + softening^2)^(3/2) (Plummer). A free body flies through it by an explicit
symplectic rule of fourth order, four fields a step: Omelyan, Mryglod and Folk, "Optimized Forest-Ruth- and Suzuki-like
algorithms" (2002), in its position version. Orbits keep their energy, and a constant acceleration stays exact.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.locks import free_part

XI = 0.1786178958448091
LAMBDA = -0.2123418310626054
CHI = -0.06626458266981849


@inner
def attraction(constants, x, y, z):
    """The acceleration towards all attractors at a place."""
    ax = ay = az = 0.0
    for k in range(constants.attractor_count):
        at = 5 * k
        dx = constants.attractors[at] - x
        dy = constants.attractors[at + 1] - y
        dz = constants.attractors[at + 2] - z
        squared = dx * dx + dy * dy + dz * dz + constants.attractors[at + 4]
        if squared > 0.0:
            pull = constants.attractors[at + 3] / (squared * math.sqrt(squared))
            ax += pull * dx
            ay += pull * dy
            az += pull * dz
    return ax, ay, az


@inner
def field_at(body, constants):
    """The acceleration by gravity, of the world and of points, where a body is; its gravity_scale is left to the caller."""
    g = constants.gravity
    if constants.attractor_count == 0:
        return g[0], g[1], g[2]
    p = body.position
    ax, ay, az = attraction(constants, p[0], p[1], p[2])
    return g[0] + ax, g[1] + ay, g[2] + az


@inner
def drift(body, way):
    for k in range(3):
        body.position[k] += way * body.velocity[k]


@inner
def kick_by_field(body, time, force, constants):
    """Changes a body's velocity by all that acts on it, for some time."""
    p = body.position
    gx, gy, gz = attraction(constants, p[0], p[1], p[2])
    for k in range(3):
        pull = constants.gravity[k] + (gx if k == 0 else (gy if k == 1 else gz))
        a = body.gravity_scale * pull
        if body.pushed != 0:
            a += body.inverse_mass * (force.once[k] + force.lasting[k])
        body.velocity[k] += time * a * free_part(body.locked, k)
        if a != 0.0:
            body.still_time = 0.0


@inner
def fly_through_field(body, force, constants):
    """The whole step of a free body among attractors."""
    h = constants.time
    drift(body, XI * h)
    kick_by_field(body, (0.5 - LAMBDA) * h, force, constants)
    drift(body, CHI * h)
    kick_by_field(body, LAMBDA * h, force, constants)
    drift(body, (1.0 - 2.0 * (CHI + XI)) * h)
    kick_by_field(body, LAMBDA * h, force, constants)
    drift(body, CHI * h)
    kick_by_field(body, (0.5 - LAMBDA) * h, force, constants)
    drift(body, XI * h)
