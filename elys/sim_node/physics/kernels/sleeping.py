"""Bodies at rest fall asleep, island by island, and cost nothing until something touches them.

The members of a sleeping island are linked in a ring, `next_asleep`, so that all of them wake together.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.islands import is_moving, root_of
from elys.sim_node.physics.kernels.tables import DYNAMIC, STATIC
from elys.sim_node.physics.kernels.tree import FAR

AWAKE, ASLEEP, WAKING = 0, 1, 2


@kernel
def list_awake(bodies, colliders, proxies, awake, awake_colliders):
    """Lists the rows of bodies that may move, and of their colliders and those that have no fat box yet, ascending.

    Returns how many bodies, how many colliders, and how many of the latter do not belong to a body that may move: they
    are listed for one step.
    """
    body_count = 0
    for i in range(bodies.shape[0]):
        if bodies[i].motion != STATIC and bodies[i].asleep == AWAKE:
            awake[body_count] = i
            body_count += 1
    count = 0
    fresh = 0
    for c in range(colliders.shape[0]):
        body = bodies[colliders[c].body]
        if body.motion != STATIC and body.asleep == AWAKE:
            awake_colliders[count] = c
            count += 1
            continue
        for k in range(3):
            proxies[c].velocity[k] = body.velocity[k]  # which it lost as it fell asleep
        if proxies[c].fat_box[0] == FAR:
            awake_colliders[count] = c
            count += 1
            fresh += 1
    return body_count, count, fresh


@inner
def disturbs(body, other):
    """Whether a body that touches another one wakes it."""
    if other.motion != DYNAMIC or other.asleep == AWAKE:
        return False
    return (body.motion == DYNAMIC and body.asleep == AWAKE) or (body.motion != DYNAMIC and is_moving(body))


@kernel
def wake_marked(bodies):
    """Wakes every body that is marked as WAKING, with its whole island; returns how many."""
    count = 0
    for i in range(bodies.shape[0]):
        if bodies[i].asleep != WAKING:
            continue
        j = i
        while bodies[j].asleep != AWAKE:
            bodies[j].asleep = AWAKE
            bodies[j].still_time = 0.0
            count += 1
            j = bodies[j].next_asleep
    return count


@kernel
def put_to_sleep(bodies, poses, awake, awake_count, parent, islands, last, all_constants):
    """Puts islands to sleep whose bodies have all been still for long enough; returns how many bodies fell asleep.

    `last` (N,) int32 is room.
    """
    constants = all_constants[0]
    for index in range(awake_count):
        islands[awake[index]].still_time = np.inf
    for index in range(awake_count):
        i = awake[index]
        body = bodies[i]
        if body.motion != DYNAMIC:
            continue
        v = body.velocity
        slow = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < constants.sleep_speed * constants.sleep_speed
        calm = v[3] * v[3] + v[4] * v[4] + v[5] * v[5] < constants.sleep_spin * constants.sleep_spin
        body.still_time = body.still_time + constants.time if slow and calm else 0.0
        island = islands[root_of(parent, i)]
        island.still_time = min(island.still_time, body.still_time)
    fallen = 0
    for index in range(awake_count):
        i = awake[index]
        body = bodies[i]
        if body.motion != DYNAMIC:
            continue
        root = root_of(parent, i)
        if islands[root].still_time < constants.sleep_time:
            continue
        body.asleep = ASLEEP
        body.strength = 0
        body.calm = 0
        for k in range(6):
            body.velocity[k] = 0.0
        for k in range(3):
            poses[i].linear_velocity[k] = 0.0
            poses[i].angular_velocity[k] = 0.0
        body.next_asleep = root
        if i != root:
            bodies[last[root]].next_asleep = i
        last[root] = i
        fallen += 1
    return fallen
