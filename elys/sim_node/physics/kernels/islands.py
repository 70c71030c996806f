"""Islands: bodies that hold on to each other, and how strongly each island has to be solved.

A contact that is solved in n substeps gives way like a spring whose stiffness grows with n^2. What presses on it is known
from the last step; so each island is given the fewest substeps with which none of its contacts would give way more than
is allowed. Most need the fewest there are; a column, or something heavy on something light, gets more, and pays for itself
alone. The more bodies an island has the more is allowed, up to ten times as much for hundreds, and those may do with half
of the fewest: a heap need not be exact to a fraction of a millimetre.
"""

from __future__ import annotations

import math

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.fields import field_at
from elys.sim_node.physics.kernels.tables import DYNAMIC, JOINTED, KINEMATIC, POINTS, STATIC

LAYERS = 9.5  # up to which each contact of an island may give way by the allowed overlap: higher up it adds up
LOW = 1.2  # how much more it may give way in a lower one, at most
HUGE = 512  # bodies from which on an island is solved coarsely
SIDE = 1.1547  # of a cube, whose corners are 1 from its middle
COARSE = 10.0  # how much more its contacts may give way; those of a smaller one by its size cubed
EASED = 0.9  # of the allowed overlap, below which a weaker solution would do
PATIENCE = 60  # steps for which it must have been so: a change shakes what stands
BELIEF = 1.1  # a contact's load is believed to grow so fast a step, and by the weight on it: a blow is not a load


@inner
def root_of(parent, i):
    """The body that stands for an island; halves the way there for the next who asks."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@inner
def join(parent, a, b):
    """Makes one island of two; the smaller row stands for both, whatever the order of joining."""
    a = root_of(parent, a)
    b = root_of(parent, b)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b


@inner
def is_moving(body):
    moves = False
    for k in range(6):
        moves = moves or body.velocity[k] != 0.0
    return moves


@inner
def pressing(first, second, manifold, constants):
    """The force that a contact has to hold [N]: what it held in the last steps, at least the weight of the upper body."""
    gx, gy, gz = field_at(second if first.inverse_mass == 0.0 else first, constants)
    n = manifold.normal
    along = gx * n[0] + gy * n[1] + gz * n[2]
    upper = first if along > 0.0 else second
    weight = abs(along * upper.gravity_scale) / upper.inverse_mass if upper.inverse_mass > 0.0 else 0.0
    total = 0.0
    for k in range(POINTS):
        total += manifold.step_impulse[k]
    load = min(total / constants.time, BELIEF * manifold.load + weight)
    manifold.load = load
    return max(load, weight)


@inner
def contact_overlap(first, second, manifold, strengths, constants):
    """How much a contact gives way when it is solved with the first row of STRENGTH [m]."""
    inverse_mass = first.inverse_mass + second.inverse_mass
    softness = strengths[0].softness
    if first.inverse_mass == 0.0 or second.inverse_mass == 0.0:
        softness *= 0.25  # twice the frequency
    return softness * pressing(first, second, manifold, constants) * inverse_mass


@inner
def strength_against(overlap, allowed, least, present, strengths):
    """The weakest row of STRENGTH, from `least` on, with which a contact gives way no more than is allowed."""
    chosen = least
    while chosen + 1 < strengths.shape[0]:
        ratio = strengths[chosen].substep / strengths[0].substep
        limit = EASED * allowed if chosen < present else allowed
        if overlap * ratio * ratio <= limit:
            break
        chosen += 1
    return chosen


@inner
def layers_of(island):
    """How many cubes an island is high."""
    return 1.0 + (island.high - island.low) * island.body_count / (SIDE * island.extent)


@inner
def allowance(island):
    """How much each contact of an island may give way: in a high one the overlaps add up, so less; in a large one more."""
    if island.body_count > HUGE:
        return COARSE
    size = island.body_count / HUGE
    return min(LAYERS / layers_of(island), LOW) * (1.0 + (COARSE - 1.0) * size * size * size)


@inner
def least_strength(island):
    """The weakest row of STRENGTH that an island may be solved with: the first only where it is huge and has no joints."""
    return 0 if island.body_count > HUGE and island.is_jointed == 0 else 1


@inner
def first_strength(island, strengths, constants):
    """The strength for an island that was none before. No contact tells of its load yet: it is taken for a column of equals."""
    g = constants.gravity
    weight = (layers_of(island) - 1.0) * math.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    allowed = constants.overlap * allowance(island)
    return strength_against(2.0 * strengths[0].softness * weight, allowed, least_strength(island), 0, strengths)


@inner
def join_by_joints(bodies, links, parent):
    """Marks the awake bodies that joints hold and joins them into islands."""
    for k in range(links.shape[0]):
        a = links[k, 0]
        b = links[k, 1]
        for i in (a, b):
            if i >= 0 and bodies[i].motion != STATIC and bodies[i].asleep == 0:
                bodies[i].held = JOINTED
        if a < 0 or b < 0 or bodies[a].asleep != 0 or bodies[b].asleep != 0:
            continue
        if bodies[a].motion == DYNAMIC and bodies[b].motion == DYNAMIC:
            join(parent, a, b)


@inner
def join_islands(bodies, awake, awake_count, colliders, pairs, touching, touching_count, links, parent):
    """Marks the bodies that contacts and joints hold and joins them into islands."""
    for index in range(awake_count):
        i = awake[index]
        bodies[i].held = 0
        parent[i] = i
    for t in range(touching_count):
        pair = pairs[touching[t]]
        a = colliders[pair.a].body
        b = colliders[pair.b].body
        first = bodies[a]
        second = bodies[b]
        if first.motion != STATIC:
            first.held = 1
        if second.motion != STATIC:
            second.held = 1
        if first.motion == DYNAMIC and second.motion == DYNAMIC:
            join(parent, a, b)
    join_by_joints(bodies, links, parent)


@inner
def keep_awake(first, second):
    """What is held by something that moves of its own accord stays awake."""
    if first.motion == KINEMATIC and is_moving(first):
        second.still_time = 0.0
    elif second.motion == KINEMATIC and is_moving(second):
        first.still_time = 0.0


@inner
def keep_joined_awake(bodies, links):
    for k in range(links.shape[0]):
        a = links[k, 0]
        b = links[k, 1]
        if a >= 0 and b >= 0 and bodies[a].asleep == 0 and bodies[b].asleep == 0:
            keep_awake(bodies[a], bodies[b])


@inner
def measure_islands(bodies, awake, awake_count, parent, islands, g):
    """How many, how high and how large the bodies of each island are, and how strongly they were solved."""
    for index in range(awake_count):
        island = islands[awake[index]]
        island.low = np.inf
        island.high = -np.inf
        island.extent = 0.0
        island.body_count = 0
        island.is_jointed = 0
        island.contacts = 0
        island.wanted = 0
        island.present = 0
    for index in range(awake_count):
        i = awake[index]
        body = bodies[i]
        if body.held != 0 and body.motion == DYNAMIC:
            island = islands[root_of(parent, i)]
            p = body.position
            height = p[0] * g[0] + p[1] * g[1] + p[2] * g[2]
            island.low = min(island.low, height)
            island.high = max(island.high, height)
            island.extent += body.extent
            island.body_count += 1
            island.present = max(island.present, body.strength)
            if body.held == JOINTED:
                island.is_jointed = 1


@inner
def ask_contacts(bodies, colliders, pairs, touching, touching_count, manifolds, parent, islands, strengths, constants):
    """Writes the strength that each island's contacts ask for."""
    for t in range(touching_count):
        pair = pairs[touching[t]]
        a = colliders[pair.a].body
        b = colliders[pair.b].body
        first = bodies[a]
        second = bodies[b]
        keep_awake(first, second)
        island = islands[root_of(parent, a if first.motion == DYNAMIC else b)]
        island.contacts += 1
        allowed = constants.overlap * allowance(island)
        overlap = contact_overlap(first, second, manifolds[touching[t]], strengths, constants)
        wanted = strength_against(overlap, allowed, least_strength(island), island.present, strengths)
        island.wanted = max(island.wanted, wanted)


