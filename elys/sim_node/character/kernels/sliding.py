"""Collide and slide: as near as planes allow to where a capsule wants to be, and never through anything on the way.

In each round the planes that are touched are found, the way nearest to the wanted one that respects them all is solved for (a
projection onto half-spaces by Gauss and Seidel with kept pushes, as for contacts), and swept. What lies too deep is pushed out by
the same solution.
"""

from __future__ import annotations

import math

from elys.sim_node.character.kernels.around import touched_planes
from elys.sim_node.character.kernels.sweeping import half_skinned, spread_probe, sweep
from elys.sim_node.character.kernels.tables import FLOOR
from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import DYNAMIC

ROUNDS = 6
PASSES = 256  # over the planes; sharp corners take many, a wall one
EXACT = 1e-12  # [m] a pass that changes less is the last
ENOUGH = 1e-9  # [m] a way that is shorter is none
UPRIGHT = 0.3  # least share of a normal along the level that makes a wall of what cannot be walked up


@inner
def make_walls(planes, count):
    """Turns what cannot be walked on into upright walls, as far away as it is at the capsule's height: nobody walks up it."""
    for i in range(count):
        plane = planes[i]
        if plane.slant == FLOOR:
            continue
        n = plane.normal
        across = math.sqrt(n[0] * n[0] + n[2] * n[2])
        if across < UPRIGHT:
            continue
        n[0], n[1], n[2] = n[0] / across, 0.0, n[2] / across
        plane.gap = plane.gap / across


@inner
def solve_planes(planes, count, dx, dy, dz):
    """The way nearest to (dx, dy, dz) that leaves all planes' gaps at least closed."""
    for i in range(count):
        planes[i].push = 0.0
    for _ in range(PASSES):
        change = 0.0
        for i in range(count):
            plane = planes[i]
            n = plane.normal
            gap = n[0] * dx + n[1] * dy + n[2] * dz + plane.gap
            push = max(plane.push - gap, 0.0)
            more = push - plane.push
            plane.push = push
            dx, dy, dz = dx + more * n[0], dy + more * n[1], dz + more * n[2]
            change = max(change, abs(more))
        if change < EXACT:
            break
    return dx, dy, dz


@inner
def slide(around, near_count, character, dx, dy, dz, keeps_level, passed_over):
    """Moves a character by a way, along what is in it. Returns how many planes it touches in the end, and whether any swept."""
    position = character.position
    tx, ty, tz = position[0] + dx, position[1] + dy, position[2] + dz
    middle = 0.5 * character.stature
    met = False
    count = 0
    for _ in range(ROUNDS):
        x, y, z = position[0], position[1], position[2]
        spread_probe(around, character.radius)
        count = touched_planes(around, near_count, character.least_up, x, y + middle, z)
        if keeps_level:
            make_walls(around.planes, count)
        dx, dy, dz = solve_planes(around.planes, count, tx - x, ty - y, tz - z)
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length < ENOUGH:
            break
        dx, dy, dz = dx / length, dy / length, dz / length
        spread_probe(around, half_skinned(character.radius))
        t = sweep(around, near_count, passed_over, x, y + middle, z, dx, dy, dz, length, around.hits[0])
        position[0], position[1], position[2] = x + t * dx, y + t * dy, z + t * dz
        met = True if around.hits[0].collider >= 0 else met
    spread_probe(around, character.radius)
    return count, met


@inner
def clip_velocity(planes, count, velocity, carried):
    """Takes from a velocity what leads into the planes, against their own; kinematic ones hand theirs on, loose ones do not.

    It is the velocity against what carries, which itself moves at `carried`.
    """
    vx, vy, vz = velocity[0], velocity[1], velocity[2]
    for i in range(count):
        planes[i].push = 0.0
    for _ in range(PASSES):
        change = 0.0
        for i in range(count):
            plane = planes[i]
            n, u = plane.normal, plane.velocity
            along = n[0] * (u[0] - carried[0]) + n[1] * (u[1] - carried[1]) + n[2] * (u[2] - carried[2])
            if plane.motion == DYNAMIC:
                along = min(along, 0.0)
            approach = n[0] * vx + n[1] * vy + n[2] * vz - along
            push = max(plane.push - approach, 0.0)
            more = push - plane.push
            plane.push = push
            vx, vy, vz = vx + more * n[0], vy + more * n[1], vz + more * n[2]
            change = max(change, abs(more))
        if change < EXACT:
            break
    velocity[0], velocity[1], velocity[2] = vx, vy, vz
