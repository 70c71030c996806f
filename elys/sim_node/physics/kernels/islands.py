"""Islands: bodies that hold on to each other, and how strongly each island has to be solved.

A contact that is solved in n substeps gives way like a spring whose stiffness grows with n^2. What presses on it is known
from the last step; so each island is given the fewest substeps with which none of its contacts would give way more than
is allowed. Most need the fewest there are; a column, or something heavy on something light, gets more, and pays for itself
alone. An island of very many bodies is allowed ten times as much: a heap need not be exact to a fraction of a millimetre.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.tables import DYNAMIC, POINTS, STATIC

SMALL = 512  # bodies up to which an island is solved to the allowed overlap [1]
COARSE = 10.0  # how much more a larger one may give way
EASED = 0.9  # of the allowed overlap, below which an island is solved more weakly again


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
    """The force that a contact has to hold [N], for now.

    The weight of an upper body is there from the first touch. More is believed only as fast as doubling a step, so that a
    blow is not taken for a load.
    """
    g = constants.gravity
    n = manifold.normal
    along = g[0] * n[0] + g[1] * n[1] + g[2] * n[2]
    upper = first if along > 0.0 else second
    weight = abs(along * upper.gravity_scale) / upper.inverse_mass if upper.inverse_mass > 0.0 else 0.0
    total = 0.0
    for k in range(POINTS):
        total += manifold.step_impulse[k]
    load = min(total / constants.time, 2.0 * manifold.load + weight)
    manifold.load = load
    return max(load, weight)


@inner
def wanted_strength(first, second, manifold, allowed, strengths, constants):
    """The weakest row of STRENGTH that holds a contact; a stronger one is kept a little longer."""
    inverse_mass = first.inverse_mass + second.inverse_mass
    softness = strengths[0].softness
    if first.inverse_mass == 0.0 or second.inverse_mass == 0.0:
        softness *= 0.25  # twice the frequency
    overlap = softness * pressing(first, second, manifold, constants) * inverse_mass
    before = first.strength if first.motion == DYNAMIC else second.strength
    chosen = 0
    while chosen + 1 < strengths.shape[0]:
        ratio = strengths[chosen].substep / strengths[0].substep
        limit = EASED * allowed if chosen < before else allowed
        if overlap * ratio * ratio <= limit:
            break
        chosen += 1
    return chosen


@kernel
def build_islands(bodies, colliders, pairs, touching, touching_count, manifolds, parent, size, strengths, all_constants):
    """Marks the bodies that contacts hold, and gives each the strength of its island; whether any strength has changed.

    Parameters: parent (N,) and size (N,) int32 are room; afterwards root_of(parent, i) is body i's island.
    """
    constants = all_constants[0]
    n = bodies.shape[0]
    for i in range(n):
        bodies[i].held = 0
        parent[i] = i
        size[i] = 0
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
    for i in range(n):
        if bodies[i].held != 0:
            size[root_of(parent, i)] += 1
    for i in range(n):
        # From here on the size tells what is allowed, and is overwritten by the strength: as a negative number.
        if size[i] > 0:
            size[i] = -1 if size[i] <= SMALL else -100
    for t in range(touching_count):
        pair = pairs[touching[t]]
        first = bodies[colliders[pair.a].body]
        second = bodies[colliders[pair.b].body]
        root = root_of(parent, colliders[pair.a].body if first.motion == DYNAMIC else colliders[pair.b].body)
        code = size[root]
        allowed = constants.overlap * (COARSE if code <= -100 else 1.0)
        chosen = wanted_strength(first, second, manifolds[pair.slot], allowed, strengths, constants)
        now = -code - 100 if code <= -100 else -code - 1
        if chosen > now:
            size[root] -= chosen - now
    is_changed = False
    for i in range(n):
        body = bodies[i]
        before = body.strength
        if body.held != 0 and body.motion == DYNAMIC:
            code = size[root_of(parent, i)]
            body.strength = -code - 100 if code <= -100 else -code - 1
        else:
            body.strength = 0
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
