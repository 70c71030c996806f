"""Islands: bodies that hold on to each other, and how strongly each island has to be solved.

A contact that is solved in n substeps gives way like a spring whose stiffness grows with n^2. What presses on it is known
from the last step; so each island is given the fewest substeps with which none of its contacts would give way more than
is allowed. Most need the fewest there are; a column, or something heavy on something light, gets more, and pays for itself
alone. An island of very many bodies is allowed ten times as much: a heap need not be exact to a fraction of a millimetre.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.tables import DYNAMIC, POINTS, STATIC

COLUMN = 64  # bodies up to which each contact of an island may give way by the allowed overlap
SMALL = 512  # bodies up to which an island is solved exactly at all
COARSE = 10.0  # how much more contacts of a larger one may give way
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
def pressing(first, second, manifold, constants):
    """The force that a contact has to hold [N]: what it held in the last steps, at least the weight of the upper body."""
    g = constants.gravity
    n = manifold.normal
    along = g[0] * n[0] + g[1] * n[1] + g[2] * n[2]
    upper = first if along > 0.0 else second
    weight = abs(along * upper.gravity_scale) / upper.inverse_mass if upper.inverse_mass > 0.0 else 0.0
    total = 0.0
    for k in range(POINTS):
        total += manifold.step_impulse[k]
    load = min(total / constants.time, BELIEF * manifold.load + weight)
    manifold.load = load
    return max(load, weight)


@inner
def wanted_strength(first, second, manifold, allowed, present, strengths, constants):
    """The weakest row of STRENGTH with which a contact gives way no more than is allowed."""
    inverse_mass = first.inverse_mass + second.inverse_mass
    softness = strengths[0].softness
    if first.inverse_mass == 0.0 or second.inverse_mass == 0.0:
        softness *= 0.25  # twice the frequency
    overlap = softness * pressing(first, second, manifold, constants) * inverse_mass
    chosen = 0
    while chosen + 1 < strengths.shape[0]:
        ratio = strengths[chosen].substep / strengths[0].substep
        limit = EASED * allowed if chosen < present else allowed
        if overlap * ratio * ratio <= limit:
            break
        chosen += 1
    return chosen


@inner
def allowance(body_count):
    """How much each contact of an island may give way: in a high one the overlaps add up, so less; in a huge one more."""
    if body_count <= COLUMN:
        return 1.0
    return math.sqrt(COLUMN / body_count) if body_count <= SMALL else COARSE


@inner
def find_islands(bodies, colliders, pairs, touching, touching_count, parent, islands):
    """Marks the bodies that contacts hold and joins them into islands."""
    for i in range(bodies.shape[0]):
        bodies[i].held = 0
        parent[i] = i
        island = islands[i]
        island.body_count = 0
        island.wanted = 0
        island.present = 0
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
    for i in range(bodies.shape[0]):
        if bodies[i].held != 0:
            island = islands[root_of(parent, i)]
            island.body_count += 1
            island.present = max(island.present, bodies[i].strength)


@inner
def ask_contacts(bodies, colliders, pairs, touching, touching_count, manifolds, parent, islands, strengths, constants):
    """Writes the strength that each island's contacts ask for."""
    for t in range(touching_count):
        pair = pairs[touching[t]]
        a = colliders[pair.a].body
        b = colliders[pair.b].body
        first = bodies[a]
        second = bodies[b]
        island = islands[root_of(parent, a if first.motion == DYNAMIC else b)]
        allowed = constants.overlap * allowance(island.body_count)
        wanted = wanted_strength(first, second, manifolds[pair.slot], allowed, island.present, strengths, constants)
        island.wanted = max(island.wanted, wanted)


@kernel
def build_islands(
    bodies, colliders, pairs, touching, touching_count, manifolds, parent, islands, strengths, all_constants
):
    """Marks the bodies that contacts hold, and gives each the strength of its island; whether any strength has changed.

    Parameters: parent (N,) int32 and islands (N,) are room; afterwards root_of(parent, i) is the row of body i's island.
    """
    find_islands(bodies, colliders, pairs, touching, touching_count, parent, islands)
    ask_contacts(
        bodies, colliders, pairs, touching, touching_count, manifolds, parent, islands, strengths, all_constants[0]
    )
    is_changed = False
    for i in range(bodies.shape[0]):
        body = bodies[i]
        before = body.strength
        if body.held != 0 and body.motion == DYNAMIC:
            root = root_of(parent, i)
            island = islands[root]
            if root == i:  # the first of its island to come by decides for all
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


@kernel
def list_held(bodies, held, groups):
    """Lists the rows of held bodies by strength, those that no force moves last; fills the groups' ranges of `held` (N,).

    Returns where the list of the latter ends; it begins where the last group ends.
    """
    for g in range(groups.shape[0]):
        groups[g].last_body = 0
    for i in range(bodies.shape[0]):
        if bodies[i].held != 0 and bodies[i].motion == DYNAMIC:
            groups[bodies[i].strength].last_body += 1
    at = 0
    for g in range(groups.shape[0]):
        groups[g].first_body = at
        at += groups[g].last_body
        groups[g].last_body = groups[g].first_body
    end = at
    for i in range(bodies.shape[0]):
        if bodies[i].held == 0:
            continue
        if bodies[i].motion == DYNAMIC:
            group = groups[bodies[i].strength]
            held[group.last_body] = i
            group.last_body += 1
        else:
            held[end] = i
            end += 1
    return end