@kernel
def build_islands(
    bodies,
    awake,
    awake_count,
    colliders,
    pairs,
    touching,
    touching_count,
    manifolds,
    links,
    parent,
    islands,
    strengths,
    all_constants,
    is_new,
):
    """Marks the awake bodies that contacts and joints hold, and gives each the strength of its island.

    Returns whether any strength has changed. Unless `is_new` the same hold on to each other as in the last step.

    Parameters: links (L, 2) are the body rows that joints hold together, -1 for the world; parent (N,) int32 and islands
    (N,) are room; afterwards root_of(parent, i) is the row of body i's island.
    """
    constants = all_constants[0]
    if is_new:
        join_islands(bodies, awake, awake_count, colliders, pairs, touching, touching_count, links, parent)
    keep_joined_awake(bodies, links)
    measure_islands(bodies, awake, awake_count, parent, islands, constants.down)
    ask_contacts(bodies, colliders, pairs, touching, touching_count, manifolds, parent, islands, strengths, constants)
    is_changed = False
    for index in range(awake_count):
        i = awake[index]
        body = bodies[i]
        before = body.strength
        if body.held != 0 and body.motion == DYNAMIC:
            root = root_of(parent, i)
            island = islands[root]
            if root == i:  # the first of its island to come by decides for all
                island.wanted = max(island.wanted, least_strength(island))
                if island.present == 0:
                    island.wanted = max(island.wanted, first_strength(island, strengths, constants))
                is_calm = island.wanted < island.present
                body.calm = min(body.calm + 1, PATIENCE) if is_calm else 0
                if is_calm and body.calm < PATIENCE:
                    island.wanted = island.present
                elif is_calm:
                    body.calm = 0
            body.strength = island.wanted
        else:
            body.strength = 0
            body.calm = 0
        is_changed = is_changed or body.strength != before
    return is_changed
